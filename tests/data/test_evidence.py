"""The evidence beside trust."""

import csv
from pathlib import Path

import numpy as np
import pyarrow as arrow
import pytest

from roletrust_env.data.evidence import as_dates, evidence, wilson_interval
from roletrust_env.data.log import read_ratings
from roletrust_env.storage.tables import write_table


def test_it_counts_ratings_and_agents_as_a_slow_copy_does(tmp_path: Path) -> None:
    random, path = np.random.default_rng(0), tmp_path / "log.csv"
    rows = [(f"r{n}", f"p{m}", k) for n, m, k in zip(*random.integers(0, 9, (2, 200)), range(200), strict=True)]
    path.write_text("rater,ratee,rating,time\n" + "".join(f"{n},{m},1,{k}\n" for n, m, k in rows))
    log = read_ratings(path)._replace(times=np.arange(200.0))
    for role, own, other in (("ratee", 1, 0), ("rater", 0, 1)):
        found = evidence(log, role, dict.fromkeys(range(9), 0.5))
        for place, name in enumerate(found.names):
            some = [row for row in rows if row[own] == name]
            counts = [sum(row[other] == agent for row in some) for agent in {row[other] for row in some}]
            assert (found.ratings[place], found.agents[place]) == (len(some), len(counts))
            assert found.independent[place] == pytest.approx(sum(counts) ** 2 / sum(count**2 for count in counts))
            assert found.last[place] == some[-1][2]


def test_earlier_agents_have_trust_and_no_interval(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("rater,ratee,rating\na,x,1\nb,x,1\nb,y,1\n")
    found = evidence(read_ratings(path), "ratee", {"w": 0.9, "x": 0.2}, by_name=True).ranked("trust")
    assert found.names == ["w", "x"]  # y was not taken
    assert found.ratings.tolist() == [0, 2]
    assert np.isnan(found.low).all()


def test_an_interval_contains_the_mean_of_many_more_raters() -> None:
    """In 95% of samples of agreeing and of disagreeing raters, at least."""
    random = np.random.default_rng(0)
    for one, other in ((0.1, 0.4), (9.0, 3.0)):
        for size in (2, 10, 50):
            sample = random.beta(one, other, (2000, size)).mean(1)
            low, high = wilson_interval(sample, np.full(2000, float(size)))
            mean = one / (one + other)
            assert ((low <= mean) & (mean <= high)).mean() > 0.93


def test_tables_are_written_as_they_are(tmp_path: Path) -> None:
    table = arrow.table({"name": ['a"b', "c,d"], "x": [0.5, None], "far": [1e15, 2.0], "n": [1, 2]})
    write_table(tmp_path / "t.csv", table)
    with (tmp_path / "t.csv").open() as file:
        assert list(csv.reader(file)) == [
            ["name", "x", "far", "n"],
            ['a"b', "0.500000", "1e+15", "1"],
            ["c,d", "", "2", "2"],
        ]
    assert str(as_dates(np.array([np.nan, 1.5e9]))[1]) == "2017-07-14T02:40:00"
