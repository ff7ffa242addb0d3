"""The pictures of all pages, drawn again only when the source that draws them changes."""

import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from pydantic import TypeAdapter, ValidationError

from roletrust_env.storage.files import prepare_folder, write_text
from roletrust_experiments.commands.catalogue import Entry
from roletrust_experiments.site.films import Film, films
from roletrust_experiments.site.pictures import Picture, attack_pictures, model_pictures

_REPOSITORY = Path(__file__).parents[3]
_DRAWN_BY = ("roletrust_env", "agents", "baselines", "experiments")


class Drawn(NamedTuple):
    """The pictures and films of the pages.

    Attributes:
        source: Digest of the code that drew them.
        models: Pictures by trust model, in the folder `models`.
        attacks: Picture by attack, in the folder `attacks`.
        films: Film by environment, in the folder `films`.
    """

    source: str
    models: dict[str, list[Picture]]
    attacks: dict[str, Picture]
    films: dict[str, Film]


def draw(folder: Path, models: Mapping[str, Entry], attacks: Mapping[str, Entry], *, quick: bool) -> Drawn:
    """Return all pictures; draw those that are missing or out of date.

    Args:
        folder: Parent of the folders of pictures.
        models: Trust models of the catalogue.
        attacks: Attacks of the catalogue.
        quick: Whether to draw fewer pictures and shorter films.
    """
    kept, reader, source = folder / "drawn.json", TypeAdapter(Drawn), _source(*models, *attacks, str(quick))
    try:
        found = reader.validate_json(kept.read_bytes())
    except (OSError, ValidationError):
        found = None
    if found is not None and found.source == source:
        return found
    for part in ("models", "attacks", "films"):
        prepare_folder(folder / part)
    drawn = Drawn(
        source,
        model_pictures(folder / "models", models, quick=quick),
        attack_pictures(folder / "attacks", attacks),
        films(folder / "films", quick=quick),
    )
    write_text(kept, reader.dump_json(drawn, indent=1).decode())
    return drawn


def _source(*names: str) -> str:
    """Return a digest of the code that plays and draws, and of the names of what is drawn."""
    digest = hashlib.sha256("\n".join(names).encode())
    for path in sorted(path for part in _DRAWN_BY for path in (_REPOSITORY / part).rglob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()
