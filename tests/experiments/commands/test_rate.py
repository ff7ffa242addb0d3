"""`roletrust rate`: its tables, its files, and what it refuses."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as arrow
import pyarrow.parquet
import pytest
from command_line import printed, run, setting
from csv_files import csv_rows
from refusals import assert_names, refuses

from roletrust_env.logs import TrustStream, rate
from roletrust_env.logs.rate import Rated
from roletrust_env.trust import make_trust_model

SHARED = Path(__file__).parents[3].parent / "shared" / "data"
REAL = SHARED / "bitcoin-otc" / "otc_network.csv.gz"


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


NAMED = {"rater": "who", "ratee": "shop", "rating": "stars", "time": "day"}
COLUMNS = [*setting(**NAMED), "--scale", "1", "5"]
OTC = setting(rater=1, ratee=2, rating=3, time=4, header="false")
MEMBERS = setting(same_agents="true")
GOOD = "rater,ratee,rating,time\na,x,1,10\nb,x,5,20\na,y,3,30\n"


@pytest.mark.parametrize(
    "model", ["role-trust", "median", "travos", "eigentrust", "role-trust:lam=0.9", "rev2"]
)
def test_it_writes_and_prints_the_trust_of_both_roles(
    log: Path, tmp_path: Path, model: str
) -> None:
    result = printed(
        "rate", log, *COLUMNS, "--model", model, "--every", "30", "--out", tmp_path / "out"
    )
    assert "300 ratings in 10 rounds" in result
    ratees, raters = (
        csv_rows(tmp_path / "out" / "ratees.csv"),
        csv_rows(tmp_path / "out" / "raters.csv"),
    )
    assert (len(ratees), len(raters)) == (10, 40)
    assert all(sum(int(row["ratings"]) for row in found) == 300 for found in (ratees, raters))
    estimates = [float(row["estimate"]) for row in ratees]
    assert estimates == sorted(estimates, reverse=True) == [float(row["trust"]) for row in ratees]
    assert {row["low"] for row in ratees} == {""}  # ten shops are too few to calibrate
    assert {(row["since"], row["until"], row["model"]) for row in raters} == {
        ("0.0", "299.0", model)
    }
    if model.startswith(("role-trust", "median")):
        assert min(raters, key=lambda row: float(row["trust"]))["name"] == "p3"


def test_it_computes_what_a_stream_does(log: Path, tmp_path: Path) -> None:
    assert (
        run("rate", str(log), *COLUMNS, "--every", "30", "--out", str(tmp_path / "out")).exit_code
        == 0
    )
    stream = TrustStream(make_trust_model("leave-one-out"), scale=(1, 5), every=30)
    table = csv_rows(log)
    stream.update(
        [row["who"] for row in table],
        [row["shop"] for row in table],
        [float(row["stars"]) for row in table],
        [float(row["day"]) for row in table],
    )
    stream.finish()
    for found, wanted in (("ratees", stream.provider_trust()), ("raters", stream.rater_trust())):
        trusts = {
            row["name"]: float(row["trust"]) for row in csv_rows(tmp_path / "out" / f"{found}.csv")
        }
        assert trusts == pytest.approx(wanted, abs=1e-6)


def test_one_table_of_both_roles_by_trust_and_why_this_model(log: Path, tmp_path: Path) -> None:
    import pyarrow.parquet

    result = printed("rate", log, *COLUMNS, "--out", tmp_path / "out.parquet")
    assert "Model leave-one-out, which had" in result
    table = pyarrow.parquet.read_table(tmp_path / "out.parquet").to_pylist()
    assert [row["role"] for row in table] == ["ratee"] * 10 + ["rater"] * 40
    trusts = [row["trust"] for row in table[:10]]
    assert trusts == sorted(trusts, reverse=True)
    assert [path.name for path in tmp_path.iterdir()] == ["log.csv", "out.parquet"]


def test_an_agent_is_explained_and_a_ring_is_suspected(log: Path, tmp_path: Path) -> None:
    pairs = np.random.default_rng(0).integers(0, 300, (3000, 2)).tolist()
    lines = [f"{one},s{other},{1 + (7 * one + other) % 5},300" for one, other in pairs]
    ring = [f"ring{n},s{shop},5,301" for n in range(5) for shop in range(20, 25)]
    log.write_text("\n".join([log.read_text().splitlines()[0], *lines, *ring]))
    options = [
        *COLUMNS,
        "--model",
        "mean",
        *setting(repeats="true"),
        "--out",
        str(tmp_path / "out"),
    ]
    result = printed("rate", log, *options, "--explain", "s7", "--suspects")
    assert "Trust in the ratee s7: 0." in result
    assert "0% of 99 shuffled logs" in " ".join(result.split())
    assert "raters.csv" in result
    found = csv_rows(tmp_path / "out" / "suspects.csv")
    assert [row["rater"] for row in found if row["group"] == "1"] == [f"ring{n}" for n in range(5)]
    assert list(found[0]) == ["group", "rater", "apart", "p"]
    assert "no agent 'x' has ratings" in run("rate", str(log), *options, "--explain", "x").output


def test_a_state_takes_what_is_new_and_no_rating_twice(log: Path, tmp_path: Path) -> None:
    """Night after night it has the table of one run, from the whole log or from its new part, also
    sent again."""
    lines, part, state = (
        log.read_text().splitlines(keepends=True),
        tmp_path / "part.csv",
        str(tmp_path / "state.npz"),
    )
    settings: dict[str, Any] = {**NAMED, "scale": (1, 5), "model": "leave-one-out", "every": 30}
    rate(log, **settings).write(tmp_path / "whole")
    for first, last, words in (
        (0, 100, "100 new ratings; left out 0 of rounds"),
        (
            0,
            160,
            "60 new ratings; left out 90 of rounds that had ended, 10 repeated",
        ),
        (160, 300, "140 new ratings; left out 0 of rounds"),
        (
            160,
            300,
            "0 new ratings; left out 110 of rounds that had ended, 30 repeated",
        ),
    ):
        part.write_text("".join([lines[0], *lines[first + 1 : last + 1]]))
        rated = rate(part, state=state, **settings)
        rated.write(tmp_path / "nightly")
        assert words in " ".join(rated.notes)
    for name in ("ratees.csv", "raters.csv"):
        whole, nightly = (
            {row["name"]: row for row in csv_rows(tmp_path / out / name)}
            for out in ("whole", "nightly")
        )
        assert nightly == whole
    before = Path(state).read_bytes()
    for changed, words in (
        ({"scale": (0, 5)}, ("[1.0, 5.0]", "[0.0, 5.0]")),
        ({"every": 3600}, ("every", "30.0", "3600.0")),
        ({"same_agents": True}, ("same_agents", "False", "True")),
        ({"trusted": ["p1"]}, ("state", "trusted")),
        ({"every": None}, ("state", "every")),
    ):
        with refuses(ValueError, *words):
            rate(part, state=state, **{**settings, **changed})
    assert Path(state).read_bytes() == before


def test_a_night_without_new_ratings_changes_no_trust_and_another_clock_is_refused(
    log: Path, tmp_path: Path
) -> None:
    """A log that is wholly late, an empty one, and dates without a time zone after some with
    one."""
    head, first, *_ = log.read_text().splitlines(keepends=True)
    dates = [line.rpartition(",")[0] + ",2026-01-02T05:00:00" for line in (first.strip(),)]
    state = tmp_path / "state.npz"

    def night() -> Rated:
        return rate(log, state=state, every=30, scale=(1, 5), **NAMED)

    night().write(tmp_path / "out")
    before = csv_rows(tmp_path / "out" / "ratees.csv")
    log.write_text(head + first)
    late = night()
    assert "left out 1 of rounds that had ended" in " ".join(late.notes)
    late.write(tmp_path / "out")
    assert csv_rows(tmp_path / "out" / "ratees.csv") == before
    for text, words in (
        (head, ("log.csv",)),
        (head + dates[0], ("rounds", "1,000,000")),
    ):
        kept = state.read_bytes()
        log.write_text(text)
        with refuses(ValueError, *words):
            night()
        assert state.read_bytes() == kept


def test_a_bad_file_is_one_line_and_nothing_is_written(log: Path, tmp_path: Path) -> None:
    log.write_text(log.read_text() + "p1,s1,7,301\n")
    result = printed("rate", log, *COLUMNS, "--out", tmp_path / "out", code=2)
    assert_names(result, "302", "7")
    assert not (tmp_path / "out").exists()
    assert_names(
        printed("rate", tmp_path / "none.csv", "--out", tmp_path / "out", code=2), "none.csv"
    )


def test_names_give_no_orders_to_the_terminal_and_no_log_is_replaced(
    tmp_path: Path,
) -> None:
    path, out = tmp_path / "raters.csv", ["--out", str(tmp_path)]
    path.write_text("rater,ratee,rating\n[/],\x1b]0;ann\x07,1\n\u202ebob,=1+1,0\n")
    result = printed("rate", path, "--explain", "[/]", "--out", tmp_path / "[/]")
    assert "[/]" in result
    assert not re.search("[\x1b\x07\u202e]", result)
    assert {row["name"] for row in csv_rows(tmp_path / "[/]" / "ratees.csv")} == {
        "\x1b]0;ann\x07",
        "=1+1",
    }
    assert "would write to" in run("rate", str(path), *out).output


def test_inputs_are_not_replaced(tmp_path: Path) -> None:
    folder = tmp_path / "log"
    folder.mkdir()
    arrow.parquet.write_table(arrow.table({"rater": ["a"], "ratee": ["x"], "rating": [1]}),
                              folder / "x.parquet")  # fmt: skip
    (folder / "suspects.csv").write_text("rater,ratee,rating\na,x,1\n")
    (folder / "comparison.csv").write_text("rater,ratee,rating,time\na,x,1,1\n")
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    for arguments in (
        ["rate", str(folder), "--out", str(folder / "x.parquet")],
        ["rate", str(folder), "--out", str(folder)],
        ["rate", str(folder / "suspects.csv"), "--out", str(folder / "t.parquet")],
        ["compare", str(folder / "comparison.csv"), "--out", str(folder)],
    ):
        assert run(*arguments).exit_code == 2
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before


def test_a_bad_file_leaves_older_results_as_they_are(tmp_path: Path) -> None:
    out = tmp_path / "out"
    path = tmp_path / "log.csv"
    path.write_text(GOOD)
    options = "--scale", "1", "5", "--out", str(out)
    assert run("rate", str(path), *options).exit_code == 0
    before = {file.name: file.read_bytes() for file in out.iterdir()}
    path.write_text(GOOD + "c,x,6,40\n")
    result = printed("rate", path, *options, code=2)
    assert "Traceback" not in result
    assert {file.name: file.read_bytes() for file in out.iterdir()} == before


def test_a_model_that_does_not_fit_says_what_it_would_take(tmp_path: Path) -> None:
    path = tmp_path / "wide.csv"
    path.write_text("rater,ratee,rating\n" + "".join(f"r{n},p{n},1\n" for n in range(20_000)))
    result = printed("rate", path, "--model", "travos", "--out", tmp_path / "out", code=2)
    assert_names(result, "20,000")
    assert run("rate", str(path), "--out", str(tmp_path / "out")).exit_code == 0


def test_real_ratings(tmp_path: Path) -> None:
    if not REAL.exists():
        pytest.skip(f"the log of Bitcoin OTC is not in {REAL.parent}")
    columns = [*OTC, "--scale", "-10", "10", *MEMBERS]
    result = printed("rate", REAL, *columns, "--every", "2592000", "--out", tmp_path)
    assert "35,592 ratings in 64 rounds" in result
    assert (len(csv_rows(tmp_path / "raters.csv")), len(csv_rows(tmp_path / "ratees.csv"))) == (
        4814,
        5858,
    )


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--every", "0"], ("every", "0.0")),
        (["--set", "rate=b"], ("--set", "rate", "rater")),
        (["--set", "rater=a"], ("--set", "rater", "twice")),
        (["--set", "headr=no"], ("--set", "headr", "header")),
        (["--set", "decimal=;"], ("decimal", ";")),
    ],
)
def test_wrong_options_are_refused(
    log: Path, tmp_path: Path, options: list[str], words: tuple[str, ...]
) -> None:
    result = run("rate", str(log), *COLUMNS, *options, "--out", str(tmp_path / "out"))
    assert result.exit_code == 2
    assert_names(" ".join(result.stderr.split()), *words)
    assert not (tmp_path / "out" / "ratees.csv").exists()


def test_raters_that_are_trusted_beforehand_are_seeds_by_name(tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text(
        "rater,ratee,rating\nann,bob,1\nbob,cy,1\nmal,eve,1\neve,mal,1\n"
    )
    options = [
        *MEMBERS,
        "--model",
        "merit-rank",
        *setting(trusted='["ann "]'),
        "--out",
        str(tmp_path / "out"),
    ]
    assert run("rate", str(tmp_path / "log.csv"), *options).exit_code == 0
    trust = {row["name"]: float(row["trust"]) for row in csv_rows(tmp_path / "out" / "ratees.csv")}
    assert trust["bob"] > trust["cy"] > trust["mal"] == trust["eve"] == 0
    for more, words in (
        (["--model", "merit-rank", *setting(trusted='["annn"]')], ("ann",)),
        (setting(trusted='["ann"]'), ("leave-one-out",)),
        (setting(trusted="ann"), ("trusted", "ann")),
    ):
        result = run("rate", str(tmp_path / "log.csv"), *MEMBERS, *more)
        assert result.exit_code == 2
        assert_names(" ".join(result.stderr.split()), *words)
