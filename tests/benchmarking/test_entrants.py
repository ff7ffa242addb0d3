"""Trust models as objects in a benchmark: odd ones, and results that must not be mixed."""

import os
import subprocess
import sys
import threading
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from refusals import refuses
from small_suites import tiny

from roletrust_env.benchmarking import benchmark
from roletrust_env.benchmarking.entrants import name_entrants, pack, register_packed
from roletrust_env.benchmarking.sources import fingerprint, hashes
from roletrust_env.evaluation.specs import parse_trust_model
from roletrust_env.trust.model import registry as trust_models
from roletrust_env.trust.models.central.means import Mean
from roletrust_env.world import make_scenario

SUITE = tiny()
here = partial(benchmark, suite=SUITE, attacks=["bad-mouthing"], workers=0, progress=False)


class Slow(Mean):
    """The mean, with a parameter."""

    def __init__(self, weight: float) -> None:
        self.weight = weight

    def provider_trust(self, state: Any) -> Any:
        """See `TrustModel.provider_trust`."""
        return self.weight * super().provider_trust(state)


class Unsent(Mean):
    """A model that holds what no other process can have."""

    def __init__(self) -> None:
        self.lock = threading.Lock()


class Broken(Mean):
    """A model that another process cannot load."""

    def __reduce__(self) -> tuple[Any, ...]:
        return eval, ("1 / 0",)


class Unmade(Mean):
    """A class that ends Python."""

    def __init__(self) -> None:
        raise SystemExit(3)


def test_results_of_other_parameters_are_not_mixed(tmp_path: Path) -> None:
    first = here(Slow(0.5), out=tmp_path)
    assert str(here(Slow(0.5), out=tmp_path).rows) == str(first.rows)
    with refuses(ValueError, "results.sqlite", "--out"):
        here(Slow(0.9), out=tmp_path)


def test_results_of_factories_with_other_parameters_are_not_mixed() -> None:
    found = [hashes({"it": partial(Slow, weight)}) for weight in (0.5, 0.9, 0.5)]
    assert found[0] == found[2] != found[1]


@dataclass(frozen=True)
class Parameters:
    """Parameters of several kinds."""

    cut: float = 0.1
    names: frozenset[str] = frozenset({"a", "b", "c"})


def _closure(weight: float) -> Any:
    class Inner(Mean):
        def start(self, ratings: Any, peers: Any = None) -> Any:
            return weight

    return Inner()


def test_a_fingerprint_tells_objects_apart() -> None:
    for one, other in (
        (Parameters(), Parameters(cut=0.2)),
        (np.zeros(3), np.ones(3)),
        (np.zeros(2), np.zeros(2, np.float32)),
        (_closure(0.1), _closure(0.2)),
        (type("Sub", (Mean,), {"cut": 1})(), type("Sub", (Mean,), {"cut": 2})()),
        (lambda x: x + 1, lambda x: x + 2),
        ({"a": [1]}, {"a": (1,)}),
        (np.random.default_rng(0), np.random.default_rng(1)),
    ):
        assert fingerprint(one) == fingerprint(one)
        assert fingerprint(one) != fingerprint(other)


def test_a_fingerprint_is_that_of_every_process() -> None:
    code = (
        "from roletrust_env.benchmarking.sources import fingerprint\n"
        "class A:\n"
        "    def __init__(self): self.me, self.names = self, {'a', 'b', 'c', 'd'}\n"
        "    def f(self): return {'x', 'y', 'z'}\n"
        "print(fingerprint(A()))"
    )
    found = {
        subprocess.run(
            [sys.executable, "-c", code],
            env={**os.environ, "PYTHONHASHSEED": seed},
            capture_output=True,
            check=True,
        ).stdout
        for seed in ("1", "2")
    }
    assert len(found) == 1


def test_a_tensor_has_a_fingerprint() -> None:
    torch = pytest.importorskip("torch")
    assert fingerprint(torch.zeros(3)) == fingerprint(torch.zeros(3)) != fingerprint(torch.ones(3))


def test_a_name_that_is_refused_leaves_no_other_behind() -> None:
    with refuses(ValueError, "My Model"):
        here([Slow(0.5), type("My Model", (Mean,), {})()])
    assert "Slow" not in trust_models.names()


def test_a_model_that_cannot_be_sent_is_named() -> None:
    with refuses(ValueError, "Unsent", "workers", "0"):
        here(Unsent(), workers=1)


def test_a_model_that_cannot_be_loaded_affects_no_other() -> None:
    _, instances = name_entrants([Broken(), Slow(0.5)])
    register_packed(pack(instances))
    try:
        assert parse_trust_model("Slow", make_scenario("paper-3x3")).weight == 0.5  # type: ignore[attr-defined]
        with refuses(ValueError, "Broken", "ZeroDivisionError"):
            parse_trust_model("Broken", make_scenario("paper-3x3"))
    finally:
        for name in instances:
            trust_models.unregister(name)


def test_a_class_that_cannot_be_made_is_an_error_of_one_line() -> None:
    with refuses(ValueError, "SystemExit", "3"):
        here(Unmade)


def test_arguments_that_make_no_sense_are_refused() -> None:
    wrong: list[tuple[dict[str, Any], str]] = [
        ({"models": []}, ("models",)),
        ({"models": "mean", "attacks": ()}, ("attacks",)),
        ({"models": "mean", "workers": -1}, ("workers", "-1")),
        ({"models": "mean", "workers": "2"}, ("workers", "2")),
        ({"models": "mean", "suite": {"name": "x"}}, ("suite",)),
    ]
    for arguments, words in wrong:
        with refuses(ValueError, *words):
            here(**arguments)


def test_one_attack_needs_no_list() -> None:
    board = here("mean", attacks="bad-mouthing")
    assert board.suite.attacks == ("bad-mouthing",)


@pytest.mark.parametrize(
    ("field", "names"), [("models", ("mean", "mean")), ("attacks", ()), ("methods", ())]
)
def test_a_suite_has_models_and_attacks_each_once(field: str, names: tuple[str, ...]) -> None:
    with refuses(ValueError, field):
        tiny(**{field: names})
