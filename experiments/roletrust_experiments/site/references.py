"""The bibliography: which of its entries a text cites."""

import re
import unicodedata
from functools import cache
from pathlib import Path

from pybtex.database import parse_file

_SPECIAL = str.maketrans({"ø": "o", "Ø": "O"})
_REST = r"(?:et al\.|[^.;:]|\.(?! [A-Z])){0,200}?"  # up to the year, within the sentence
_COAUTHOR = re.compile(r"[A-Z][\w-]+(?:,| and) $")


@cache
def _entries(path: Path) -> dict[str, tuple[str, str]]:
    """Return the last name of the first author and the year of each entry by its key."""
    data = parse_file(str(path))
    return {
        key: (" ".join(entry.persons["author"][0].last_names), entry.fields["year"])
        for key, entry in data.entries.items()
    }


def cited(text: str, path: Path) -> list[str]:
    """Return the keys of the entries that a text cites, in the order of the text.

    A citation is the last name of the first author and, in the same sentence, the year.

    Args:
        text: Text such as a docstring.
        path: BibTeX file.
    """
    plain = _ascii(" ".join(text.split()))
    found: dict[str, int] = {}
    for key, (name, year) in _entries(path).items():
        for match in re.finditer(rf"\b{re.escape(_ascii(name))}\b{_REST}\b{year}\b", plain):
            if not _COAUTHOR.search(plain[: match.start()]):
                found.setdefault(key, match.start())
    return sorted(found, key=found.__getitem__)


def _ascii(text: str) -> str:
    """Return a text without accents."""
    letters = unicodedata.normalize("NFKD", text.translate(_SPECIAL))
    return letters.encode("ascii", "ignore").decode()
