"""`roletrust real`: its tables and files, on a synthetic log and on real ones where they are."""

import csv
from pathlib import Path

import pytest
from command_line import run

from roletrust_env.data.folders import KNOWN

SHARED = Path(__file__).parents[3].parent / "shared" / "data"


def rows(path: Path) -> list[dict[str, str]]:
    with path.open() as file:
        return list(csv.DictReader(file))


def test_a_synthetic_log_is_written_and_measured(tmp_path: Path) -> None:
    models = ["--model", "role-trust", "--model", "mean", "--model", "travos"]
    result = run("real", str(tmp_path / "log"), "--synthetic", *models, "--out", str(tmp_path / "out"))
    assert result.exit_code == 0, result.output
    table = rows(tmp_path / "out" / "real.csv")
    assert {row["protocol"] for row in table} == {"next rating", "rater forward", "attack", "crowd work"}
    assert {row["model"] for row in table} == {"role-trust", "mean", "travos"}
    known = [row for row in table if row["low"]]
    assert all(float(row["low"]) <= float(row["value"]) <= float(row["high"]) for row in known)
    assert all((row["round"] == "2592000.000000") == (row["protocol"] != "crowd work") for row in table)
    assert "| role-trust |" in (tmp_path / "out" / "real.md").read_text()
    again = run("real", str(tmp_path / "log"), *models, "--out", str(tmp_path / "again"))
    assert again.exit_code == 0
    assert rows(tmp_path / "again" / "real.csv") == table


def test_searched_attacks_stand_beside_the_others(tmp_path: Path) -> None:
    options = ["--synthetic", "--model", "median", "--search", "6", "--out", str(tmp_path / "out")]
    result = run("real", str(tmp_path / "log"), *options)
    assert result.exit_code == 0
    assert "too narrow" not in result.output  # at 80 columns
    found = {(row["protocol"], row["measure"]): float(row["value"]) for row in rows(tmp_path / "out" / "real.csv")}
    for goal, sign in (("sink", -1), ("lift", 1)):
        for accounts in ("3 hijacked", "3 new", "10 hijacked", "10 new"):
            plain, searched = (found[kind, f"{goal}, {accounts}"] for kind in ("attack", "searched attack"))
            assert sign * (searched - plain) >= -1e-6


def test_methods_of_crowd_work_are_measured_on_crowd_work_alone(tmp_path: Path) -> None:
    pytest.importorskip("crowdkit", reason="needs crowd-kit: pip install 'roletrust-env[crowd]'")
    options = ["--synthetic", "--model", "mace", "--model", "mean", "--out", str(tmp_path / "out")]
    assert run("real", str(tmp_path / "log"), *options).exit_code == 0
    table = rows(tmp_path / "out" / "real.csv")
    assert {row["protocol"] for row in table if row["model"] == "mace"} == {"crowd work"}


def test_models_that_do_not_fit_are_left_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("roletrust_env.trust.grid_ledger.MEMORY", 1000.0)
    options = ["--model", "mean", "--model", "travos", "--out", str(tmp_path / "out")]
    result = run("real", str(tmp_path / "log"), "--synthetic", *options)
    assert result.exit_code == 0, result.output
    assert result.output.count("left out:") == 2
    assert {row["model"] for row in rows(tmp_path / "out" / "real.csv")} == {"mean"}


def written(folder: Path, name: str, lines: list[str]) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    (folder / name).write_text("".join(f"{line}\n" for line in lines))


def test_a_log_that_is_too_small_for_a_protocol_has_the_others(tmp_path: Path) -> None:
    """And other logs of the folder are measured; a line says what is left out."""
    month = 2_592_000
    written(
        tmp_path / "one-each", "ratings.csv", [f"{n},{n + 1},{n % 11 - 5},{n * month // 8}" for n in range(0, 90, 2)]
    )
    written(tmp_path / "one-round", "ratings.csv", ["1,2,5,0", "2,3,4,1"])
    written(tmp_path / "work", "answer.csv", ["question,worker,answer", "q,w,1"])
    written(tmp_path / "work", "truth.csv", ["question,truth", "q,1"])
    result = run("real", str(tmp_path), "--model", "mean", "--model", "beta", "--out", str(tmp_path / "out"))
    assert result.exit_code == 0, result.output
    page = (tmp_path / "out" / "real.md").read_text()
    assert "- Left out: attacks on one-each/ratings.csv: an attack needs 20 providers" in page
    assert page.count("- Left out: forecasts on one-round/ratings.csv: with rounds of 2.592e+06") == 1
    assert {row["protocol"] for row in rows(tmp_path / "out" / "real.csv")} == {
        "next rating",
        "rater forward",
        "crowd work",
    }
    assert "nan" not in page
    assert "| mean | 1.000 |" in page


def test_a_log_that_is_too_small_for_all_is_one_line(tmp_path: Path) -> None:
    written(tmp_path / "log", "ratings.csv", ["1,2,5,0"])
    result = run("real", str(tmp_path / "log"), "--out", str(tmp_path / "out"))
    assert result.exit_code == 2
    assert "nothing could be measured; forecasts on log/ratings.csv" in result.output
    assert not (tmp_path / "out" / "real.csv").exists()


def test_no_folder_of_logs_is_one_line(tmp_path: Path) -> None:
    result = run("real", str(tmp_path), "--out", str(tmp_path / "out"))
    assert result.exit_code == 2
    assert "has no log" in result.output
    assert not (tmp_path / "out").exists()


def test_real_logs(tmp_path: Path) -> None:
    """The paper's model as a forecast, an unrated newcomer among the rated, and votes of a crowd."""
    if not SHARED.is_dir():
        pytest.skip(f"there are no real logs in {SHARED}")
    result = run("real", str(SHARED), "--model", "role-trust", "--model", "mean", "--out", str(tmp_path))
    assert result.exit_code == 0, result.output
    table = rows(tmp_path / "real.csv")
    assert {row["log"] for row in table} == set(KNOWN.values())
    found = {(row["model"], row["protocol"], row["measure"]): float(row["value"] or "nan") for row in table}
    assert found["role-trust", "next rating", "auc"] == pytest.approx(0.642, abs=5e-4)
    assert found["mean", "next rating", "auc"] == pytest.approx(0.685, abs=5e-4)
    assert found["role-trust", "attack", "lift, honest"] == pytest.approx(0.958, abs=5e-4)
    assert found["role-trust", "attack", "sink, 3 new"] < 0.01
    assert found["role-trust", "crowd work", "majority"] == pytest.approx(0.897, abs=5e-4)
