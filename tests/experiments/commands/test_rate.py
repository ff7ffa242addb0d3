"""`roletrust rate`: its tables, its files, and what it refuses."""

import csv
from pathlib import Path

import numpy as np
import pytest
from command_line import run
from log_cases import BAD, GOOD

from roletrust_env.data import TrustStream
from roletrust_env.trust import make_trust_model

REAL = Path(__file__).parents[3].parent / "shared" / "data" / "bitcoin-otc" / "otc_network.csv.gz"


def rows(path: Path) -> list[dict[str, str]]:
    with path.open() as file:
        return list(csv.DictReader(file))


@pytest.fixture
def log(tmp_path: Path) -> Path:
    """Ratings from 1 to 5 of ten shops by forty people, one of whom always says 1."""
    rng, path = np.random.default_rng(0), tmp_path / "log.csv"
    lines = ["who,shop,stars,day"]
    for day in range(300):
        person, shop = rng.integers(0, 40), rng.integers(0, 10)
        lines.append(f"p{person},s{shop},{1 if person == 3 else 3 + shop % 3},{day}")
    path.write_text("\n".join(lines) + "\n")
    return path


COLUMNS = ["--rater", "who", "--ratee", "shop", "--rating", "stars", "--time", "day", "--scale", "1", "5"]


@pytest.mark.parametrize("model", ["role-trust", "median", "travos", "eigentrust", "role-trust:lam=0.9"])
def test_it_writes_and_prints_the_trust_of_both_roles(log: Path, tmp_path: Path, model: str) -> None:
    result = run("rate", str(log), *COLUMNS, "--model", model, "--every", "30", "--out", str(tmp_path / "out"))
    assert result.exit_code == 0, result.output
    assert "300 ratings in 10 rounds" in result.output
    ratees, raters = rows(tmp_path / "out" / "ratees.csv"), rows(tmp_path / "out" / "raters.csv")
    assert (len(ratees), len(raters)) == (10, 40)
    assert all(sum(int(row["ratings"]) for row in found) == 300 for found in (ratees, raters))
    trusts = [float(row["trust"]) for row in ratees]
    assert trusts == sorted(trusts, reverse=True)
    if model.startswith(("role-trust", "median")):
        assert raters[-1]["name"] == "p3"


def test_it_computes_what_a_stream_does(log: Path, tmp_path: Path) -> None:
    assert run("rate", str(log), *COLUMNS, "--every", "30", "--out", str(tmp_path / "out")).exit_code == 0
    stream = TrustStream(make_trust_model("role-trust"), scale=(1, 5), every=30)
    table = rows(log)
    stream.update(
        [row["who"] for row in table],
        [row["shop"] for row in table],
        [float(row["stars"]) for row in table],
        [float(row["day"]) for row in table],
    )
    stream.finish()
    for found, wanted in (("ratees", stream.provider_trust()), ("raters", stream.rater_trust())):
        trusts = {row["name"]: float(row["trust"]) for row in rows(tmp_path / "out" / f"{found}.csv")}
        assert trusts == pytest.approx(wanted, abs=1e-6)


def test_a_bad_file_is_one_line_and_nothing_is_written(log: Path, tmp_path: Path) -> None:
    log.write_text(log.read_text() + "p1,s1,7,301\n")
    result = run("rate", str(log), *COLUMNS, "--out", str(tmp_path / "out"))
    assert result.exit_code == 2
    assert "row 302: the rating is 7, off the scale from 1 to 5" in result.output
    assert not (tmp_path / "out").exists()
    missing = run("rate", str(tmp_path / "none.csv"), "--out", str(tmp_path / "out"))
    assert missing.exit_code == 2
    assert "none.csv" in missing.output


@pytest.mark.parametrize("case", BAD)
def test_every_bad_file_leaves_older_results_as_they_are(tmp_path: Path, case: str) -> None:
    content, out = BAD[case][0], tmp_path / "out"
    path = tmp_path / "log.csv"
    path.write_text(GOOD)
    options = "--time", "time", "--scale", "1", "5", "--out", str(out)
    assert run("rate", str(path), *options).exit_code == 0
    before = {file.name: file.read_bytes() for file in out.iterdir()}
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    result = run("rate", str(path), *options)
    assert result.exit_code == 2
    assert "Traceback" not in result.output
    assert {file.name: file.read_bytes() for file in out.iterdir()} == before


def test_a_model_that_does_not_fit_says_what_it_would_take(tmp_path: Path) -> None:
    path = tmp_path / "wide.csv"
    path.write_text("rater,ratee,rating\n" + "".join(f"r{n},p{n},1\n" for n in range(20_000)))
    result = run("rate", str(path), "--model", "travos", "--out", str(tmp_path / "out"))
    assert result.exit_code == 2
    assert "with 20,000 raters and 20,000 ratees its state would take" in " ".join(result.output.split())
    assert run("rate", str(path), "--out", str(tmp_path / "out")).exit_code == 0


def test_real_ratings(tmp_path: Path) -> None:
    if not REAL.exists():
        pytest.skip(f"the log of Bitcoin OTC is not in {REAL.parent}")
    columns = ["--rater", "1", "--ratee", "2", "--rating", "3", "--time", "4", "--scale", "-10", "10", "--same-agents"]
    result = run("rate", str(REAL), *columns, "--every", "2592000", "--out", str(tmp_path))
    assert result.exit_code == 0, result.output
    assert "35,592 ratings in 64 rounds" in result.output
    assert (len(rows(tmp_path / "raters.csv")), len(rows(tmp_path / "ratees.csv"))) == (4814, 5858)


@pytest.mark.parametrize(
    ("rounds", "words"),
    [
        (["--every", "30"], "the log has no times; name the column of the time"),
        (["--every", "0", "--time", "day"], "it must be above 0"),
        (["--count", "9", "--every", "30", "--time", "day"], "not by both"),
    ],
)
def test_rounds_that_do_not_fit_are_refused_before_the_file_is_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, rounds: list[str], words: str
) -> None:
    def read(*_: object, **__: object) -> None:
        raise AssertionError("the file is read")

    monkeypatch.setattr("roletrust_experiments.commands.rate.read_ratings", read)
    result = run("rate", str(tmp_path / "log.csv"), *rounds, "--out", str(tmp_path / "out"))
    assert result.exit_code == 2
    assert words in " ".join(result.stderr.split())
    assert not (tmp_path / "out").exists()
