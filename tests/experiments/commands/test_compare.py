"""`roletrust compare`: which trust model suits a log, on logs of either kind."""

import gzip
from pathlib import Path
from typing import Any

import pytest
from command_line import run
from csv_files import csv_rows

from roletrust_env.logs.folders import KNOWN, write_log
from roletrust_env.trust.models.central.beta_reputation import Beta

SHARED = Path(__file__).parents[3].parent / "shared" / "data"
OTC = ["--columns", "rater=1,ratee=2,rating=3,time=4", "--read", "header=false"]
MEMBERS = ["--scale", "-10", "10", "--same-agents"]


def compare(*arguments: str) -> Any:
    return run("compare", *arguments)


def test_a_synthetic_log_is_written_and_measured(tmp_path: Path) -> None:
    models = ["--model", "role-trust", "--model", "own-experience"]
    result = compare(str(tmp_path / "log"), "--synthetic", *models, "--out", str(tmp_path / "out"))
    assert result.exit_code == 0, result.output
    table = csv_rows(tmp_path / "out" / "comparison.csv")
    protocols = ["rated before", "next rating", "rater forward", "attack"]
    assert list(dict.fromkeys(row["protocol"] for row in table)) == protocols
    assert " is recommended. " in result.output.replace("\n", " ")
    assert {row["model"] for row in table} == {"role-trust", "own-experience"}
    known = [row for row in table if row["low"]]
    assert all(float(row["low"]) <= float(row["value"]) <= float(row["high"]) for row in known)
    assert {row["round"] for row in table} == {"2592000.000000"}
    assert "too narrow" not in result.output  # at 80 columns
    assert "| role-trust |" in (tmp_path / "out" / "comparison.md").read_text()
    first = next(row for row in table if (row["protocol"], row["measure"]) == ("rated before", "r"))
    shown = [line.split() for line in result.output.splitlines()]
    assert [first["model"], f"{float(first['value']):.2f}"] in [line[:2] for line in shown]
    again = compare(str(tmp_path / "log"), *MEMBERS, *models, "--out", str(tmp_path / "again"))
    assert again.exit_code == 0
    assert csv_rows(tmp_path / "again" / "comparison.csv") == table


def test_models_that_do_not_fit_are_left_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("roletrust_env.trust.grid_run.MEMORY", 1000.0)
    options = ["--model", "mean", "--model", "travos", "--out", str(tmp_path / "out")]
    result = compare(str(tmp_path / "log"), "--synthetic", *options)
    assert result.exit_code == 0, result.output
    assert result.output.count("left out:") == 1
    assert {row["model"] for row in csv_rows(tmp_path / "out" / "comparison.csv")} == {"mean"}


def written(folder: Path, name: str, lines: list[str]) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    (folder / name).write_text("".join(f"{line}\n" for line in lines))


HEAD = "rater,ratee,rating,time"


def test_a_log_that_is_too_small_for_a_protocol_has_the_others(tmp_path: Path) -> None:
    """And other logs of the folder are measured; a line says what is left out."""
    month = 2_592_000
    written(
        tmp_path / "one-each",
        "ratings.csv",
        [HEAD, *(f"{n},{n + 1},{n % 11 - 5},{n * month // 8}" for n in range(0, 90, 2))],
    )
    written(tmp_path / "one-round", "ratings.csv", [HEAD, "1,2,5,0", "2,3,4,1"])
    result = compare(
        str(tmp_path),
        *MEMBERS,
        "--model",
        "mean",
        "--model",
        "beta",
        "--out",
        str(tmp_path / "out"),
    )
    assert result.exit_code == 0, result.output
    page = (tmp_path / "out" / "comparison.md").read_text()
    assert "- Left out: attacks on one-each/ratings.csv: an attack needs 20 providers" in page
    assert (
        page.count("- Left out: forecasts on one-round/ratings.csv: with rounds of 2.592e+06") == 1
    )
    assert {row["protocol"] for row in csv_rows(tmp_path / "out" / "comparison.csv")} == {
        "next rating",
        "rater forward",
    }
    assert "nan" not in page


def test_a_file_with_columns_of_its_own_is_compared(tmp_path: Path) -> None:
    write_log(tmp_path / "plain.csv.gz")
    lines = gzip.decompress((tmp_path / "plain.csv.gz").read_bytes()).decode().splitlines()
    turned = [";".join(line.split(",")[place] for place in (3, 2, 1, 0)) for line in lines[1:]]
    written(tmp_path, "own.csv", ["when;points;seller;buyer", *turned])
    options = ["--model", "mean", *MEMBERS, "--out", str(tmp_path / "out")]
    named = ["--columns", "rater=buyer,ratee=seller,rating=points,time=when"]
    result = compare(str(tmp_path / "own.csv"), *named, *options)
    assert result.exit_code == 0, result.output
    assert (
        compare(str(tmp_path / "plain.csv.gz"), *options[:-1], str(tmp_path / "again")).exit_code
        == 0
    )
    own, plain = (csv_rows(tmp_path / name / "comparison.csv") for name in ("out", "again"))
    assert [row["value"] for row in own] == [row["value"] for row in plain]


def test_what_is_measured_is_kept_and_all_logs_are_read_before_any_is_measured(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    written(
        tmp_path / "a",
        "ratings.csv",
        [HEAD, "1,2,5,0", "2,3,4,9999999", "1,3,4,9999999", "3,2,-4,19999999"],
    )
    written(tmp_path / "b", "ratings.csv", [HEAD, "1,2,5,0", "2,3,four,9999999"])
    options = [*MEMBERS, "--model", "mean", "--model", "beta", "--out", str(tmp_path / "out")]
    result = compare(str(tmp_path), *options)
    assert result.exit_code == 2
    assert "b/ratings.csv, row 3" in result.output.replace("\n", "")
    assert not (tmp_path / "out").exists()
    (tmp_path / "b" / "ratings.csv").unlink()
    monkeypatch.setattr(Beta, "update", lambda *given: 1 / 0)
    assert isinstance(compare(str(tmp_path), *options).exception, ZeroDivisionError)
    assert {row["model"] for row in csv_rows(tmp_path / "out" / "comparison.csv")} == {"mean"}


def test_a_log_that_is_too_small_for_all_is_one_line(tmp_path: Path) -> None:
    written(tmp_path / "log", "ratings.csv", [HEAD, "1,2,5,0"])
    result = compare(str(tmp_path / "log"), *MEMBERS, "--out", str(tmp_path / "out"))
    assert result.exit_code == 2
    assert "nothing could be measured; forecasts on log/ratings.csv" in result.output
    assert not (tmp_path / "out" / "comparison.csv").exists()


def test_no_folder_of_logs_is_one_line(tmp_path: Path) -> None:
    result = compare(str(tmp_path), "--out", str(tmp_path / "out"))
    assert result.exit_code == 2
    assert "has no log" in result.output
    assert not (tmp_path / "out").exists()


def test_real_logs(tmp_path: Path) -> None:
    """The paper's model as a forecast, and an unrated newcomer among the rated."""
    if not SHARED.is_dir():
        pytest.skip(f"there are no real logs in {SHARED}")
    models = ["--model", "role-trust", "--model", "mean"]
    result = compare(str(SHARED), *OTC, *MEMBERS, *models, "--out", str(tmp_path))
    assert result.exit_code == 0, result.output
    table = csv_rows(tmp_path / "comparison.csv")
    assert {row["log"] for row in table} == set(KNOWN.values())
    found = {
        (row["model"], row["protocol"], row["measure"]): float(row["value"] or "nan")
        for row in table
    }
    assert found["role-trust", "next rating", "auc"] == pytest.approx(0.642, abs=5e-4)
    assert found["mean", "next rating", "auc"] == pytest.approx(0.685, abs=5e-4)
    assert found["role-trust", "attack", "lift, honest"] == pytest.approx(0.958, abs=5e-4)
    assert found["role-trust", "attack", "sink, 3 new"] < 0.01
