"""The bad-mouthing attack."""

from typing import Any

import numpy as np
import pytest
import torch
from refusals import refuses

from roletrust_baselines import BadMouthing
from roletrust_env import make_attacker
from roletrust_env.game.views import RaterView

SERVICE = [0.8, 0.4, 1.0]


def ratings(policy: BadMouthing, round: float = 0.0) -> list[float]:
    service = np.array(SERVICE)
    view = RaterView(
        np.array(round), np.array(0.5), service, service, service >= 0, service, service >= 0
    )
    return policy.ratings(view, None, None)[0].tolist()


@pytest.mark.parametrize(
    ("policy", "expected"),
    [
        (BadMouthing(), [0.5, 0.5, 0.5]),
        (BadMouthing(level=0.0), [0, 0, 0]),
        (BadMouthing(lie="relative"), [0.4, 0.2, 0.5]),
        (BadMouthing(lie="relative", level=0.25), [0.6, 0.3, 0.75]),
        (BadMouthing(targets=(1,)), [0.8, 0.5, 1.0]),
        (BadMouthing(lie="relative", level=1, targets=(0, 2)), [0, 0.4, 0]),
    ],
    ids=str,
)
def test_lies(policy: BadMouthing, expected: list[float]) -> None:
    assert ratings(policy) == pytest.approx(expected)


@pytest.mark.parametrize("targets", [None, (0, 1, 2)])
def test_it_lies_within_its_window_only(targets: tuple[int, ...] | None) -> None:
    policy = BadMouthing(start=3, stop=6, targets=targets)
    lies = [ratings(policy, t) == [0.5] * 3 for t in range(8)]
    assert lies == [False, False, False, True, True, True, False, False]
    assert ratings(policy, 2) == SERVICE


@pytest.mark.parametrize("asarray", [np.asarray, torch.asarray], ids=["numpy", "torch"])
@pytest.mark.parametrize("targets", [None, (0, 2)])
@pytest.mark.parametrize("lie", ["constant", "relative"])
def test_a_batch_is_its_games_one_by_one(
    asarray: Any, targets: tuple[int, ...] | None, lie: str
) -> None:
    service, round = np.random.default_rng(0).random((3, 2, 5)), np.arange(10.0).reshape(2, 5)
    policy = BadMouthing(start=2, stop=7, level=0.3, targets=targets, lie=lie)

    def play(service: np.ndarray, round: np.ndarray) -> Any:
        s, r = asarray(service), asarray(round)
        given, _ = policy.ratings(RaterView(r, r, s, s, s >= 0, s, s >= 0), None, None)
        assert (type(given), given.dtype) == (type(s), s.dtype)
        return np.asarray(given)

    together = play(service, round)
    for index in np.ndindex(2, 5):
        assert np.array_equal(together[:, *index], play(service[:, *index], round[index]))


def test_a_target_that_is_not_there_is_refused() -> None:
    with refuses(ValueError, "targets", "(3,)", "provider", "2"):
        ratings(BadMouthing(targets=(3,)))


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ({"level": 1.5}, ("level", "1.5", "[0, 1]")),
        ({"level": float("nan")}, ("level", "nan", "[0, 1]")),
        ({"lie": "white"}, ("lie", "white")),
        ({"targets": ()}, ("targets", "1")),
        ({"targets": (-1,)}, ("targets.0", "-1")),
        ({"targets": ("sp_0",)}, ("targets.0", "sp_0")),
        ({"start": -1}, ("start", "-1")),
        ({"start": 2, "stop": 1}, ("stop", "1", "2")),
    ],
)
def test_bad_parameters_are_refused(parameters: dict[str, Any], words: tuple[str, ...]) -> None:
    with refuses(ValueError, "bad-mouthing", *words):
        make_attacker("bad-mouthing", **parameters)
    with refuses(ValueError, next(iter(parameters))):
        BadMouthing(**parameters)
