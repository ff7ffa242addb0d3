"""Which agents to trust, as a function: frames in and out, later ratings, states."""

from pathlib import Path
from typing import Any

import duckdb
import numpy as np
import pandas as pd
import polars as pl
import pytest
from refusals import refuses

from roletrust_env.logs import rate, read

COLUMNS = {"rater": "who", "ratee": "shop", "rating": "stars", "time": "day"}
SETTINGS: dict[str, Any] = {**COLUMNS, "scale": (1, 5), "every": 30.0}


def frame(size: int = 300) -> pd.DataFrame:
    rng = np.random.default_rng(0)
    shop = rng.integers(0, 10, size)
    return pd.DataFrame(
        {
            "who": [f"p{n}" for n in rng.integers(0, 40, size)],
            "shop": [f"s{n}" for n in shop],
            "stars": 3 + shop % 3,
            "day": np.arange(size),
        }
    )


def test_frames_of_all_kinds_have_the_same_trust() -> None:
    pandas = frame()
    wanted = rate(pandas, **SETTINGS)
    for other in (
        pl.from_pandas(pandas),
        duckdb.from_df(pandas),
        read(pandas, scale=(1, 5), **COLUMNS),
    ):
        found = rate(other, **SETTINGS)
        for one, two in ((found.ratees, wanted.ratees), (found.raters, wanted.raters)):
            pd.testing.assert_frame_equal(one, two)
    ratees = wanted.ratees
    assert ratees.trust.is_monotonic_decreasing
    assert ratees.ratings.sum() == wanted.n_ratings == 300
    assert set(ratees.model) == {"leave-one-out"}


def test_later_ratings_and_a_saved_state_have_the_trust_of_the_whole(tmp_path: Path) -> None:
    whole, data = rate(frame(), **SETTINGS), frame()
    rated = rate(data[:100], **SETTINGS)
    rated.save(tmp_path / "state.npz")
    rated.update(data[100:200])
    rated.update(data[200:])
    continued = rate(data[50:], state=tmp_path / "state.npz", **SETTINGS)
    night = rate(data[:100], state=tmp_path / "other.npz", **SETTINGS)
    night = rate(data[100:], state=tmp_path / "other.npz", **SETTINGS)
    assert continued.stream.n_late == 40
    for one in (rated, continued, night):
        assert one.rounds == whole.rounds == 10
        for table, wanted in ((one.ratees, whole.ratees), (one.raters, whole.raters)):
            columns = ["name", "trust", "ratings", "independent", "last"]
            pd.testing.assert_frame_equal(table[columns], wanted[columns])
        with refuses(ValueError, "whole log"):
            one.explain("s1")


def test_what_is_calibrated_is_saved(tmp_path: Path) -> None:
    rng, size = np.random.default_rng(0), 4_000
    data = {
        "rater": rng.integers(0, 200, size),
        "ratee": rng.integers(1_000, 1_200, size),
        "rating": rng.random(size),
        "time": np.arange(size),
    }
    first = rate(data, every=100.0, model="mean")
    assert first.calibration is not None
    first.save(tmp_path / "state.npz")
    one = {"rater": [1], "ratee": [1_000], "rating": [1.0], "time": [9_000]}
    later = rate(one, every=100.0, model="mean", state=tmp_path / "state.npz")
    assert later.calibration == first.calibration
    assert later.ratees.high.notna().all()


def test_an_agent_is_explained_in_both_roles() -> None:
    rated = rate(frame(), **SETTINGS)
    found = rated.explain("s7")
    assert (found.name, found.role) == ("s7", "ratee")
    assert found.trust == rated.ratees.set_index("name").trust["s7"]
    assert all(reason.other.startswith("p") for reason in found.reasons)
    assert rated.explain("p3", "rater").reasons[0].other.startswith("s")
    with refuses(ValueError, "p3"):
        rated.explain("p3")


def test_arguments_that_do_not_fit_are_refused(tmp_path: Path) -> None:
    data = frame()
    path = tmp_path / "state.npz"
    for wrong, words in (
        ({"every": None, "state": path}, ("state", "every")),
        ({"state": path, "trusted": ["p1"]}, ("state", "trusted")),
        ({"trusted": ["p1"]}, ("leave-one-out",)),
        ({"model": "leave-one-uot"}, ("leave-one-uot", "leave-one-out")),
        ({"every": 0}, ("every", "0")),
    ):
        with refuses(ValueError, *words):
            rate(data, **(SETTINGS | wrong))
    assert not path.exists()
    rate(data[:100], state=path, **SETTINGS)
    before = path.read_bytes()
    with refuses(ValueError, "Mean", "LeaveOneOut"):
        rate(data[100:], state=path, model="mean", **SETTINGS)
    assert path.read_bytes() == before


@pytest.mark.parametrize("name", ["merit-rank", "eigentrust"])
def test_models_of_all_kinds_are_calibrated(name: str) -> None:
    found = rate(frame(3_000), model=name, **SETTINGS)
    assert found.calibration is None or found.calibration.coverage > 0.9


def test_later_ratings_without_rounds_keep_their_times() -> None:
    dates = pd.to_datetime(["2020-01-01", "2020-01-02"])
    one = pd.DataFrame(
        {"rater": ["a", "b"], "ratee": ["x", "x"], "rating": [1, 0.5], "time": dates}
    )
    rated = rate(one, model="mean")
    rated.update(one.assign(ratee=["x", "y"], time=dates + pd.Timedelta(days=1600)))
    assert rated.ratees.set_index("name")["last"].astype(str).to_dict() == {
        "x": "2024-05-19",
        "y": "2024-05-20",
    }
    assert set(rated.ratees.until) == {"2024-05-20 00:00:00"}


def test_a_log_says_nothing_of_how_raw_ratings_are_read(tmp_path: Path) -> None:
    columns = {"rater": ["a", "b"], "ratee": ["x", "x"], "rating": [-1, 1], "time": [0, 99]}
    log = read(columns, scale=(-1, 1))
    rated = rate(log, model="mean", every=10.0)
    with refuses(ValueError, "Log"):
        rated.update(columns)
    rated.update(log)
    with refuses(ValueError, "same_agents", "True"):
        rate(log, same_agents=True)
    rate(log, model="mean", every=10.0, state=tmp_path / "state.npz")
    with refuses(ValueError, "scale"):
        rate(columns, scale=(-1, 1), model="mean", every=10.0, state=tmp_path / "state.npz")


def test_what_cannot_go_on_is_not_saved(tmp_path: Path) -> None:
    data = frame()
    for wrong in ({"every": None}, {"model": "travos"}, {"model": "merit-rank", "trusted": ["p1"]}):
        with refuses(ValueError, "every"):
            rate(data, **(SETTINGS | wrong)).save(tmp_path / "state.npz")
    with refuses(ValueError, "travos"):
        rate(data, **SETTINGS, model="travos", state=tmp_path / "state.npz")
    assert not list(tmp_path.iterdir())


def test_names_and_scales_may_be_numbers_of_numpy() -> None:
    data = {"rater": [1, 2], "ratee": [3, 3], "rating": np.array([1, 5])}
    rated = rate(data, scale=(data["rating"].min(), data["rating"].max()), model="leave-one-out")
    assert rated.explain(3).name == "3"  # type: ignore[arg-type]
    with refuses(ValueError, "provider"):
        rated.table("provider")  # type: ignore[arg-type]
    with refuses(ValueError, "ann"):
        rate(data, scale=(1, 5), trusted="ann", model="merit-rank")


def test_a_table_may_end_in_capitals(tmp_path: Path) -> None:
    (path,) = rate(frame(), **SETTINGS).write(tmp_path / "trust.PARQUET")
    assert pd.read_parquet(path).role.value_counts().to_dict() == {"rater": 40, "ratee": 10}
