"""Records of attackers: what they keep, and what they refuse."""

import json

import numpy as np
import pytest
from refusals import refuses

from roletrust_agents.learned.coalition_attacker import CoalitionAttacker
from roletrust_agents.learned.deep_set import DeepSet, DeepSetArchitecture, random_weights
from roletrust_agents.training.universal import universal_coalitions
from roletrust_env import Policy, make_scenario
from roletrust_env.arrays import Array
from roletrust_env.evaluation.attackers import (
    HONEST_POLICY,
    MAX_RECORD,
    Both,
    OpenLoop,
    Scripted,
    read_record,
    record_of,
)
from roletrust_env.evaluation.measurement import watch
from roletrust_env.evaluation.scripts import Scripts
from roletrust_env.game.make_task import make_task
from roletrust_env.game.policy import make_attacker, registry

TASK = make_task(make_scenario("market").change(max_cycles=20), ["sr_1", "sp_1"])


class Unnamed(Policy):
    """Policy that is not registered."""


def test_every_script_is_the_same_after_its_record() -> None:
    needs = {"accomplices": (0, 1), "length": 50}
    for name in [name for name in registry.names() if name != "learned"]:
        policy = make_attacker(name, **registry.accepted_parameters(name, needs))
        attack = {"sr_0": policy, "sp_0": Both(policy, HONEST_POLICY)}
        again = read_record(record_of(Scripted(attack)))
        assert isinstance(again, Scripted)
        assert again.policies == attack


def test_every_point_of_a_search_space_is_the_same_after_its_record() -> None:
    scripts, random = Scripts.of(TASK), np.random.default_rng(0)
    for _ in range(20):
        attack = scripts.decode(random.random(scripts.size))
        again = read_record(record_of(Scripted(attack)))
        assert isinstance(again, Scripted)
        assert again.policies == attack


@pytest.mark.parametrize("wide", [False, True])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_a_coalition_plays_the_same_game_to_the_last_bit_after_its_record(
    dtype: type, wide: bool
) -> None:
    architecture = DeepSetArchitecture.of(wide=wide)
    weights = random_weights(architecture, np.random.default_rng(1)).astype(dtype)
    attacker = CoalitionAttacker(DeepSet.unflatten(architecture, weights))
    again = read_record(record_of(attacker))
    assert np.array_equal(trust(attacker), trust(again))
    assert not np.array_equal(
        trust(attacker), trust(CoalitionAttacker(universal_coalitions()["universal-raters"]))
    )


def trust(attacker: object) -> Array:
    return watch(TASK, attacker, 0, (1, 2)).trust  # type: ignore[arg-type]


def test_weights_that_are_no_real_numbers_are_refused() -> None:
    network = DeepSet.unflatten(
        DeepSetArchitecture(), np.zeros(DeepSetArchitecture().size, np.complex64)
    )
    assert record_of(CoalitionAttacker(network)) == ""


def test_what_has_no_record_says_so_by_an_empty_text() -> None:
    assert record_of(OpenLoop(np.zeros((3, 2)))) == ""
    assert record_of(Scripted({"sr_0": Unnamed()})) == ""
    many = np.zeros((2, DeepSetArchitecture().size), np.float32)
    assert record_of(CoalitionAttacker(DeepSet.unflatten(DeepSetArchitecture(), many))) == ""


COALITION = json.loads(record_of(CoalitionAttacker(universal_coalitions()["universal-raters"])))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", ("JSON",)),
        ("[]", ("kind",)),
        ('{"kind": 3}', ("kind",)),
        ('{"kind": "nothing"}', ("nothing",)),
        ('{"kind": "scripts"}', ("scripts", "policies")),
        ('{"kind": "scripts", "policies": [], "more": 1}', ("scripts", "more")),
        ('{"kind": "scripts", "policies": []}', ("policies", "[]")),
        ('{"kind": "scripts", "policies": {"sr_0": 3}}', ("3",)),
        ('{"kind": "scripts", "policies": {"sr_0": {"kind": 3}}}', ("name", "kind", "3")),
        (
            '{"kind": "scripts", "policies": {"sr_0": {"name": "bad-mouth"}}}',
            ("bad-mouth", "bad-mouthing"),
        ),
        (
            '{"kind": "scripts", "policies": {"sr_0": {"name": "bad-mouthing", "start": "x"}}}',
            ("bad-mouthing", "start", "x"),
        ),
        ('{"kind": "scripts", "policies": {"sr_0": NaN}}', ("NaN",)),
        ('{"kind": "scripts", "name": "coalition"}', ("scripts", "name")),
        (
            '{"kind": "scripts", "policies": {"sr_0": {"name": "learned", "path": "x"}}}',
            ("learned",),
        ),
        (
            '{"kind": "scripts", "policies": {"a": '
            + '{"rates": {}, "serves": ' * 9
            + "{}"
            + "}" * 11,
            ("policies", "4"),
        ),
        (json.dumps(COALITION | {"weights": 3}), ("base64",)),
        (json.dumps(COALITION | {"weights": "AAAA"}), ("safetensors",)),
        (json.dumps(COALITION | {"weights": COALITION["weights"][:-400]}), ("safetensors",)),
        (json.dumps(COALITION | {"units": 13}), ("layer0.weight", "(12, 15)")),
        (json.dumps(COALITION | {"units": 10**9}), ("256",)),
        ("[" * 100_000, ("JSON",)),
        (" " * (MAX_RECORD + 1), ("200001", "200000")),
    ],
)
def test_a_bad_record_is_one_clear_error(text: str, words: tuple[str, ...]) -> None:
    with refuses(ValueError, *words):
        read_record(text)
