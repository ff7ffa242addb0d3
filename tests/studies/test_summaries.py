"""The first pictures of pages of results are made from the published tables, and stand first on
their pages."""

import re

import pytest
from report_run import random_cells

from roletrust_env.benchmarking.leaderboard import Leaderboard
from roletrust_env.benchmarking.suite import Suite
from roletrust_env.benchmarking.suite_files import load_suite
from studies.study import DOCS
from studies.summaries import PICTURES, STANDARD, figures


@pytest.fixture(scope="module")
def board() -> Leaderboard:
    """A leaderboard of the suite standard with random numbers and a missing cell."""
    suite = load_suite("standard")
    assert isinstance(suite, Suite)
    return Leaderboard.of(suite, random_cells(suite)[1:])


@pytest.mark.slow
def test_each_picture_shows_the_models_of_its_page(board: Leaderboard) -> None:
    found = figures(board)
    assert set(found) == set(PICTURES)
    for name, figure in found.items():
        if name == STANDARD:
            tables = board.to_markdown()
        else:
            page = (DOCS / f"{name}.md").read_text(encoding="utf-8")
            assert re.match(rf"# .*\n\n!\[[^\]]+\]\({name}\.png\)\n", page), name
            tables = page + (DOCS / "real/real.md").read_text(encoding="utf-8")
            (DOCS / f"{name}.png").stat()
        names = [label.get_text().split()[-1] for label in figure.axes[0].get_yticklabels()]
        assert len(names) > 5
        assert all(model in tables for model in names), name
        wide, high = figure.get_size_inches()
        assert wide > 1.4 * high, (
            f"{name}: the title, the picture and three sentences fit a screen of 1440 x 900"
        )
