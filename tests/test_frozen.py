"""Objects that a game depends on do not change: every public attribute refuses assignment."""

import copy
import pickle
from collections.abc import Iterator
from typing import Any

import gymnasium
import numpy as np
import pytest
from refusals import refuses

import roletrust_env as rt
from roletrust_env.game.attack_task import Stealth

PARAMETERS: dict[str, dict[str, Any]] = {"exit": {"length": 30}}
"""Arguments of attackers that need some; others that do are given an accomplice."""


def attacker(name: str) -> Any:
    try:
        return rt.make_attacker(name, **PARAMETERS.get(name, {}))
    except ValueError:
        return rt.make_attacker(name, accomplices=(0,))


def objects() -> Iterator[Any]:
    """An object of each kind that a game depends on, and all that the registries have."""
    for preset in rt.scenarios():
        yield rt.make_scenario(preset)
        if preset != "city":
            game = rt.Game(rt.make_scenario(preset))
            yield from (game, game.model, game.presence, game.layout)
    yield from map(rt.make_trust_model, rt.trust_models())
    yield from (attacker(name) for name in rt.attackers() if name != "learned")
    yield rt.make_attacker("learned", path="provider-3x3")
    for observation in ("agents", "accounts"):
        task = rt.make_task("crowd-10x10", ("sr_9", "sp_9"), observation=observation)
        yield from (task, task.joint_policy, task.stealth)


def attributes(thing: Any) -> dict[str, Any]:
    """The public attributes of an object and of its class, without methods and properties."""
    found = dict(getattr(thing, "__dict__", {}))
    for cls in type(thing).__mro__:
        found = {**vars(cls), **found} if cls.__module__.startswith("roletrust") else found
    return {
        name: getattr(thing, name)
        for name, value in found.items()
        if not name.startswith(("_", "model_"))
        and not callable(value)
        and not isinstance(value, property)
    }


def arrays_of(value: Any) -> Iterator[np.ndarray]:
    if isinstance(value, np.ndarray):
        yield value
    elif isinstance(value, tuple | list):
        for part in value:
            yield from arrays_of(part)


@pytest.mark.parametrize("thing", objects(), ids=lambda thing: type(thing).__name__)
def test_a_public_attribute_refuses_assignment_and_its_arrays_are_read_only(thing):
    for twin in (thing, copy.copy(thing), copy.deepcopy(thing)):
        for name, value in attributes(twin).items():
            with pytest.raises((AttributeError, TypeError, ValueError)):
                setattr(twin, name, value)
            assert not any(array.flags.writeable for array in arrays_of(value)), name


def test_the_price_of_a_task_cannot_change_in_an_episode():
    env = gymnasium.make("RoleTrust/ProviderAttack-v0")
    env.reset(seed=0)
    for _ in range(20):
        env.step(env.action_space.sample())
    with refuses(AttributeError, "stealth"):
        env.unwrapped.task.stealth = Stealth(5.0, 0.0)


def test_a_changed_copy_is_another_object():
    task = rt.make_task("paper-3x3", ("sp_2",), objective="exploit")
    other = task.changed(stealth=Stealth(5.0, 0.0))
    assert (task.stealth.weight, other.stealth.weight) == (0.0, 5.0)
    for twin in (copy.deepcopy(other), pickle.loads(pickle.dumps(other))):
        assert twin.stealth.weight == 5.0
        with refuses(AttributeError, "stealth"):
            twin.stealth = task.stealth


def test_the_pairs_of_a_game_are_read_only():
    game = rt.Game(rt.make_scenario("peers"))
    state = game.start(game.draw(game.random(0), start=True))
    for array in (game.roster.not_self, game.roster.own_provider, game.like):
        with refuses(ValueError, "read-only"):
            array[...] = 0
    assert not state.awaiting.any()
