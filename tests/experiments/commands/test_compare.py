"""`roletrust compare`: which trust model suits a log."""

from pathlib import Path
from typing import Any

import pytest
from command_line import run, setting
from csv_files import csv_rows

from roletrust_env.logs import write_log
from roletrust_env.trust.models.central.beta_reputation import Beta

SHARED = Path(__file__).parents[3].parent / "shared" / "data"
OTC = setting(rater=1, ratee=2, rating=3, time=4, header="false")
MEMBERS = ["--scale", "-10", "10", *setting(same_agents="true")]
HEAD = "rater,ratee,rating,time"


def compare(*arguments: str | Path) -> Any:
    return run("compare", *map(str, arguments))


def written(path: Path, lines: list[str]) -> Path:
    path.write_text("".join(f"{line}\n" for line in lines))
    return path


def test_a_log_is_measured(tmp_path: Path) -> None:
    write_log(tmp_path / "log.csv.gz")
    models = ["--model", "role-trust", "--model", "own-experience"]
    result = compare(tmp_path / "log.csv.gz", *MEMBERS, *models, "--out", tmp_path / "out")
    assert result.exit_code == 0, result.output
    table = csv_rows(tmp_path / "out" / "comparison.csv")
    protocols = ["forecast", "attack"]
    assert list(dict.fromkeys(row["protocol"] for row in table)) == protocols
    assert {row["model"] for row in table} == {"role-trust", "own-experience"}
    assert {(row["log"], row["round"]) for row in table} == {("log.csv.gz", "2592000.000000")}
    assert "too narrow" not in result.output  # at 80 columns
    assert "| role-trust |" in (tmp_path / "out" / "comparison.md").read_text()
    first = next(row for row in table if (row["protocol"], row["measure"]) == ("forecast", "r"))
    shown = [line.split() for line in result.output.splitlines()]
    assert [first["model"], f"{float(first['value']):.2f}"] in [line[:2] for line in shown]


def test_a_log_that_is_too_small_for_a_protocol_has_the_others(tmp_path: Path) -> None:
    month = 2_592_000
    rows = [f"{n},{n % 7 + 90},{n % 11 - 5},{n * month // 8}" for n in range(0, 90, 2)]
    path = written(tmp_path / "log.csv", [HEAD, *rows])
    result = compare(path, *MEMBERS, "--model", "mean", "--out", tmp_path / "out")
    assert result.exit_code == 0, result.output
    page = (tmp_path / "out" / "comparison.md").read_text()
    assert "- Left out: attacks: " in page
    assert "nan" not in page
    table = csv_rows(tmp_path / "out" / "comparison.csv")
    assert {row["protocol"] for row in table} == {"forecast"}


def test_what_is_measured_is_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    rows = ["1,2,5,0", "2,3,4,9999999", "1,3,4,9999999", "3,2,-4,19999999"]
    path = written(tmp_path / "log.csv", [HEAD, *rows])
    monkeypatch.setattr(Beta, "update", lambda *given: 1 / 0)
    options = [*MEMBERS, "--model", "mean", "--model", "beta", "--out", tmp_path / "out"]
    assert isinstance(compare(path, *options).exception, ZeroDivisionError)
    assert {row["model"] for row in csv_rows(tmp_path / "out" / "comparison.csv")} == {"mean"}


def test_a_log_that_cannot_be_measured_is_one_line(tmp_path: Path) -> None:
    path = written(tmp_path / "comparison.csv", [HEAD, "1,2,5,0"])
    for out, words in ((tmp_path / "out", "with rounds of"), (tmp_path, "would replace")):
        result = compare(path, *MEMBERS, "--out", out)
        assert result.exit_code == 2
        assert words in result.output.replace("\n", " ")
        assert not (tmp_path / "out" / "comparison.csv").exists()


def test_a_real_log(tmp_path: Path) -> None:
    """The paper's model as a forecast, and an unrated newcomer among the rated."""
    path = SHARED / "bitcoin-otc" / "otc_network.csv.gz"
    if not path.is_file():
        pytest.skip(f"there is no {path}")
    models = ["--model", "role-trust", "--model", "leave-one-out"]
    result = compare(path, *OTC, *MEMBERS, *models, "--out", tmp_path)
    assert result.exit_code == 0, result.output
    found = {
        (row["model"], row["protocol"], row["measure"]): float(row["value"] or "nan")
        for row in csv_rows(tmp_path / "comparison.csv")
    }
    assert found["role-trust", "forecast", "r"] == pytest.approx(0.212, abs=5e-4)
    assert found["leave-one-out", "forecast", "r"] == pytest.approx(0.387, abs=5e-4)
    assert found["role-trust", "attack", "lift, honest"] == pytest.approx(0.958, abs=5e-4)
    assert found["role-trust", "attack", "sink, 3 new"] < 0.01
