"""`roletrust audit`: its files, its options, which are those of `rate`, and its exit code."""

import json
import sys
from pathlib import Path

import pytest
from command_line import printed, run, setting
from refusals import assert_names

from roletrust_env.logs import write_log

SMALL = [*setting(same_agents="true"), "--scale", "-10", "10", "--top", "3", "--budget", "3"]


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path: Path = tmp_path_factory.mktemp("log") / "ratings.csv.gz"
    write_log(path, members=30, months=8)
    return path


def test_an_audit_says_the_same_on_screen_in_json_and_on_its_page(log: Path, tmp_path: Path):
    options = ["--prices", "account=7,rating=0.5", "--model", "mean"]
    columns = setting(rater="rater", ratee="ratee", rating="rating", time="time")
    made = run("audit", log, *SMALL, *options, *columns, "--out", tmp_path)
    assert made.exit_code == 0
    page = (tmp_path / "audit.html").read_text()
    found = json.loads((tmp_path / "audit.json").read_text())
    assert (found["format"], found["model"], found["log"]) == (
        "roletrust-audit-2",
        "mean",
        log.name,
    )
    assert found["prices"] == {"account": 7.0, "hijacked": 10.0, "rating": 0.5, "day": 0.0}
    assert (found["top"], found["budget"], found["every"]) == (3, 3, 2_592_000)
    assert found["version"]
    assert [one["border"] for one in found["exposures"][:3]].count(True) == 2
    for one in found["exposures"]:
        assert one["lower"] <= one["upper"]
        if one["accounts"] == 1:
            assert one["upper"] == 7 + len(one["sent"]) * 0.5
        for text in (f"<td>{one['upper']:,.4g}</td>", f"<th>{one['agent'] or 'unrated'}</th>"):
            assert text in page
    for goal, median in found["medians"].items():
        assert f"{median[0]:,.4g}" in made.output, goal
    assert page.index("data:image/png") < page.index("<table>")
    assert max(map(len, made.output.splitlines()[1:-2])) <= 80


def test_prices_may_be_nothing_but_not_negative(log: Path, tmp_path: Path):
    few = ["--target", "5", "--model", "mean", "--out", tmp_path]
    printed("audit", log, *SMALL, *few, "--prices", "account=0,hijacked=0,rating=0")
    (one,) = json.loads((tmp_path / "audit.json").read_text())["exposures"]
    assert (one["agent"], one["lower"], one["upper"]) == ("5", 0.0, 0.0)
    assert_names(printed("audit", log, *few, "--prices", "day=-1", code=2), "day", -1)


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


def test_an_audit_of_a_model_outside_that_dies_continues(log: Path, tmp_path: Path):
    scorer = tmp_path / "scorer.py"
    arguments = ["audit", log, *SMALL, "--model", f"exec:{sys.executable} {scorer}"]
    scorer.write_text(SCORER.format(most=250))
    assert_names(printed(*arguments, "--out", tmp_path / "broken", code=2), "1")
    journal = tmp_path / "broken" / "audit.journal"
    kept = len(journal.read_text().splitlines())
    assert kept > 3
    with journal.open("a") as file:
        file.write('\n["torn')
    scorer.write_text(SCORER.format(most=10**9))
    result = run(*arguments, "--out", tmp_path / "broken")
    assert_names(result.output.splitlines()[0], kept - 1)
    assert run(*arguments, "--out", tmp_path / "whole").exit_code == 0
    found, whole = ((tmp_path / name / "audit.json").read_text() for name in ("broken", "whole"))
    assert found == whole
    assert not journal.exists()


@pytest.mark.slow
def test_a_model_outside_is_audited_as_one_inside(log: Path, tmp_path: Path):
    outside = f"exec:{sys.executable} -m roletrust_env.trust.remote beta"
    found = []
    for model in ("beta", outside):
        printed("audit", log, *SMALL, "--model", model, "--out", tmp_path)
        found.append(json.loads((tmp_path / "audit.json").read_text()))
        del found[-1]["model"]
    assert found[0] == found[1]
