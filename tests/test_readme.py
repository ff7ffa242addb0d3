"""The README in particular: its loop, and its links on a package index."""

import importlib.util
import re

import pytest
from pages import HOUSE, run

README = HOUSE / "README.md"


@pytest.fixture
def said():
    return run(README)


def test_the_first_loop_shows_the_liar(said):
    trust = {agent: info["trust"] for agent, info in said["infos"].items()}
    assert trust["sr_2"] < trust["sr_0"] < 0.7
    text = README.read_text(encoding="utf-8")
    assert f"trusted least, with {trust['sr_2']:.2f}" in text
    assert f"end at {trust['sp_0']:.2f}, hardly higher" in text


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
    assert (
        re.findall(r"\]\((?!https://)[^)#]*\)", re.sub(CODE, "", without, flags=re.M | re.S)) == []
    )
