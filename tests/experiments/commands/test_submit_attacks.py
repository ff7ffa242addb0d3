"""`roletrust submit --attacks` and `roletrust benchmark --known`: attacks that others can play."""

from pathlib import Path

import pytest
from command_line import run

from roletrust_env.benchmarking.known_attacks import read_known_attacks
from roletrust_env.benchmarking.store import Store
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
"""


@pytest.fixture
def folder(in_process: None, tmp_path: Path) -> Path:
    """Folder with a suite, its results and its attacks."""
    folder = tmp_path
    (folder / "tiny.toml").write_text(SUITE)
    tell("benchmark", "--suite", folder / "tiny.toml", "--workers", "1", "--out", folder / "run")
    told = tell(
        *("submit", folder / "run/results.sqlite", "--attacks"), *("--finder", "A. Author", "--out", folder / "a.json")
    )
    assert "a.json, 1 attacks" in told
    return folder


def tell(*arguments: object, code: int = 0) -> str:
    """Return what a command prints."""
    made = run(*map(str, arguments))
    assert made.exit_code == code, made.output
    return " ".join(made.output.split())


def test_attacks_of_one_run_play_in_another(folder: Path) -> None:
    (attack,) = read_known_attacks(folder / "a.json")
    assert attack.finder == "A. Author"
    again = folder / "again"
    suite, known = ("--suite", folder / "tiny.toml"), ("--known", folder / "a.json")
    tell("benchmark", *suite, *known, "--model", "median", "--workers", "1", "--out", again)
    with Store(again / "results.sqlite") as store:
        rows = [row for cell, result in store.all() if cell.method == "known" for row in result.rows]
        assert isinstance(store.suite, Suite)
        assert store.suite.known == (attack,)
    assert [(row.attack, row.words) for row in rows] == [(attack.name, "known attack, found by A. Author")]
    told = tell("replay", again / "results.sqlite", "--cell", "median|market|raters|0.5|known|0", "--out", folder / "r")
    assert "found by A. Author" in told


def test_what_cannot_be_is_one_line(folder: Path) -> None:
    file, out = folder / "run/results.sqlite", ("--out", folder / "b.json")
    assert "--finder is for --attacks" in tell("submit", file, "--finder", "me", *out, code=2)
    assert "no trust model 'men'" in tell("submit", file, "--attacks", "--model", "men", *out, code=2)
    (folder / "d.json").write_text((folder / "a.json").read_text().replace('"raters"', '"nowhere"'))
    for suite, known, words in (
        ("learners", "a.json", "--known is not for the suite learners"),
        ("quick", "d.json", "none of the 1 known attacks is for"),
        ("quick", "none.json", "there is no file"),
    ):
        refused = "--suite", suite, "--known", folder / known, "--out", folder / "c"
        assert words in tell("benchmark", *refused, "--dry-run", code=2)
