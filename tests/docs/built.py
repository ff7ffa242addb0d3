"""The site as Sphinx has built it, and what is to be found on its pages."""

import os
import shutil
import subprocess
import sys
from functools import cache
from pathlib import Path
from urllib.parse import unquote, urlsplit

from bs4 import BeautifulSoup

HOUSE = Path(__file__).parents[2]
ROOTS = ("", "agents", "baselines", "experiments")
"""Folders that hold packages."""

WHOLE = HOUSE / "build" / "site"
"""Site of `make docs`."""


def build_quickly(folder: Path) -> Path:
    """Build all pages in a folder, with few pictures, and without running the tutorials; a warning is an error."""
    shutil.copytree(HOUSE / "docs", folder / "docs", ignore=shutil.ignore_patterns("reference"))
    for outside in HOUSE.glob("*.md"):  # of which pages show parts
        shutil.copy(outside, folder)
    for shown in ("experiments", "tests"):  # of which pages show files
        (folder / shown).symlink_to(HOUSE / shown)
    quick = ["-D", "site_quick=1", "-D", "nb_execution_mode=off"]
    command = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", *quick, "-d", str(folder / "doctrees")]
    done = subprocess.run(
        [*command, str(folder / "docs"), str(folder / "site")],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(str(HOUSE / root) for root in ROOTS)},
        cwd=HOUSE,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    return folder / "site"


def pages(site: Path) -> list[Path]:
    return sorted(path for path in site.rglob("*.html") if "_static" not in path.parts)


@cache
def parsed(page: Path) -> BeautifulSoup:
    return BeautifulSoup(page.read_text(encoding="utf-8"), "html.parser")


def text(page: Path) -> str:
    """What is to be read in the middle of a page, with single spaces."""
    article = parsed(page).find("article")
    return "" if article is None else " ".join(article.get_text(" ").split())


def targets(page: Path) -> list[str]:
    """All that a page leads to or is made of."""
    attributes = ("href", "src", "poster")
    return [tag[name] for name in attributes for tag in parsed(page).find_all(attrs={name: True})]


def broken(page: Path) -> list[str]:
    """Of these, what leads nowhere within the site."""
    return [target for target in targets(page) if not (urlsplit(target).scheme or _lands(page, target))]


def fetched(page: Path) -> list[str]:
    """What a browser would ask of others to show a page."""
    tags = [*parsed(page).find_all(src=True), *parsed(page).find_all("link", rel=["stylesheet", "preload", "icon"])]
    return [where for tag in tags if urlsplit(where := tag.get("src") or tag.get("href")).scheme not in ("", "data")]


def _lands(page: Path, target: str) -> bool:
    parts = urlsplit(target)
    file = (page.parent / unquote(parts.path)).resolve() if parts.path else page
    file = file / "index.html" if file.is_dir() else file
    if not file.is_file():
        return False
    if not parts.fragment or file.suffix != ".html":
        return True
    return parsed(file).find(id=unquote(parts.fragment)) is not None
