"""Searched attacks on a log: what a tactic sends, and that a search finds no less than the plain attack."""

from pathlib import Path

import numpy as np
import pytest

from roletrust_baselines.logs.folders import write_log
from roletrust_baselines.logs.replay import (
    ROUNDS,
    TARGETS,
    Attack,
    Replay,
    Tactic,
    equal_ratings,
    hostile_ratings,
    replay_attacks,
    search_attack,
)
from roletrust_env.data.columns import Columns
from roletrust_env.data.log import RatingLog, read_ratings
from roletrust_env.trust import make_trust_model

MONTH = 2_592_000


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> RatingLog:
    path: Path = tmp_path_factory.mktemp("log") / "ratings.csv.gz"
    write_log(path)
    return read_ratings(path, Columns("1", "2", "3", "4"), scale=(-10, 10), same_agents=True)


def replay_of(log: RatingLog, model: str, *, same_agents: bool = True) -> Replay:
    return Replay(make_trust_model(model), log, MONTH, same_agents=same_agents, most=10)


def test_a_tactic_sends_what_it_says(log: RatingLog) -> None:
    replay = replay_of(log, "mean")
    accounts = replay.fresh[:3]
    tactic = Tactic(accounts, first=2, period=2, rating=0.1, targets=7, cover=4, ring=True)
    sent = hostile_ratings(replay, replay.best, tactic, np.random.default_rng(0))
    lies, ring = np.isin(sent.providers, replay.best), np.isin(sent.providers, accounts)
    cover = ~lies & ~ring
    assert (lies.sum(), cover.sum(), ring.sum()) == (3 * 7, 3 * 4, 9)
    assert set(sent.values[lies]) == {0.1}
    assert set(sent.values[ring]) == {1.0}
    past = slice(replay.past)
    for provider, value in zip(sent.providers[cover], sent.values[cover], strict=True):
        assert value == pytest.approx(log.values[past][log.ratees[past] == provider].mean())
    for account in accounts:
        own = sent.providers[sent.raters == account]
        assert len(own) == len(set(own))
    apart = hostile_ratings(replay_of(log, "mean", same_agents=False), replay.best, tactic, np.random.default_rng(0))
    assert len(apart.raters) == 3 * 7 + 3 * 4


@pytest.mark.parametrize(("model", "goal", "origin"), [("eigentrust", "lift", "new"), ("median", "sink", "hijacked")])
def test_a_search_finds_no_less_than_the_plain_attack(log: RatingLog, model: str, goal: str, origin: str) -> None:
    attack = Attack(goal, 3, origin)  # type: ignore[arg-type]
    found = search_attack(replay_of(log, model), attack, 30)
    plain = replay_attacks(replay_of(log, model), [attack])[attack]
    sign = 1 if goal == "lift" else -1
    assert sign * (found.shift.after.value - plain.after.value) >= 0
    assert found.shift.before == plain.before
    assert len(set(found.tactic.accounts)) == 3
    assert repr(search_attack(replay_of(log, model), attack, 30)) == repr(found)


def test_a_search_finds_cover_against_a_filter_of_outliers(log: RatingLog) -> None:
    attack, replay = Attack("sink", 3, "new"), replay_of(log, "iterative-filtering")
    plain, found = search_attack(replay, attack, 1), search_attack(replay, attack, 60)
    assert plain.tactic[1:] == (0, 1, 0.0, TARGETS, 0, False)
    assert found.shift.after.value < plain.shift.after.value - 0.03
    assert found.tactic.cover > 0


def test_a_quiet_round_is_the_log_itself(log: RatingLog) -> None:
    replay, nobody = replay_of(log, "mean"), np.zeros(0, np.int64)
    quiet = [equal_ratings(nobody, nobody, 0.0)] * ROUNDS
    honest = replay.percentiles(replay.best, quiet)
    late = [*quiet[:-1], equal_ratings(replay.fresh[:3], replay.best, 0.0)]
    assert replay.percentiles(replay.best, late).mean() < honest.mean()
    assert np.array_equal(replay.percentiles(replay.best, quiet), honest)
    with pytest.raises(ValueError, match="the budget is 0; it must be at least 1"):
        search_attack(replay, Attack("sink", 3, "new"), 0)
