"""The first pictures of pages of results are made from the published tables, and stand first on
their pages."""

import re

import pytest

from studies.study import DOCS
from studies.summaries import PICTURES, STANDARD, figures

pytestmark = pytest.mark.slow

PARTS = {STANDARD: f"{STANDARD}.md", "real": "real/real.md"}
"""Included tables."""


def test_each_picture_shows_the_models_of_its_page() -> None:
    found = figures(DOCS)
    assert set(found) == set(PICTURES)
    for name, figure in found.items():
        page = (DOCS / {STANDARD: "robustness.md"}.get(name, f"{name}.md")).read_text(
            encoding="utf-8"
        )
        tables = page + (DOCS / PARTS[name]).read_text(encoding="utf-8") if name in PARTS else page
        assert re.match(rf"# .*\n\n!\[[^\]]+\]\({name}\.png\)\n", page), name
        (DOCS / f"{name}.png").stat()
        names = [label.get_text().split()[-1] for label in figure.axes[0].get_yticklabels()]
        assert len(names) > 5
        assert all(model in tables for model in names), name
        wide, high = figure.get_size_inches()
        assert wide > 1.4 * high, (
            f"{name}: the title, the picture and three sentences fit a screen of 1440 x 900"
        )
