"""The pages that registries and commands write: Markdown from templates, in a folder that Sphinx reads."""

import inspect
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

from roletrust_env.game.policy import registry as attackers
from roletrust_env.storage.files import write_text
from roletrust_env.storage.scenario_files import as_toml
from roletrust_env.trust.model import registry as models
from roletrust_env.world.presets import registry as scenarios
from roletrust_experiments.commands.catalogue import (
    Entry,
    all_attackers,
    all_models,
    all_scenarios,
    unfit,
    where_searched,
)
from roletrust_experiments.site.commands import everything, roletrust
from roletrust_experiments.site.drawn import Drawn, draw
from roletrust_experiments.site.environments import attack_tasks, described
from roletrust_experiments.site.films import file_name
from roletrust_experiments.site.pictures import CARD, GAMES, MODEL, how_shown
from roletrust_experiments.site.references import cited
from studies.models import ROUNDS, SCENARIO

Pages = dict[str, str]
"""Text of each page by the path of its file."""

_FAMILIES = {
    "central": "They see all ratings, as a manager does.",
    "personal": "Every rater is a judge; the mean of the judges is published.",
}
_CHANNELS = {
    "By services": {"quality", "treatment"},
    "By ratings": {"ratings", "silence"},
    "By both, as a ring": {"quality", "treatment", "ratings", "silence"},
    "By further identities": {"presence"},
}


def write_pages(folder: Path, *, quick: bool) -> None:
    """Write all pages and pictures. A page without changes is left alone, a page of a former name is removed.

    Args:
        folder: Folder of the pages, with nothing else in it; its parent has the bibliography.
        quick: Whether to draw fewer pictures and shorter films.
    """
    trust_models, attacks = _readable(all_models()), _readable(all_attackers())
    drawn = draw(folder, trust_models, attacks, quick=quick)
    bibliography = folder.parent / "references.bib"
    pages = {
        **_environments(drawn),
        **_models(trust_models, drawn, bibliography),
        **_attackers(attacks, drawn, bibliography),
        **_scenarios(_readable(all_scenarios())),
        **_commands(),
    }
    for old in folder.rglob("*.md"):
        if str(old.relative_to(folder)) not in pages:
            old.unlink()
    for name, text in pages.items():
        path = folder / name
        if not path.is_file() or path.read_text(encoding="utf-8") != text:
            path.parent.mkdir(parents=True, exist_ok=True)
            write_text(path, text)


def _environments(drawn: Drawn) -> Pages:
    found, common = described(), attack_tasks()
    pages = {
        f"environments/{file_name(identity)}.md": _page(
            "environment.md", identity=identity, environment=environment, film=drawn.films[identity]
        )
        for identity, environment in found.items()
    }
    pages["environments/attack-tasks.md"] = _page(
        "environment.md", identity="Attack tasks", environment=common, film=None
    )
    return {**pages, "environments/index.md": _page("environments.md", environments=found, films=drawn.films)}


def _models(entries: Mapping[str, Entry], drawn: Drawn, bibliography: Path) -> Pages:
    families: dict[str, list[str]] = {}
    for name, entry in entries.items():
        families.setdefault(entry["family"], []).append(name)
    shared = {"entries": entries, "pictures": drawn.models, "games": GAMES, "scenario": SCENARIO, "rounds": ROUNDS}
    pages = {
        f"models/{name}.md": _page(
            "model.md",
            name=name,
            entry=entry,
            code=_code(models.factory(name)),
            sources=cited(entry["source"] or "", bibliography),
            **shared,
        )
        for name, entry in entries.items()
    }
    cards = {name: next(one for one in drawn.models[name] if one.title == CARD) for name in entries}
    index = _page("models.md", families=families, about_families=_FAMILIES, attack=CARD, cards=cards, **shared)
    return {**pages, "models/index.md": index}


def _attackers(entries: Mapping[str, Entry], drawn: Drawn, bibliography: Path) -> Pages:
    groups: dict[str, list[str]] = {title: [] for title in (*_CHANNELS, "Learned")}
    for name, entry in entries.items():
        groups[_group(set(entry["channels"] or ()))].append(name)
    shared = {"entries": entries, "pictures": drawn.attacks, "model": MODEL, "games": GAMES}
    pages = {
        f"attacks/{name}.md": _page(
            "attack.md",
            name=name,
            entry=entry,
            shown=how_shown(name, entry),
            code=_code(attackers.factory(name)),
            sources=cited(inspect.getdoc(attackers.factory(name)) or "", bibliography),
            **shared,
        )
        for name, entry in entries.items()
    }
    return {**pages, "attacks/index.md": _page("attacks.md", groups=groups, **shared)}


def _group(channels: set[str]) -> str:
    """Return the first kind of attack that has all of the action channels."""
    if not channels:
        return "Learned"
    return next(title for title, some in _CHANNELS.items() if channels <= some or channels & some == {"presence"})


def _scenarios(entries: Mapping[str, Entry]) -> Pages:
    files = {name: as_toml(scenarios.make(name)) for name in entries}
    return {"scenarios.md": _page("scenarios.md", entries=entries, files=files)}


def _commands() -> Pages:
    whole = roletrust()
    pages = {
        f"commands/{command.words[-1]}.md": _page("command.md", parts=list(everything(command)))
        for command in whole.commands
    }
    return {**pages, "commands/index.md": _page("commands.md", whole=whole)}


def _readable(entries: Mapping[str, Entry]) -> dict[str, Entry]:
    """Leave out entries of other packages that cannot be loaded; `roletrust list` shows them."""
    return {name: entry for name, entry in entries.items() if "error" not in entry}


def _code(factory: Callable[..., Any]) -> str:
    """Return the directive of autodoc for a factory."""
    kind = "autoclass" if isinstance(factory, type) else "autofunction"
    return f".. {kind}:: {factory.__module__}.{factory.__qualname__}"


def _cell(text: object) -> str:
    """Return a text for a cell of a table."""
    return re.sub(r"\s+", " ", str(text)).replace("|", "\\|")


_TEMPLATES = Environment(
    loader=PackageLoader("roletrust_experiments.site", "template"),
    undefined=StrictUndefined,
    trim_blocks=True,
    lstrip_blocks=True,
    keep_trailing_newline=True,
    autoescape=False,  # it is Markdown
)
_TEMPLATES.filters |= {"cell": _cell, "file_name": file_name, "unfit": unfit, "where_searched": where_searched}


def _page(template: str, **facts: Any) -> str:
    return _TEMPLATES.get_template(template).render(**facts)
