"""`make test` runs every test: also those that are marked, which it looks for in some folders only."""

import re
import tomllib
from pathlib import Path

import pytest

HOUSE = Path(__file__).parent.parent
MAKEFILE = (HOUSE / "Makefile").read_text(encoding="utf-8")
OPTIONS = tomllib.loads((HOUSE / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["pytest"]["ini_options"]


@pytest.mark.parametrize("marker", [line.partition(":")[0] for line in OPTIONS["markers"]])
def test_marked_tests_lie_where_they_are_looked_for(marker):
    (folders,) = set(re.findall(rf"pytest .*-m {marker} (.+)", MAKEFILE))
    places = [HOUSE / folder for folder in folders.split()]
    marked = [path for path in HOUSE.glob("tests/**/*.py") if f"pytest.mark.{marker}" in path.read_text()]
    assert marked
    for path in marked:
        assert any(place == path or place in path.parents for place in places), path
