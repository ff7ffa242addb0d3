"""Audits of a log: ranks as `rate` has them, what a plan sends, and the cheapest attacks that a
search finds."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from refusals import refuses

from roletrust_env.logs.audit import audit_model
from roletrust_env.logs.audit_ranking import LAST, Journal, Plan, Prices, Ranking, Row
from roletrust_env.logs.evidence import Rank, evidence
from roletrust_env.logs.folders import write_log
from roletrust_env.logs.log import Log, TooSmallError, read
from roletrust_env.logs.stream import TrustStream
from roletrust_env.trust import make_trust_model

MONTH = 2_592_000.0


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Log:
    path: Path = tmp_path_factory.mktemp("log") / "ratings.csv.gz"
    write_log(path, members=40, months=9)
    return read(path, scale=(-10, 10), same_agents=True)


def ranking_of(log: Log, model: str = "mean", rank_by: Rank = "low", top: int = 10) -> Ranking:
    return Ranking(make_trust_model(model), log, MONTH, same_agents=True, rank_by=rank_by, top=top)


def streamed(log: Log, model: str) -> npt.NDArray[np.float64]:
    """The trust in the ratees, from a stream of the log."""
    agents = np.arange(log.shape[0]), np.arange(log.shape[1])
    stream = TrustStream(make_trust_model(model), agents=agents, every=MONTH, same_agents=True)
    assert log.times is not None
    stream.update(log.raters, log.ratees, log.values, log.times.view("datetime64[ns]"))
    stream.finish()
    return np.array(list(stream.provider_trust().values()))


def rated(log: Log, model: str, rank_by: Rank = "low") -> list[str]:
    """The names of the ratees by rank, as `rate` has them."""
    return evidence(log, "ratee", streamed(log, model), log.pairs()).ranked(rank_by).names


@pytest.mark.parametrize("rank_by", ["low", "trust"])
def test_ranks_are_those_of_rate(log: Log, rank_by: Rank) -> None:
    order = ranking_of(log, "leave-one-out", rank_by).order
    assert [log.ratee_names[place] for place in order] == rated(log, "leave-one-out", rank_by)


def test_the_rank_after_an_attack_is_that_of_the_longer_log(log: Log) -> None:
    ranking = ranking_of(log)
    target = ranking.targets(1, 0)[3]
    plan = Plan("hijacked", accounts=4, strikes=2, choice=2, mildness=0.1)
    sent = ranking.sent(ranking.rows(target, plan))
    month = int(MONTH) * 10**9
    rounds = (log.times - log.times[0]) // month
    last = np.unique(rounds)[::-1]
    place = {name: at for at, name in enumerate(log.rater_names)}
    rows = [
        (
            place[one.account],
            place[one.agent],
            one.value,
            log.times[0] + last[one.round - 1] * month + 1,
        )
        for one in sent
    ]
    raters, ratees, values, times = (
        np.append(a, b) for a, b in zip(log[:4], zip(*rows, strict=True), strict=True)
    )
    order = np.argsort(times, kind="stable")
    longer = log._replace(
        raters=raters[order].astype(int),
        ratees=ratees[order].astype(int),
        values=values[order],
        times=times[order].astype(int),
    )
    attempt = ranking.play(target, plan, Prices(hijacked=7, rating=0.5))
    assert (
        attempt.rank == rated(longer, "mean").index(log.ratee_names[target.place]) + 1 > target.rank
    )
    assert (attempt.ratings, attempt.accounts, attempt.rounds, attempt.days) == (8, 4, 2, 60)
    assert attempt.price == 4 * 7 + 8 * 0.5


def test_a_plan_sends_what_it_says(log: Log) -> None:
    ranking = ranking_of(log)
    lifted = ranking.targets(1, 0)[-2]
    plan = Plan(
        "aged",
        accounts=3,
        strikes=2,
        turns=True,
        quiet=1,
        age=2,
        mildness=0.2,
        cover=5,
        rivals=2,
        ring=1,
    )
    rows = ranking.rows(lifted, plan)
    struck = [row for row in rows if row.agent == lifted.place]
    assert [(row.round, row.value) for row in struck] == [(LAST - 3, 0.8)] * 2 + [(LAST - 2, 0.8)]
    pushed = [row for row in rows if row.value == 0.0]
    assert {row.agent for row in pushed} == set(ranking.order[8:10].tolist())
    assert len(pushed) == 3 * 2
    ring = [row for row in rows if row.agent >= log.shape[1]]
    assert [(row.round, row.value) for row in ring] == [(LAST - 5, 1.0)] * 3
    decoys = [row for row in rows if row.round < LAST - 3 and row not in ring]
    assert [row.round for row in decoys] == [LAST - 5] * 9 + [LAST - 4] * 6
    trust = streamed(log, "mean")
    assert all(row.value == pytest.approx(trust[row.agent], abs=1e-12) for row in decoys)
    drawn = ranking.rows(lifted, replace(plan, popular=False))
    assert {row.agent for row in drawn} != {row.agent for row in rows}
    assert len(drawn) == len(rows)


def test_the_search_finds_the_attack_that_suffices_and_leaves_out_what_it_does_not_need(
    log: Log,
) -> None:
    found = audit_model(
        ranking_of(log, rank_by="trust", top=2), Prices(day=0.001), targets=2, budget=60
    )
    assert [one.goal for one in found.exposures].count("sink") == 2
    ranking = ranking_of(log, rank_by="trust", top=2)
    targets = {target[::2]: target for target in ranking.targets(2, 0)}
    place = {name: at for at, name in enumerate(log.rater_names)}
    for one in found.exposures:
        best, target = one.cheapest, targets[one.goal, one.rank]
        assert best is not None
        assert len(one.sent) == best.ratings
        assert len({rating.account for rating in one.sent}) == best.accounts
        hijacked = len({rating.account for rating in one.sent} & place.keys())
        bought = best.accounts - hijacked + 10 * hijacked + 0.1 * best.ratings
        assert min(one.prices) == one.price == pytest.approx(bought + 0.001 * best.days)
        assert best.margin >= 0
        assert (best.rank > 2) == (one.goal == "sink")
        rows = [
            Row(
                LAST - sent.round,
                place.get(sent.account, len(place) + int(sent.account.split()[-1])),
                place.get(sent.agent, len(place)),
                sent.value,
            )
            for sent in one.sent
        ]
        assert ranking.play(target, best.plan, Prices(), rows).rank == best.rank
        for at in range(len(rows)):  # each rating is needed
            fewer = rows[:at] + rows[at + 1 :]
            assert not fewer or not ranking.over_edge(
                target, ranking.play(target, best.plan, Prices(), fewer).rank
            )
    for target in ranking.targets(2, 0):  # no single rating of a new account is cheaper
        played = ranking.play(target, Plan(), Prices(day=0.001))
        price = next(
            one.price
            for one in found.exposures
            if (one.goal, one.rank) == (target.goal, target.rank)
        )
        assert not ranking.over_edge(target, played.rank) or price <= played.price
    for goal in found.medians:
        curve = [one for one in found.curve if one.goal == goal]
        assert all(np.diff([one.places.value for one in curve]) >= 0)
        assert curve[-1].pushed.value == 1
    again = audit_model(
        ranking_of(log, rank_by="trust", top=2), Prices(day=0.001), targets=2, budget=60
    )
    assert repr(again) == repr(found)


def test_targets_may_be_named(log: Log) -> None:
    ranking = ranking_of(log)
    best, worst = (log.ratee_names[ranking.order[at]] for at in (0, -1))
    found = ranking.targets(3, 0, [worst, best, best])
    assert [(one.goal, one.rank) for one in found] == [("sink", 1), ("lift", len(ranking.order))]
    with refuses(ValueError, "nobody"):
        ranking.targets(3, 0, ["nobody"])


def test_a_damaged_journal_keeps_its_whole_lines(tmp_path: Path) -> None:
    (tmp_path / "journal").write_bytes(
        b'\xff\0["a", 1, 2]\n["b", 3, 0.5]\n["c", "x", null]\n[["d"], 1, 2]\n["e", 1'
    )
    assert Journal(tmp_path / "journal").known == {"b": (3, 0.5)}
    for wrong in (
        "-3, 0.5",
        "0, 0.5",
        "true, 0.5",
        '"3", 0.5',
        "Infinity, 0.5",
        "2.5, 0.5",
        "3, NaN",
        '3, "0.5"',
        "3",
        "[], {}",
    ):
        (tmp_path / "journal").write_text(f'["a", {wrong}]\n["b", 3, 0.5]\n[["c"], 3, 0.5]\n')
        assert Journal(tmp_path / "journal").known == {"b": (3, 0.5)}, wrong


def test_more_agents_than_the_top_are_needed(log: Log) -> None:
    with refuses(TooSmallError, "33", "--top", "40"):
        Ranking(make_trust_model("mean"), log, MONTH, same_agents=True, top=40)
