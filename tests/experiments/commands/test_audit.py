"""`roletrust audit`: its files, its options, which are those of `rate`, and its exit code."""

import json
import sys
from pathlib import Path

import pytest
from command_line import printed, run
from refusals import assert_names

from roletrust_env.logs.folders import write_log

SMALL = ["--same-agents", "--scale", "-10", "10", "--top", "2", "--targets", "1", "--budget", "6"]


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path: Path = tmp_path_factory.mktemp("log") / "ratings.csv.gz"
    write_log(path, members=30, months=8)
    return path


def test_an_audit_says_the_same_on_screen_in_json_and_on_its_page(log: Path, tmp_path: Path):
    jsonschema = pytest.importorskip("jsonschema")
    prices = ["--price-account", "7", "--price-rating", "0.5", "--fail-below", "1000"]
    models = ["--model", "mean", "--other", "beta"]
    columns = ["--columns", "rater=rater,ratee=ratee,rating=rating,time=time"]
    made = run("audit", log, *SMALL, *prices, *columns, *models, "--out", tmp_path)
    assert made.exit_code == 1
    result = made.output
    assert "Failed: a median price is" in result
    found, page = (
        json.loads((tmp_path / "audit.json").read_text()),
        (tmp_path / "audit.html").read_text(),
    )
    jsonschema.validate(found, json.loads((tmp_path / "audit.schema.json").read_text()))
    assert (found["format"], found["model"], list(found["compared"])) == (
        "roletrust-audit-1",
        "mean",
        ["mean", "beta"],
    )
    first = found["audit"]["exposures"][0]["cheapest"]
    assert first["price"] == first["accounts"] * 7 + first["ratings"] * 0.5
    for text in ("out of top", "newcomer in", f"{first['price']:,.4g}"):
        assert text in result
        assert text in page
    assert page.index("data:image/png") < page.index("<table>")
    assert "Median price in 60 attacks" in result
    assert max(map(len, result.splitlines()[1:-3])) <= 80


def test_prices_may_be_nothing_and_are_no_higher_than_numbers_are_exact(log: Path, tmp_path: Path):
    nothing = [
        text for name in ("account", "hijacked", "rating") for text in (f"--price-{name}", "0")
    ]
    few = ["--alone", "--target", "5", "--budget", "2", "--model", "mean"]
    printed("audit", log, *SMALL, *few, *nothing, "--out", tmp_path / "out")
    for options, words in (
        (["--price-day", "1e300"], "numbers up to 1e+12"),
        (["--other", "mean"], "--alone"),
    ):
        assert words in run("audit", str(log), *SMALL, "--alone", *options).output


SCORER = """
import json, sys
for n, line in enumerate(sys.stdin):
    one = json.loads(line)
    if n > {most}:
        sys.exit("out of memory")
    if "over" not in one:
        given = [r[2] for r in one["ratings"]]
        print(json.dumps({{"providers": [0.5 + 0.4 * sum(given) / (1 + len(given))] * one["providers"]}}), flush=True)
"""  # noqa: E501


def test_an_audit_of_a_scorer_that_dies_goes_on_where_it_was(log: Path, tmp_path: Path):
    scorer = tmp_path / "scorer.py"
    arguments = [
        "audit",
        str(log),
        *SMALL,
        "--alone",
        "--scorer",
        f"exec:{sys.executable} {scorer}",
    ]
    scorer.write_text(SCORER.format(most=250))
    result = printed(*arguments, "--out", tmp_path / "broken", code=2)
    assert_names(result, "1")
    journal = tmp_path / "broken" / "audit.journal"
    with journal.open("a") as file:
        file.write('\n["torn')
    scorer.write_text(SCORER.format(most=10**9))
    result = run(*arguments, "--out", str(tmp_path / "broken"))
    assert "attacks are known from an interrupted audit" in result.output
    assert run(*arguments, "--out", str(tmp_path / "whole")).exit_code == 0
    found, whole = ((tmp_path / name / "audit.json").read_text() for name in ("broken", "whole"))
    assert found == whole
    assert not journal.exists()


@pytest.mark.slow
def test_a_scorer_outside_is_audited_as_a_model_inside(log: Path, tmp_path: Path):
    outside = (
        f"exec:{sys.executable} -c 'from roletrust_experiments import main; main()' serve mean"
    )
    found = []
    for model in ("mean", outside):
        printed("audit", log, *SMALL, "--scorer", model, "--out", tmp_path, "--fail-below", "0.5")
        found.append(json.loads((tmp_path / "audit.json").read_text()))
    inside, same = found
    assert inside["audit"] == same["audit"]
    assert inside["compared"]["mean"] == same["compared"][outside]
    assert (
        list(inside["compared"])[1:]
        == [one for one in same["compared"] if one not in ("mean", outside)][:3]
    )
