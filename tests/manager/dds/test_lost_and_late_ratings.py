"""Lost, late and wrongly stamped ratings by a simulated clock: they cost their own rater, and
nobody else."""

from itertools import product

import numpy as np
import pytest
from manager_cases import PERIOD, TEAM, manager, random_ratings, rating_message

from roletrust_manager.admission.validation import Envelope, RefusalReason


def run(keeper, arrivals, until):
    """Return the rounds that a manager publishes for (arrival, message) pairs, with ten ticks a
    period."""
    published, queue = [], sorted(arrivals, key=lambda entry: entry[0])
    for now in range(0, until, PERIOD // 10):
        while queue and queue[0][0] <= now:
            arrival, message = queue.pop(0)
            published += keeper.receive(message, arrival)
        published += keeper.tick(now)
    return published


def message(rater, round, row, off=0):
    sent = rating_message(rater, round, dict(zip(TEAM.providers, row.tolist(), strict=True)))
    return sent._replace(envelope=Envelope(rater, sent.envelope.stamp + off))


def test_rounds_name_the_raters_of_lost_and_late_ratings(tmp_path):
    random, rounds = np.random.default_rng(0), 100
    values, _ = random_ratings(rounds, lost=0.0)
    lost, late = random.random((rounds, 3)) < 0.1, random.random((rounds, 3)) < 0.2
    arrivals = [
        (
            PERIOD * (r + 1) + int((1.2 if late[r, i] else 0.1) * PERIOD),
            message(name, r + 1, values[r, i]),
        )
        for r in range(rounds)
        for i, name in enumerate(TEAM.raters)
        if not lost[r, i]
    ]
    published = run(manager(tmp_path / "journal"), arrivals, PERIOD * (rounds + 5))
    there = ~lost & ~late
    heard = {round(entry.stamp / PERIOD) - 1: entry for entry in published}
    assert sorted(heard) == [r for r in range(rounds) if there[r].any()]
    for r, entry in heard.items():
        assert [name in entry.ratings for name in TEAM.raters] == there[r].tolist()


@pytest.mark.parametrize("off_s", [-1.0, 1.0])
def test_a_wrong_clock_takes_no_round_from_the_others(off_s, tmp_path):
    values, _ = random_ratings(40, lost=0.0)
    off = int(off_s * 1e9)
    arrivals = [
        (PERIOD * r + i, message(name, r, values[r - 1, i], off if name == "sr_2" else 0))
        for r in range(1, 41)
        for i, name in enumerate(TEAM.raters)
    ]
    published = run(manager(tmp_path / "journal"), arrivals, PERIOD * 50)
    whole = [entry for entry in published if {"sr_0", "sr_1"} <= entry.ratings.keys()]
    assert [round(entry.stamp / PERIOD) for entry in whole] == list(range(1, 41))


def honest(values):
    """Return the messages of two raters that rate every round, with their times of arrival."""
    return [
        (PERIOD * r + i, message(name, r, row[i]))
        for r, row in enumerate(values, 1)
        for i, name in enumerate(TEAM.raters[:2])
    ]


def test_a_rater_that_is_ahead_and_then_silent_takes_no_round_from_the_others(tmp_path):
    values, _ = random_ratings(20, lost=0.0)
    for k, (ahead, every) in enumerate(product([0.9, 1.6, 2.5, 3.9], [1, 2, 4, 8])):
        off = int(ahead * PERIOD)
        early = [
            (PERIOD * r + 2, message("sr_2", r, values[r - 1, 2], off))
            for r in range(every, 21, every)
        ]
        published = run(manager(tmp_path / f"journal {k}"), honest(values) + early, PERIOD * 25)
        assert sum({"sr_0", "sr_1"} <= entry.ratings.keys() for entry in published) == 20, (
            ahead,
            every,
        )


def test_stamps_of_every_half_period_take_no_round_from_the_others(tmp_path):
    """Half a period is the smallest gap between two stamps that the manager accepts."""
    values, _ = random_ratings(40, lost=0.0)
    stamps = [PERIOD * k // 2 for k in range(6, 80)]
    for ahead in (0.0, 0.4, 0.6, 1.0, 1.3, 3.0):
        often = [
            (stamp - int(ahead * PERIOD), message("sr_2", 0, values[0, 2], stamp))
            for stamp in stamps
        ]
        published = run(manager(tmp_path / f"journal {ahead}"), honest(values) + often, PERIOD * 50)
        whole = [entry for entry in published if {"sr_0", "sr_1"} <= entry.ratings.keys()]
        assert [round(entry.stamp / PERIOD) for entry in whole] == list(range(1, 41)), ahead


def test_a_rater_that_floods_has_its_share_and_no_more(tmp_path):
    values, _ = random_ratings(20, lost=0.0)
    step = PERIOD // 500  # a thousand messages per second
    flood = [(at, message("sr_2", 0, values[0, 2], at)) for at in range(PERIOD, 20 * PERIOD, step)]
    keeper = manager(tmp_path / "journal")
    published = run(keeper, honest(values) + flood, PERIOD * 25)
    whole = [entry for entry in published if {"sr_0", "sr_1"} <= entry.ratings.keys()]
    assert len(whole) == 20
    assert (
        sum("sr_2" in entry.ratings for entry in published) <= 41
    )  # two stamps a period, at half a period
    assert keeper.admission.refusals["sr_2", RefusalReason.TOO_SOON] > 9000
