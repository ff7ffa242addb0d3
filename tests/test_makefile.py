"""`make test` and `make test-all` run every test once: the marked ones are looked for in some
folders only."""

import re
import tomllib
from pathlib import Path

import pytest

HOUSE = Path(__file__).parent.parent
MAKEFILE = (HOUSE / "Makefile").read_text(encoding="utf-8")
PROJECT = tomllib.loads((HOUSE / "pyproject.toml").read_text(encoding="utf-8"))
OPTIONS = PROJECT["tool"]["pytest"]["ini_options"]
MARKERS = [line.partition(":")[0] for line in OPTIONS["markers"]]


def recipe(target):
    """The lines by which a target is made."""
    (lines,) = re.findall(rf"^{target}:.*\n((?:\t.*\n)+)", MAKEFILE, flags=re.MULTILINE)
    return [line.strip() for line in lines.splitlines()]


def test_what_is_left_out_is_marked_and_is_run_by_the_other_target():
    (left_out,) = re.findall(r"-m '(.*)'", OPTIONS["addopts"])
    assert sorted(left_out.split(" and ")) == sorted(f"not {marker}" for marker in MARKERS)
    assert [line for line in recipe("test") if "$(BIN)/pytest -n 2 --dist loadfile;" in line]
    assert not [line for line in recipe("test") if "-m " in line or "$(MAKE)" in line]
    before_a_release = {"soak"}
    others = {"doctests", "studies"}
    assert set(recipe("test-all")) == {
        f"$(MAKE) test-{name}" for name in set(MARKERS) - before_a_release | others
    }
    for marker in MARKERS:
        assert [line for line in recipe(f"test-{marker}") if f" -m {marker} " in line]


def test_targets_install_extras_and_groups_that_are_declared():
    """Pip only warns of an extra that is not declared."""
    extras = {name for line in re.findall(r"'\.\[(.+)\]'", MAKEFILE) for name in line.split(",")}
    assert {"all", "cli"} <= extras <= PROJECT["project"]["optional-dependencies"].keys()
    groups = set(re.findall(r"--group (\w+)", MAKEFILE))
    assert {"test", "dev"} <= groups <= PROJECT["dependency-groups"].keys()


@pytest.mark.parametrize("marker", MARKERS)
def test_marked_tests_lie_where_they_are_looked_for(marker):
    (folders,) = set(re.findall(rf"pytest .*-m {marker} (.+)", MAKEFILE))
    places = [HOUSE / folder for folder in folders.split()]
    marked = [
        path for path in HOUSE.glob("tests/**/*.py") if f"pytest.mark.{marker}" in path.read_text()
    ]
    assert marked
    for path in marked:
        assert any(place == path or place in path.parents for place in places), path
