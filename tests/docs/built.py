"""The site as Sphinx has built it, and what is to be found on its pages."""

from functools import cache
from pathlib import Path
from urllib.parse import unquote, urlsplit

from bs4 import BeautifulSoup

HOUSE = Path(__file__).parents[2]
WHOLE = HOUSE / "build" / "site"
"""Site of `make docs`."""


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
    return [
        target for target in targets(page) if not (urlsplit(target).scheme or _lands(page, target))
    ]


def fetched(page: Path) -> list[str]:
    """What a browser would ask of others to show a page."""
    tags = [
        *parsed(page).find_all(src=True),
        *parsed(page).find_all("link", rel=["stylesheet", "preload", "icon"]),
    ]
    return [
        where
        for tag in tags
        if urlsplit(where := tag.get("src") or tag.get("href")).scheme not in ("", "data")
    ]


def _lands(page: Path, target: str) -> bool:
    parts = urlsplit(target)
    file = (page.parent / unquote(parts.path)).resolve() if parts.path else page
    file = file / "index.html" if file.is_dir() else file
    if not file.is_file():
        return False
    if not parts.fragment or file.suffix != ".html":
        return True
    return parsed(file).find(id=unquote(parts.fragment)) is not None
