"""Ways to fool the score of the closed loop, and the checks against them."""

from functools import cache
from typing import Any

import numpy as np
import pytest

from roletrust_env.benchmarking.leaderboard import Leaderboard
from roletrust_env.benchmarking.play import CellPlay
from roletrust_env.benchmarking.schema import AttackResult, CellResult, Numbers
from roletrust_env.benchmarking.suite import Cell, Method, Suite
from roletrust_env.benchmarking.suite_files import load_suite
from roletrust_env.evaluation import received
from roletrust_env.evaluation.agreed import AgreedScripts
from roletrust_env.game import consumer
from roletrust_env.game.game import Game

SOLO = {"common": "own-experience", "own": "own-experience"}
HONEST = AgreedScripts()
MILKING = AgreedScripts(("milking-ring",))


@cache
def quick() -> Suite:
    suite = load_suite("quick")
    assert isinstance(suite, Suite)
    return suite


def suite_with(access: dict[str, Any] | None = None, **changes: Any) -> Suite:
    """Return the suite `quick` with two measured worlds and changed fields of the worlds."""
    suite = quick()
    fields = {**suite.worlds.set, "max_cycles": 20, **changes}
    fields["access"] = {**fields["access"], **(access or {})}
    worlds = {**suite.worlds.model_dump(), "measured": 2, "set": fields}
    return Suite.model_validate({**suite.model_dump(), "worlds": worlds})


def scores_of(
    suite: Suite, model: str, setting: str, *attacks: AgreedScripts
) -> dict[str, np.ndarray]:
    """Return the scores of attacks in eight games of each measured world, shape (W, K) each."""
    method: Method | Any = "scripts" if suite.settings[setting].roles else "honest"
    cell = Cell(model, "common", setting, method)
    return CellPlay(suite, cell).measure("measured", attacks, games=8).scores


@pytest.mark.parametrize("model", ["mean", "block"])
def test_an_offer_to_consumers_that_do_not_come_changes_no_score(
    model: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each provider offers 1 to every consumer that does not choose it."""
    before = scores_of(suite_with(), model, "coalition", MILKING)
    offered = Game.offered

    def generous(game: Game, earlier: Any, actions: Any, state: Any) -> Any:
        real = offered(game, earlier, actions, state)
        each = np.broadcast_to(real if real.ndim == 4 else real[None], state.awaiting.shape)
        return np.where(state.awaiting | np.isnan(each), each, 1.0)

    monkeypatch.setattr(Game, "offered", generous)
    after = scores_of(suite_with(), model, "coalition", MILKING)
    for name, values in before.items():
        np.testing.assert_allclose(after[name], values, rtol=0, atol=1e-12, err_msg=name)


def test_no_model_and_no_attack_moves_the_yardsticks(monkeypatch: pytest.MonkeyPatch) -> None:
    yardsticks: list[list[Any]] = []
    receive = consumer.receive

    def recorded(*arguments: Any) -> Any:
        part = receive(*arguments)
        for k in range(part.best.shape[0]):
            yardsticks[k - 2].append((part.best[k], part.blind[k]))
        return part

    monkeypatch.setattr(received, "receive", recorded)
    for model in ("mean", "block"):
        yardsticks += [[], []]
        scores_of(suite_with(), model, "coalition", HONEST, MILKING)
    first, *others = map(np.array, yardsticks)
    assert first.min() > 0
    for other in others:
        np.testing.assert_allclose(other, first, rtol=0, atol=1e-12)


@pytest.mark.parametrize("model", ["mean", "first-hand", "block", "constant"])
def test_consumers_that_always_explore_have_the_skill_0(model: str) -> None:
    suite = suite_with({"explore": 1.0})
    skill, own = (
        scores_of(suite, name, "clean", HONEST)["skill"] for name in (model, "own-experience")
    )
    assert skill == pytest.approx(0, abs=0.1)
    assert np.array_equal(skill, own)


@pytest.mark.parametrize(
    "model", ["first-hand", "block", "block-forgiving", "agreed-once", "vial", "peer-trust"]
)
def test_one_consumer_alone_chooses_as_the_solo_model(model: str) -> None:
    """A model that falls back on own experience has no advantage without other raters, and it
    remembers services whose reports are lost."""
    agents = [
        {"role": "SR", "count": 1, "noise": 0.1},
        {"role": "SP", "count": 8, "ability": [0.0, 1.0]},
    ]
    skill, own = (
        scores_of(suite_with(agents=agents, ratings={"lost": lost}), name, "clean", HONEST)["skill"]
        for name, lost in ((model, 0.5), ("own-experience", 0.0))
    )
    assert np.array_equal(skill, own)
    assert own.min() > 0.2


def result_of(attack: str, skill: float, *, is_worst: bool, **fields: Any) -> AttackResult:
    """Return the result of an attack with the same skill in all worlds."""
    chosen: Numbers = [skill] * quick().worlds.selection
    measured: Numbers = [skill] * quick().worlds.measured
    scores = dict.fromkeys(received.SCORES, measured) if is_worst else {}
    return AttackResult(attack, "", 0, {"skill": chosen}, scores, **fields)


def board_of(method: Method, results: dict[str, list[AttackResult]], **changes: Any) -> Leaderboard:
    """Return the leaderboard of the results of some trust models in the setting `raters`."""
    fields = {**quick().model_dump(), "models": tuple(results), "own": (), "solo": SOLO, **changes}
    fields["settings"] = {"raters": fields["settings"]["raters"]}
    fields |= {
        "replayed": (),
        "methods": [name for name in fields["methods"] if name != "replayed"],
    }
    suite = Suite.model_validate(fields)
    stored = [
        (Cell(model, "common", "raters", method), CellResult(tuple(rows), 0.0))
        for model, rows in results.items()
    ]
    return Leaderboard.of(suite, stored)


def test_an_attack_that_ruins_the_solo_model_more_gives_no_gain() -> None:
    """The gain is the difference between two worst cases. Under the attack `milking` alone it would
    be 0.3."""
    skills = {
        "block": {"milking": 0.4, "lies": 0.0},
        "own-experience": {"milking": 0.1, "lies": 0.6},
    }
    results = {
        model: [
            result_of(attack, skill, is_worst=skill == min(attacks.values()))
            for attack, skill in attacks.items()
        ]
        for model, attacks in skills.items()
    }
    gains = {row.model: row.estimates["gain"].mean for row in board_of("scripts", results).rows}
    assert gains == pytest.approx({"block": -0.1, "own-experience": 0.0})


def test_the_board_tells_which_searches_did_not_converge() -> None:
    """A search has converged if the last doubling of its rounds lowered the skill by less than
    0.01, and if its starts agree within 0.01."""
    results = {
        model: [
            result_of("search 1", last, is_worst=True, progress=((100, 0.5), (200, last))),
            result_of("search 2", last + 0.05, is_worst=False, progress=((100, 0.5), (200, 0.5))),
        ]
        for model, last in (("block", 0.495), ("mean", 0.2), ("first-hand", 0.498))
    }
    sentence = board_of("search", results, methods=("search",)).convergence
    assert "2 of 3 searches" in sentence
    assert "0 of 3." in sentence
