"""The README in particular, and that it is short."""

import importlib.util
import re

import pytest
from pages import HOUSE, run

README = HOUSE / "README.md"
SHORT = 160  # lines that a newcomer reads in five minutes, a table among them


@pytest.fixture
def said():
    return run(README)


def test_the_first_loop_shows_the_liar(said):
    trust = {agent: info["trust"] for agent, info in said["infos"].items()}
    assert trust["sr_2"] < trust["sr_0"] < 0.7


def cells(text):
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in text.splitlines() if line.startswith("|")]


def test_the_leaderboard_is_that_of_the_benchmark():
    whole = cells((HOUSE / "docs/leaderboards/standard/leaderboard.md").read_text(encoding="utf-8"))
    text = README.read_text(encoding="utf-8").partition("<!-- leaderboard -->")[2].partition("<!-- /leaderboard -->")[0]
    shown = cells(text)
    columns = [whole[0].index(name) for name in shown[0]]
    assert shown[0][:5] == ["tier", "rank", "model", "clean", "worst"]
    assert shown == [[row[column] for column in columns] for row in whole]


def test_it_begins_with_a_moving_picture_pip_and_a_loop():
    text = README.read_text(encoding="utf-8")
    places = [text.index(part) for part in (".gif)", "pip install", "```python", "make run", "make test")]
    assert places == sorted(places)


def test_the_moving_picture_is_small():
    assert (HOUSE / "docs/game.gif").stat().st_size <= 1_000_000


CODE = r"^```.*?^```$|`[^`\n]+`"


@pytest.fixture
def absolute():
    """The function of `hatch_build.py`, which is not installed."""
    pytest.importorskip("hatchling", reason="it is needed to build the package only")
    spec = importlib.util.spec_from_file_location("hatch_build", HOUSE / "hatch_build.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.absolute


def test_on_a_package_index_links_are_absolute(absolute):
    text = README.read_text(encoding="utf-8")
    shown = absolute(text, "https://example.org/team/roletrust/")
    assert "(https://example.org/team/roletrust/raw/HEAD/docs/game.gif)" in shown
    assert "(https://example.org/team/roletrust/blob/HEAD/docs/guide/install.md)" in shown
    assert re.findall(r"\]\((?!https://)[^)#]*\)", re.sub(CODE, "", shown, flags=re.M | re.S)) == []
    without = absolute(text, None)
    for shown_text in (shown, without):
        assert re.findall(CODE, shown_text, re.M | re.S) == re.findall(CODE, text, re.M | re.S)
    assert "game.gif" not in without
    assert "| Tutorials |" in without
    assert re.findall(r"\]\((?!https://)[^)#]*\)", re.sub(CODE, "", without, flags=re.M | re.S)) == []


def test_it_is_short():
    assert len(README.read_text(encoding="utf-8").splitlines()) <= SHORT
