"""The rooms of the house: who imports whom, as `pyproject.toml` has it and as the documentation
draws it."""

import re
import subprocess
import sys
from functools import cache
from pathlib import Path

import grimp

HOUSE = Path(__file__).parent.parent
FOLDERS = {  # by the name of the package
    "roletrust_env": HOUSE / "roletrust_env",
    "roletrust_agents": HOUSE / "agents" / "roletrust_agents",
    "roletrust_baselines": HOUSE / "baselines" / "roletrust_baselines",
    "roletrust_experiments": HOUSE / "experiments" / "roletrust_experiments",
    "studies": HOUSE / "experiments" / "studies",
}
PAGE = (HOUSE / "docs/how/structure.md").read_text(encoding="utf-8")
LONGEST = 600


@cache
def arrows() -> dict[str, set[str]]:
    """Which room imports from which other; what a folder's `__init__` hands on is nobody's
    import."""
    graph = grimp.build_graph(*FOLDERS)
    found: dict[str, set[str]] = {}
    for importer in graph.modules:
        for imported in graph.find_modules_directly_imported_by(importer):
            above, below = room(importer), room(imported)
            if not {importer, imported} & FOLDERS.keys() and above != below:
                found.setdefault(above, set()).add(below)
    return found


def room(module: str) -> str:
    """The room of a module: a folder, a file beside folders, or the small files of the library,
    which are one.

    The rooms of the other packages are called after the folder at the top, such as
    `agents/learned`; studies are one.
    """
    package, *below = module.split(".")[:2]
    if package == "studies":
        return package
    name = "/".join(
        [package if package == "roletrust_env" else package.removeprefix("roletrust_"), *below]
    )
    if FOLDERS[package].joinpath(*below).is_dir():
        return name
    return package if package == "roletrust_env" else f"{name}.py"


def reduced(arrows: dict[str, set[str]]) -> set[tuple[str, str]]:
    """The arrows that no longer way around replaces."""

    def reach(start: str) -> set[str]:
        direct = arrows.get(start, set())
        return direct.union(*map(reach, direct))

    return {
        (a, b)
        for a, below in arrows.items()
        for b in below
        if not any(b in reach(c) for c in below - {b})
    }


def drawn() -> set[tuple[str, str]]:
    """The arrows of the picture."""
    picture = re.search(r"```mermaid\n(.*?)```", PAGE, flags=re.DOTALL)
    assert picture is not None
    return set(re.findall(r"^ *([\w/.]+) --> ([\w/.]+)$", picture[1], flags=re.MULTILINE))


def test_imports_go_down_only_and_in_no_circle():
    found = subprocess.run(
        [
            sys.executable,
            "-c",
            "from importlinter.cli import lint_imports; raise SystemExit(lint_imports())",
        ],
        cwd=HOUSE,
        capture_output=True,
        text=True,
    )
    assert found.returncode == 0, found.stdout


def test_the_picture_of_the_rooms_is_that_of_the_imports():
    assert drawn() == reduced(arrows())


def test_the_tree_names_every_room():
    tree = re.search(r"```text\n(.*?)```", PAGE, flags=re.DOTALL)
    assert tree is not None
    for name in sorted(set(arrows()) | {below for found in arrows().values() for below in found}):
        assert name.rpartition("/")[2].removesuffix(".py") in tree[1]


def test_every_file_is_read_in_one_sitting():
    for folder in (*FOLDERS.values(), HOUSE / "tests"):
        lengths = {path: len(path.read_text().splitlines()) for path in folder.rglob("*.py")}
        assert lengths
        assert {path.name: n for path, n in lengths.items() if n > LONGEST} == {}
