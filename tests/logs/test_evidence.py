"""The evidence beside trust."""

import csv
from pathlib import Path
from typing import get_args

import numpy as np
import pyarrow as arrow
import pytest
from refusals import refuses

from roletrust_env.logs import TrustStream
from roletrust_env.logs.evidence import Role, as_dates, effective_number
from roletrust_env.logs.log import read
from roletrust_env.storage.tables import write_table
from roletrust_env.trust import make_trust_model


def test_it_counts_ratings_and_agents_as_a_slow_copy_does(tmp_path: Path) -> None:
    random, path = np.random.default_rng(0), tmp_path / "log.csv"
    rows = [
        (f"r{n}", f"p{m}", k)
        for n, m, k in zip(*random.integers(0, 9, (2, 200)), range(200), strict=True)
    ]
    path.write_text("rater,ratee,rating,time\n" + "".join(f"{n},{m},1,{k}\n" for n, m, k in rows))
    log = read(path)
    stream = TrustStream.of_log(make_trust_model("mean"), log, keep_evidence=True)
    for role, own, other in (("ratee", 1, 0), ("rater", 0, 1)):
        found = stream.evidence(role)
        for place, name in enumerate(found.names):
            some = [row for row in rows if row[own] == name]
            counts = [
                sum(row[other] == agent for row in some) for agent in {row[other] for row in some}
            ]
            assert (found.ratings[place], found.agents[place]) == (len(some), len(counts))
            assert found.independent[place] == pytest.approx(
                sum(counts) ** 2 / sum(count**2 for count in counts)
            )
            assert found.last[place].astype(int) == some[-1][2] * 10**9


def test_without_ratings_nobody_stands_behind_trust() -> None:
    none = np.zeros(0, np.int64)
    assert effective_number(none, none, 2).tolist() == [0, 0]
    assert effective_number(np.ones(3, int), np.ones(3, int), 2).tolist() == [0, 3]


def test_a_stream_keeps_evidence_if_it_is_told_to(tmp_path: Path) -> None:
    """It is saved, and a stream that keeps none says so."""
    random, model = np.random.default_rng(0), make_trust_model("mean")
    columns = (*random.integers(0, 9, (2, 200)), random.random(200), np.arange(200.0))
    stream = TrustStream(model, every=50.0, keep_evidence=True)
    stream.update(*columns)
    stream.save(tmp_path / "state.npz")
    loaded = TrustStream.load(tmp_path / "state.npz", model, every=50.0, keep_evidence=True)
    for one in (stream, loaded):
        one.finish()
    for role in get_args(Role):
        one, two = ([np.asarray(c).tolist() for c in s.evidence(role)] for s in (stream, loaded))
        assert one == two
        assert sum(one[2]) == 200
    with refuses(ValueError, "keep_evidence", "True", "False"):
        TrustStream.load(tmp_path / "state.npz", model, every=50.0)
    with refuses(ValueError, "keep_evidence", "True"):
        TrustStream(model).evidence("rater")


def test_tables_are_written_as_they_are(tmp_path: Path) -> None:
    table = arrow.table({"name": ['a"b', "c,d"], "x": [0.5, None], "far": [1e15, 2.0], "n": [1, 2]})
    write_table(tmp_path / "t.csv", table)
    with (tmp_path / "t.csv").open() as file:
        assert list(csv.reader(file)) == [
            ["name", "x", "far", "n"],
            ['a"b', "0.500000", "1e+15", "1"],
            ["c,d", "", "2", "2"],
        ]
    times = np.array([-(2**63), 1_500_000_000 * 10**9]).view("datetime64[ns]")
    assert str(as_dates(times)[1]) == "2017-07-14T02:40:00"
