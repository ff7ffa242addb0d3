"""The pages of the API name what there is."""

import re
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from pkgutil import resolve_name

import pytest

from roletrust_env import DependencyNotInstalled

PAGES = sorted((Path(__file__).parents[2] / "docs" / "api").glob("*.rst"))
DIRECTIVE = re.compile(r"\.\. (?:py:)?(auto\w+|currentmodule|module):: ([\w.]+)$", re.MULTILINE)


def documented(page: Path) -> list[tuple[str, str]]:
    """The module in force and the name of each object that a page documents."""
    module, names = "", []
    for kind, name in DIRECTIVE.findall(page.read_text()):
        if kind.startswith("auto"):
            names.append((module, name))
        else:
            module = name
    return names


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_every_documented_name_exists(page):
    names = documented(page)
    assert names or page.stem == "index"
    for module, name in names:
        path = name if name.startswith("roletrust_") else f"{module}.{name}"
        try:
            import_module(path.rpartition(".")[0])
        except ModuleNotFoundError as error:
            if str(error.name).startswith("roletrust_"):
                raise
            continue  # its extra is not installed
        with suppress(DependencyNotInstalled):
            resolve_name(path)
