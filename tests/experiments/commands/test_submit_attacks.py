"""`roletrust submit --attacks` and `roletrust benchmark --known`: attacks that others can play."""

from pathlib import Path

import pytest
from command_line import printed
from refusals import assert_names

from roletrust_env.benchmarking.known_attacks import read_known_attacks
from roletrust_env.benchmarking.store import ResultStore
from roletrust_env.benchmarking.suite import Suite

SUITE = """
models = ["mean"]
attacks = ["bad-mouthing", "random-rating"]
methods = ["scripted"]
games = 3
[scenarios.market]
preset = "market"
set = { max_cycles = 5, agents = [{ role = "SR", count = 4 }, { role = "SP", count = 3, ability = [0.3, 1.0] }] }
[tracks.honest]
[tracks.raters]
roles = ["SR"]
shares = [0.5]
"""  # noqa: E501


@pytest.fixture
def folder(in_process: None, tmp_path: Path) -> Path:
    """Return a folder with a suite, its results and its attacks."""
    folder = tmp_path
    (folder / "tiny.toml").write_text(SUITE)
    printed("benchmark", "--suite", folder / "tiny.toml", "--workers", "1", "--out", folder / "run")
    told = printed(
        *("submit", folder / "run/results.sqlite", "--attacks"),
        *("--finder", "A. Author", "--out", folder / "a.json"),
    )
    assert "a.json, 1 attacks" in told
    return folder


def test_attacks_of_one_run_play_in_another(folder: Path) -> None:
    (attack,) = read_known_attacks(folder / "a.json")
    assert attack.finder == "A. Author"
    again = folder / "again"
    suite, known = ("--suite", folder / "tiny.toml"), ("--known", folder / "a.json")
    printed("benchmark", *suite, *known, "--model", "median", "--workers", "1", "--out", again)
    with ResultStore(again / "results.sqlite") as store:
        rows = [
            row for cell, result in store.all() if cell.method == "known" for row in result.rows
        ]
        assert isinstance(store.suite, Suite)
        assert store.suite.known == (attack,)
    assert [(row.attack, row.words) for row in rows] == [
        (attack.name, "known attack, found by A. Author")
    ]
    assert "found by A. Author" in printed(
        "replay",
        again / "results.sqlite",
        "--cell",
        "median|market|raters|0.5|known|0",
        "--out",
        folder / "r",
    )


def test_what_cannot_be_is_one_line(folder: Path) -> None:
    file, out = folder / "run/results.sqlite", ("--out", folder / "b.json")
    assert_names(printed("submit", file, "--finder", "me", *out, code=2), "--finder", "--attacks")
    assert_names(printed("submit", file, "--attacks", "--model", "men", *out, code=2), "men")
    (folder / "d.json").write_text((folder / "a.json").read_text().replace('"raters"', '"nowhere"'))
    for suite, known, words in (
        ("learners", "a.json", ("--known", "learners")),
        ("quick", "d.json", ("1",)),
        ("quick", "none.json", ("none.json",)),
    ):
        refused = "--suite", suite, "--known", folder / known, "--out", folder / "c"
        assert_names(printed("benchmark", *refused, "--dry-run", code=2), *words)
