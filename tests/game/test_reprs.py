"""Everything that a person prints says what it is in one line, and shows no array."""

import numpy as np
import pytest

import roletrust_env
from roletrust_env import (
    Game,
    JointPolicy,
    Player,
    Policy,
    Random,
    make_attacker,
    make_scenario,
    make_task,
    record,
)


@pytest.fixture(scope="module")
def game() -> Game:
    return Game(make_scenario("paper-3x3"), like=np.zeros((), np.float32))


FACTS = (
    "'paper-3x3', RoleTrust(lam=0.5, initial=0.5), agents: 3 SR + 3 SP, rounds: 240, numpy float32"
)


def test_a_game(game: Game) -> None:
    assert repr(game) == f"Game({FACTS})"
    assert "agents: 9 SR+SP, rounds: 200)" in repr(Game(make_scenario("peers")))


def test_a_task() -> None:
    task = make_task("paper-3x3", ("sp_2", "sr_1"), objective="exploit")
    assert (
        repr(task)
        == f"AttackTask({FACTS}; compromised: sp_2 sr_1, objective: exploit, knowledge: black_box)"
    )


def test_policies(game: Game) -> None:
    attack = make_attacker("bad-mouthing", level=0.2)
    assert repr(Policy()) == "Policy()"
    assert repr(JointPolicy(game, {})) == f"JointPolicy({FACTS}; all play honestly)"
    assert repr(JointPolicy(game, {"sr_2": attack})) == f"JointPolicy({FACTS}; sr_2: {attack!r})"
    assert repr(Player(attack, "sr_2", game.layout)) == f"Player('sr_2', {attack!r})"


def test_many_agents_with_one_policy_are_counted() -> None:
    game, attack = Game(make_scenario("crowd-10x10")), make_attacker("bad-mouthing")
    players = JointPolicy(game, {f"sr_{k}": attack for k in range(6)})
    assert f"; sr_0 ... sr_5 (6): {attack!r})" in repr(players)


def test_what_a_game_leaves_behind(game: Game) -> None:
    history = record(JointPolicy(game, {}), game.random(0), (4,))
    assert repr(history) == "History(rounds: 240, raters: 3, providers: 3, agents: 6, batch: (4,))"
    state = game.start(game.draw(game.random(0), start=True))
    assert repr(state) == "State(round: 0, raters: 3, providers: 3, trust: RoleTrustState)"
    assert repr(game.start(game.draw(game.random(0), (4,), start=True))).startswith(
        "State(batch: (4,), "
    )
    actions, _ = JointPolicy(game, {}).act(
        state, JointPolicy(game, {}).begin(Random(np.random.default_rng(0))), None
    )
    assert repr(actions) == "Actions(quality: (3,), ratings: (3, 3))"
    assert repr(game.draw(game.random(0))) == "Noise(perception: (3, 3))"
    provider, _ = game.views(state)
    assert repr(provider).startswith("ProviderView(round: (3,), trust: (3,), ")


def test_nothing_that_is_printed_has_a_second_line(game: Game) -> None:
    environment = roletrust_env.parallel_env()
    for thing in (
        game,
        environment,
        roletrust_env.env(),
        JointPolicy(game, {}),
        make_task("peers", ("srsp_5",)),
    ):
        assert "\n" not in repr(thing)
        assert "array" not in repr(thing)
