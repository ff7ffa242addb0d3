"""The README in particular, and that it is short."""

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


def test_the_leaderboard_is_that_of_the_benchmark():
    table = (HOUSE / "docs/leaderboard.md").read_text(encoding="utf-8")
    assert table in README.read_text(encoding="utf-8")
    assert table.splitlines()[-1].endswith("Made by `roletrust benchmark --suite standard --out results/standard`.")


def test_it_is_short():
    assert len(README.read_text(encoding="utf-8").splitlines()) <= SHORT
