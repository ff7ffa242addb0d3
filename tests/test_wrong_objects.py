"""Public functions refuse objects of another kind: one line that names the argument and its
value."""

from collections.abc import Callable
from typing import Any

import pytest
from refusals import refuses

from roletrust_env import (
    AttackTask,
    Game,
    JointPolicy,
    load_scenario,
    make_attacker,
    make_scenario,
    make_trust_model,
    record,
    register_attacker,
    register_trust_model,
)

GAME = Game(make_scenario("paper-3x3"))
CALLS: dict[str, tuple[Callable[[Any], object], str]] = {
    "the game of a task": (lambda wrong: AttackTask(wrong, ("sp_2",)), "game"),
    "the game of a joint policy": (lambda wrong: JointPolicy(wrong, {}), "game"),
    "the policies of a joint policy": (lambda wrong: JointPolicy(GAME, wrong), "policies"),
    "the players of a record": (lambda wrong: record(wrong, GAME.random(0)), "joint_policy"),
    "the numbers of a record": (lambda wrong: record(JointPolicy(GAME, {}), wrong), "random"),
    "the name of a trust model": (make_trust_model, "trust model"),
    "the name of an attacker": (make_attacker, "attacker"),
    "the name of a new attacker": (lambda wrong: register_attacker(wrong, dict), "attacker"),
}


@pytest.mark.parametrize("wrong", [3, None, ["x"], 1.5])
@pytest.mark.parametrize("call", CALLS)
def test_an_object_of_another_kind_is_refused(call: str, wrong: object) -> None:
    function, name = CALLS[call]
    with refuses(ValueError, name, repr(wrong)):
        function(wrong)


@pytest.mark.parametrize("wrong", [3, None, ["x"]])
def test_a_path_is_a_text_or_a_path(wrong: Any) -> None:
    with refuses(ValueError, "path", repr(wrong)):
        load_scenario(wrong)


def test_a_factory_can_be_called() -> None:
    with refuses(ValueError, "not-callable", 3):
        register_trust_model("not-callable", 3)  # type: ignore[arg-type]
