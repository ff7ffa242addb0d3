"""The first pictures of pages are made from the published tables, and stand first on their pages."""

import re

import pytest

from studies.study import DOCS
from studies.summaries import PICTURES, figures

pytestmark = pytest.mark.slow


def test_each_picture_shows_the_models_of_its_page() -> None:
    found = figures(DOCS)
    assert set(found) == set(PICTURES)
    for name, figure in found.items():
        page = (DOCS / f"{name}.md").read_text(encoding="utf-8")
        tables = page + (DOCS / "real" / "real.md").read_text(encoding="utf-8") * (name == "real")
        assert re.match(rf"# .*\n\n!\[[^\]]+\]\({name}\.png\)\n", page), name
        (DOCS / f"{name}.png").stat()
        names = [label.get_text() for label in figure.axes[0].get_yticklabels()]
        assert len(names) > 5
        assert all(model in tables for model in names), name
