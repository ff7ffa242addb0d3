"""Columns of a stream from many sources: dates are seconds, and what is no number, or not there, is
refused."""

from datetime import date, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pytest
import torch
from refusals import refuses

from roletrust_env import make_trust_model
from roletrust_env.logs.stream import TrustStream

DAYS = np.arange("2020-01-01", "2020-01-21", dtype="datetime64[D]")
WEEK = 7 * 24 * 3600.0


def stream(**settings: Any) -> TrustStream:
    return TrustStream(make_trust_model("role-trust"), **settings)


def after(times: Any) -> TrustStream:
    one = stream(every=WEEK)
    one.update(["r"] * 20, ["s", "t"] * 10, np.linspace(0, 1, 20), times)
    one.finish()
    return one


@pytest.mark.parametrize(
    "dates",
    [
        DAYS,
        *(DAYS.astype(f"datetime64[{unit}]") for unit in ("h", "s", "ms", "us", "ns")),
        pd.Series(pd.to_datetime(DAYS)),
        pa.array(DAYS.astype("datetime64[ms]")),
        pd.Series(pd.to_datetime(DAYS)).dt.tz_localize("UTC").dt.tz_convert("Asia/Kolkata"),
        pd.to_datetime(DAYS).tz_localize("UTC"),
        pa.array(DAYS.astype("datetime64[s]"), pa.timestamp("s", "America/Lima")),
        DAYS.tolist(),
        [datetime.fromisoformat(f"{day}T02:00:00+02:00") for day in DAYS.astype(str)],
        DAYS.astype(str).tolist(),
        pd.Series(DAYS.astype(str)),
        pa.array([f"{day}T05:30:00+05:30" for day in DAYS.astype(str)]),
    ],
    ids=[
        *(
            "D",
            "h",
            "s",
            "ms",
            "us",
            "ns",
            "pandas",
            "arrow",
            "pandas-zone",
            "pandas-index",
            "arrow-zone",
        ),
        *("date", "datetime-zone", "iso", "iso-pandas", "iso-zone-arrow"),
    ],
)
def test_dates_are_seconds_in_every_unit(dates: Any) -> None:
    expected = after(DAYS.astype("datetime64[s]").astype(np.int64))
    found = after(dates)
    assert found.rounds == expected.rounds == 3
    assert found.provider_trust() == expected.provider_trust()


def test_times_are_told_apart_to_the_last_digit(tmp_path: Path) -> None:
    ticks = 1_706_702_400_000_000_000 + np.array([5, 4, 5, 99, 5])
    dates = ticks.astype("datetime64[ns]")
    for times in (
        dates,
        pd.Series(dates).dt.tz_localize("UTC"),
        pa.array(ticks, pa.timestamp("ns")),
        np.datetime_as_string(dates).tolist(),
        list(map(pd.Timestamp, dates)),
    ):
        one = stream(every=5e9, repeats=False)
        one.update(["ann ", "ann", " ann"], ["shop"] * 3, [1, 1, 1], times[:3])
        one.save(tmp_path / "state")
        one = TrustStream.load(tmp_path / "state", one.model, every=5e9, repeats=False)
        one.update(["ann"] * 2, ["shop\t"] * 2, [1, 1], times[3:])
        one.finish()
        assert (one.n_repeated, list(one.rater_trust())) == (2, ["ann"])
    one = stream(every=1)
    with refuses(ValueError, "times", "datetime64[as]"):
        one.update(["ann"], ["shop"], [1], np.array([2 * 10**18], "datetime64[as]"))


def test_names_keep_a_nul_at_their_end() -> None:
    one = stream()
    one.update(["a\0", "a"], ["s", "s"], [1, 0])
    assert list(one.rater_trust()) == ["a\0", "a"]


@pytest.mark.parametrize("value", [float("nan"), float("inf"), "\ud800"])
def test_further_settings_are_such_as_a_file_keeps(value: Any) -> None:
    with refuses(ValueError, "JSON"):
        TrustStream(make_trust_model("mean"), source={"unit": [value]})


MASKED = np.ma.masked_array([0.5, 1.0], mask=[False, True])
DATES = np.ma.masked_array(
    np.array(["2020-01-01", "2020-01-02"], "datetime64[s]"), mask=[False, True]
)
NAMES = np.ma.masked_array([1, 2], mask=[False, True])


@pytest.mark.parametrize(
    ("column", "values", "words"),
    [
        ("times", np.array(["2020-01-01", "NaT"], "datetime64[s]"), ("times", "NaT", "2")),
        ("times", np.array([1, 2], "timedelta64[s]"), ("times",)),
        ("times", [1, 2**2000], ("times",)),
        ("times", MASKED, ("column", "times")),
        ("times", DATES, ("column", "times")),
        (
            "times",
            torch.ones(2, requires_grad=True),
            ("column", "times"),
        ),
        ("times", ["2020-01-01", "soon"], ("times", "2", "soon")),
        ("times", ["2020-01-01", "2020-01-01T00:00Z"], ("2020-01-01T00:00Z",)),
        (
            "times",
            pd.Series(pd.to_datetime(["2020-01-01", None], utc=True)),
            ("2", "None"),
        ),
        ("times", [date(2020, 1, 1), 7], ("times",)),
        ("ratings", MASKED, ("column", "ratings")),
        ("ratings", np.array([0.5, 0.5j]), ("ratings",)),
        ("ratings", np.array([0, 1], "datetime64[s]"), ("ratings",)),
        ("times", [True, False], ("times",)),
        ("raters", ["ann", " \t"], ("raters", "2", "1")),
        (
            "providers",
            ["é" * 5_001, "s"],
            ("providers", "1", "10,000"),
        ),
        ("raters", ["ann", "\ud800"], ("raters", "2")),
        ("raters", NAMES, ("column", "raters")),
        ("raters", "ab", ("raters", "ab", "column")),
        ("providers", NAMES, ("column", "providers")),
    ],
)
def test_what_is_no_number_or_not_there_is_refused(
    column: str, values: Any, words: tuple[str, ...]
) -> None:
    batch = {
        "raters": [1, 2],
        "providers": [1, 2],
        "ratings": [0.5, 1.0],
        "times": [0, 1],
        column: values,
    }
    one = stream(every=1)
    with refuses(ValueError, column, *words):
        one.update(**batch)
    assert one.rater_trust() == {}
    one.finish()
    assert one.rounds == 0


@pytest.mark.parametrize("every", ["7", True, [1], np.timedelta64(7, "D"), 0, np.nan])
def test_a_round_has_a_length(every: Any) -> None:
    with refuses(ValueError, "every"):
        stream(every=every)


@pytest.mark.parametrize("scale", [None, 5, (1,), (1, 2, 3), ("a", "b"), (1, 1), (0, np.inf)])
def test_a_scale_is_a_pair_of_numbers(scale: Any) -> None:
    with refuses(ValueError, "scale"):
        stream(scale=scale)


@pytest.mark.parametrize("length", [{"every": np.int64(7)}, {"every": np.float32(7)}], ids=str)
def test_settings_of_numpy_can_be_saved(length: dict[str, Any], tmp_path: Path) -> None:
    one = stream(**length, same_agents=np.True_)
    one.update(["r"], ["s"], [1.0], [0])
    one.save(str(tmp_path / "stream.npz"))
    plain = dict.fromkeys(length, 7)
    again = TrustStream.load(str(tmp_path / "stream.npz"), one.model, **plain, same_agents=True)
    again.finish()
    assert again.rounds == 1


def test_a_model_on_a_grid_needs_agents_of_both_roles() -> None:
    model = make_trust_model("travos")
    for agents in (None, ([], []), (["ann"], []), ([], ["shop"])):
        with refuses(ValueError, "0.2", "0.95"):
            TrustStream(model, agents=agents)
    members = TrustStream(model, same_agents=True, agents=(["ann"], []))
    members.update(["ann"], ["bob"], [0.9])
    assert list(members.provider_trust()) == ["ann", "bob"]
