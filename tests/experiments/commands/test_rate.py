"""`roletrust rate`: its tables, its files, and what it refuses; with `--compare`, on logs of either
kind."""

import gzip
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import printed, run
from csv_files import csv_rows
from log_cases import BAD, GOOD
from refusals import assert_names

from roletrust_baselines.logs.folders import KNOWN, write_log
from roletrust_env.data import TrustStream
from roletrust_env.trust import make_trust_model
from roletrust_env.trust.models.central.beta_reputation import Beta

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


COLUMNS = [
    "--rater",
    "who",
    "--ratee",
    "shop",
    "--rating",
    "stars",
    "--time",
    "day",
    "--scale",
    "1",
    "5",
]


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
    lows = [float(row["low"]) for row in ratees]
    assert lows == sorted(lows, reverse=True)
    assert all(float(row["low"]) <= float(row["trust"]) <= float(row["high"]) for row in ratees)
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

    result = printed("rate", log, *COLUMNS, "--rank-by", "trust", "--out", tmp_path / "out.parquet")
    assert "Model leave-one-out, the nearest" in result
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
    options = [*COLUMNS, "--model", "mean", "--repeats", "--out", str(tmp_path / "out")]
    result = printed("rate", log, *options, "--explain", "s7", "--suspects", "--top", "0")
    assert "Trust in the ratee s7: 0." in result
    assert "In 19 shuffled logs: 0 groups" in result
    assert "raters.csv, suspects.csv" in result
    found = csv_rows(tmp_path / "out" / "suspects.csv")
    assert [row["rater"] for row in found if row["group"] == "1"] == [f"ring{n}" for n in range(5)]
    assert "no agent 'x' has ratings" in run("rate", str(log), *options, "--explain", "x").output
    assert (
        "need a whole log"
        in run("rate", str(log), "--suspects", "--lead", "3", "--every", "9").output
    )


def test_a_state_takes_what_is_new_and_no_rating_twice(log: Path, tmp_path: Path) -> None:
    """Night after night it has the table of one run, from the whole log or from its new part, also
    sent again."""
    lines, part, state = (
        log.read_text().splitlines(keepends=True),
        tmp_path / "part.csv",
        str(tmp_path / "state.npz"),
    )
    options = [*COLUMNS, "--model", "leave-one-out", "--every", "30"]
    assert run("rate", str(log), *options, "--out", str(tmp_path / "whole")).exit_code == 0
    for first, last, words in (
        (0, 100, ""),
        (
            0,
            160,
            "90 ratings of rounds that had ended (--late drop), 0 ahead by more than the lead, 10 "
            "repeated",
        ),
        (160, 300, ""),
        (
            160,
            300,
            "110 ratings of rounds that had ended (--late drop), 0 ahead by more than the lead, 30 "
            "repeated",
        ),
    ):
        part.write_text("".join([lines[0], *lines[first + 1 : last + 1]]))
        result = printed("rate", part, *options, "--state", state, "--out", tmp_path / "nightly")
        assert words in result
        assert ("had ended" in result) == bool(words)
    for name in ("ratees.csv", "raters.csv"):
        whole, nightly = (
            {row["name"]: row for row in csv_rows(tmp_path / out / name)}
            for out in ("whole", "nightly")
        )
        assert nightly == whole
    part.write_text(lines[0] + "p1,s1,5,9999\np1,s2,5,3\np1,s3,5,301\n")
    result = run("rate", str(part), *options, "--state", state, "--lead", "50", "--late", "count")
    assert (
        "1 ratings of rounds that had ended (--late count), 1 ahead by more than the lead, 0"
        in result.output
    )
    before = Path(state).read_bytes()
    for changed, words in (
        (["--scale", "0", "5"], ("[1.0, 5.0]", "[0.0, 5.0]")),
        (["--every", "3600"], ("every", "30.0", "3600.0")),
        (["--same-agents"], ("same_agents", "False", "True")),
    ):
        result = run("rate", str(part), *options, "--state", state, *changed)
        assert result.exit_code == 2
        assert_names(" ".join(result.stderr.split()), *words)
    assert Path(state).read_bytes() == before
    result = run("rate", str(part), *COLUMNS, "--state", state)
    assert_names(" ".join(result.stderr.split()), "--state", "--every")


def test_a_night_without_new_ratings_changes_no_trust_and_another_clock_is_refused(
    log: Path, tmp_path: Path
) -> None:
    """A log that is wholly late, an empty one, and dates without a time zone after some with
    one."""
    head, first, *_ = log.read_text().splitlines(keepends=True)
    dates = [line.rpartition(",")[0] + ",2026-01-02T05:00:00" for line in (first.strip(),)]
    options = [
        *COLUMNS,
        "--every",
        "30",
        "--state",
        str(tmp_path / "state.npz"),
        "--out",
        str(tmp_path / "out"),
    ]
    assert run("rate", str(log), *options).exit_code == 0
    before = csv_rows(tmp_path / "out" / "ratees.csv")
    log.write_text(head + first)
    assert "1 ratings of rounds that had ended" in run("rate", str(log), *options).output
    assert csv_rows(tmp_path / "out" / "ratees.csv") == before
    for text, words in (
        (head, ("log.csv",)),
        (head + dates[0], ("times",)),
        (head + dates[0] + "Z", ("times", "1970")),
    ):
        state = (tmp_path / "state.npz").read_bytes()
        log.write_text(text)
        result = run("rate", str(log), *options)
        assert result.exit_code == 2
        assert_names(" ".join(result.stderr.split()), *words)
        assert (tmp_path / "state.npz").read_bytes() == state


def test_a_bad_file_is_one_line_and_nothing_is_written(log: Path, tmp_path: Path) -> None:
    log.write_text(log.read_text() + "p1,s1,7,301\n")
    result = printed("rate", log, *COLUMNS, "--out", tmp_path / "out", code=2)
    assert_names(result, "302", "7")
    assert not (tmp_path / "out").exists()
    assert_names(
        printed("rate", tmp_path / "none.csv", "--out", tmp_path / "out", code=2), "none.csv"
    )


def test_names_give_no_orders_to_the_terminal_and_no_log_or_state_is_replaced(
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
    assert "would replace" in run("rate", str(path), *out).output
    table = ["--out", str(tmp_path / "x.parquet")]
    assert (
        "would replace"
        in run(
            "rate", "log.csv", "--every", "9", "--state", str(tmp_path / "x.parquet"), *table
        ).output
    )


def test_a_bad_file_leaves_older_results_as_they_are(tmp_path: Path) -> None:
    content, out = BAD["off the scale"][0], tmp_path / "out"
    path = tmp_path / "log.csv"
    path.write_text(GOOD)
    options = "--time", "time", "--scale", "1", "5", "--out", str(out)
    assert run("rate", str(path), *options).exit_code == 0
    before = {file.name: file.read_bytes() for file in out.iterdir()}
    path.write_bytes(content.encode() if isinstance(content, str) else content)
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
    columns = [
        "--rater",
        "1",
        "--ratee",
        "2",
        "--rating",
        "3",
        "--time",
        "4",
        "--scale",
        "-10",
        "10",
        "--same-agents",
    ]
    result = printed("rate", REAL, *columns, "--every", "2592000", "--out", tmp_path)
    assert "35,592 ratings in 64 rounds" in result
    assert (len(csv_rows(tmp_path / "raters.csv")), len(csv_rows(tmp_path / "ratees.csv"))) == (
        4814,
        5858,
    )


@pytest.mark.parametrize(
    ("rounds", "word"),
    [
        (["--every", "0", "--time", "day"], "0"),
        (["--count", "9", "--every", "30", "--time", "day"], "rounds"),
    ],
)
def test_rounds_that_do_not_fit_are_refused_before_the_file_is_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, rounds: list[str], word: str
) -> None:
    def read(*_: object, **__: object) -> None:
        raise AssertionError("the file is read")

    monkeypatch.setattr("roletrust_experiments.commands.log_options.read_ratings", read)
    result = run("rate", str(tmp_path / "log.csv"), *rounds, "--out", str(tmp_path / "out"))
    assert result.exit_code == 2
    assert_names(" ".join(result.stderr.split()), word)
    assert not (tmp_path / "out").exists()


# --- which model suits logs
# ---------------------------------------------------------------------------


def compare(*arguments: str) -> Any:
    return run("rate", "--compare", *arguments)


def test_a_synthetic_log_is_written_and_measured(tmp_path: Path) -> None:
    models = ["--model", "role-trust", "--model", "own-experience"]
    result = compare(str(tmp_path / "log"), "--synthetic", *models, "--out", str(tmp_path / "out"))
    assert result.exit_code == 0, result.output
    table = csv_rows(tmp_path / "out" / "comparison.csv")
    protocols = ["rated before", "next rating", "rater forward", "attack"]
    assert list(dict.fromkeys(row["protocol"] for row in table)) == protocols
    assert re.search(
        r"log/ratings.csv.gz: Recommended: [a-z-]+\. Its forecast \(r 0\.",
        result.output.replace("\n", " "),
    )
    assert {row["model"] for row in table} == {"role-trust", "own-experience"}
    known = [row for row in table if row["low"]]
    assert all(float(row["low"]) <= float(row["value"]) <= float(row["high"]) for row in known)
    assert {row["round"] for row in table} == {"2592000.000000"}
    assert "too narrow" not in result.output  # at 80 columns
    assert "| role-trust |" in (tmp_path / "out" / "comparison.md").read_text()
    first = next(row for row in table if (row["protocol"], row["measure"]) == ("rated before", "r"))
    shown = [line.split() for line in result.output.splitlines()]
    assert [first["model"], f"{float(first['value']):.3f}"] in [line[:2] for line in shown]
    again = compare(str(tmp_path / "log"), *models, "--out", str(tmp_path / "again"))
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


def test_a_log_that_is_too_small_for_a_protocol_has_the_others(tmp_path: Path) -> None:
    """And other logs of the folder are measured; a line says what is left out."""
    month = 2_592_000
    written(
        tmp_path / "one-each",
        "ratings.csv",
        [f"{n},{n + 1},{n % 11 - 5},{n * month // 8}" for n in range(0, 90, 2)],
    )
    written(tmp_path / "one-round", "ratings.csv", ["1,2,5,0", "2,3,4,1"])
    result = compare(
        str(tmp_path), "--model", "mean", "--model", "beta", "--out", str(tmp_path / "out")
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
    turned = [";".join(line.split(",")[place] for place in (3, 2, 1, 0)) for line in lines]
    written(tmp_path, "own.csv", ["when;points;seller;buyer", *turned])
    options = ["--model", "mean", "--scale", "-10", "10", "--out", str(tmp_path / "out")]
    result = compare(str(tmp_path / "own.csv"), "--time", "when", "--rating", "points", *options)
    assert result.exit_code == 0, result.output
    assert "separator semicolon" in result.output.replace("\n", " ")
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
        ["1,2,5,0", "2,3,4,9999999", "1,3,4,9999999", "3,2,-4,19999999"],
    )
    written(tmp_path / "b", "ratings.csv", ["1,2,5,0", "2,3,four,9999999"])
    options = ["--model", "mean", "--model", "beta", "--out", str(tmp_path / "out")]
    result = compare(str(tmp_path), *options)
    assert result.exit_code == 2
    assert "b/ratings.csv, row 2" in result.output.replace("\n", "")
    assert not (tmp_path / "out").exists()
    (tmp_path / "b" / "ratings.csv").unlink()
    monkeypatch.setattr(Beta, "update", lambda *given: 1 / 0)
    assert isinstance(compare(str(tmp_path), *options).exception, ZeroDivisionError)
    assert {row["model"] for row in csv_rows(tmp_path / "out" / "comparison.csv")} == {"mean"}


def test_a_log_that_is_too_small_for_all_is_one_line(tmp_path: Path) -> None:
    written(tmp_path / "log", "ratings.csv", ["1,2,5,0"])
    result = compare(str(tmp_path / "log"), "--out", str(tmp_path / "out"))
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
    result = compare(
        str(SHARED), "--model", "role-trust", "--model", "mean", "--out", str(tmp_path)
    )
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


def test_options_of_one_kind_are_refused_for_the_other(tmp_path: Path) -> None:
    for options, word in (
        (["--compare", "--count", "3"], "--compare"),
        (["--compare", "--explain", "x"], "--compare"),
        (["--compare", "--out", "x.parquet"], "--compare"),
        (["--synthetic"], "--compare"),
        (["--model", "mean", "--model", "beta"], "--compare"),
    ):
        result = run("rate", str(tmp_path), *options)
        assert result.exit_code == 2
        assert_names(" ".join(result.stderr.split()), word)


def test_raters_that_are_trusted_beforehand_are_seeds_by_name(tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text(
        "rater,ratee,rating\nann,bob,1\nbob,cy,1\nmal,eve,1\neve,mal,1\n"
    )
    options = [
        "--same-agents",
        "--model",
        "merit-rank",
        "--trusted",
        "ann ",
        "--out",
        str(tmp_path / "out"),
    ]
    assert run("rate", str(tmp_path / "log.csv"), *options).exit_code == 0
    trust = {row["name"]: float(row["trust"]) for row in csv_rows(tmp_path / "out" / "ratees.csv")}
    assert trust["bob"] > trust["cy"] > trust["mal"] == trust["eve"] == 0
    for more, words in (
        (["--model", "merit-rank", "--trusted", "annn"], ("ann",)),
        (["--trusted", "ann"], ("leave-one-out",)),
        (["--trusted", "ann", "--compare"], ("--compare", "--state")),
    ):
        result = run("rate", str(tmp_path / "log.csv"), "--same-agents", *more)
        assert result.exit_code == 2
        assert_names(" ".join(result.stderr.split()), *words)
