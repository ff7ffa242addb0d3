"""The pages that registries and commands write: Markdown from templates, in a folder that Sphinx
reads.
"""

import inspect
import re
import unicodedata
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import gymnasium
from jinja2 import Environment, FileSystemLoader, StrictUndefined
from pybtex.database import parse_file

from roletrust_env.envs.attack_env import TASKS, AttackEnv
from roletrust_env.envs.parallel import RoleTrustParallelEnv, parallel_env
from roletrust_env.game.policy import registry as attackers
from roletrust_env.storage.files import write_text
from roletrust_env.trust.model import registry as models
from roletrust_env.world.presets import registry as scenarios
from roletrust_experiments.catalogue import (
    Entry,
    all_attackers,
    all_models,
    all_scenarios,
    unfit,
    where_searched,
)
from site_pages.commands import everything, roletrust
from site_pages.pictures import CARD, GAMES, MODEL, Drawn, draw, file_name, how_shown
from site_pages.scenario_files import as_toml
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


def write_pages(folder: Path) -> None:
    """Write all pages and pictures. A page without changes is left alone, a page of a former name
    is removed.

    Args:
        folder: Folder of the pages, with nothing else in it; its parent has the bibliography.
    """
    trust_models, attacks = _readable(all_models()), _readable(all_attackers())
    drawn = draw(folder, trust_models, attacks)
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
    return {
        **pages,
        "environments/index.md": _page("environments.md", environments=found, films=drawn.films),
    }


def _models(entries: Mapping[str, Entry], drawn: Drawn, bibliography: Path) -> Pages:
    families: dict[str, list[str]] = {}
    for name, entry in entries.items():
        families.setdefault(entry["family"], []).append(name)
    shared = {
        "entries": entries,
        "pictures": drawn.models,
        "games": GAMES,
        "scenario": SCENARIO,
        "rounds": ROUNDS,
    }
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
    index = _page(
        "models.md", families=families, about_families=_FAMILIES, attack=CARD, cards=cards, **shared
    )
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
    return next(
        title
        for title, some in _CHANNELS.items()
        if channels <= some or channels & some == {"presence"}
    )


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


def _meaning(text: str) -> str:
    """Return what a docstring says of a parameter, without its range, which has a column of its
    own.
    """
    return re.sub(r",? in [\[(][^\])]+[\])]", "", text)


_TEMPLATES = Environment(
    loader=FileSystemLoader(Path(__file__).with_name("template")),
    undefined=StrictUndefined,
    trim_blocks=True,
    lstrip_blocks=True,
    keep_trailing_newline=True,
    autoescape=False,  # it is Markdown
)
_TEMPLATES.filters |= {
    "cell": _cell,
    "file_name": file_name,
    "meaning": _meaning,
    "unfit": unfit,
    "where_searched": where_searched,
}


def _page(template: str, **facts: Any) -> str:
    return _TEMPLATES.get_template(template).render(**facts)


_GAME = "RoleTrust-v0"


class Described(NamedTuple):
    """Facts on the page of an environment.

    Attributes:
        about: Docstring in Markdown without its first line.
        summary: First line of the docstring.
        class_path: Import path of the class.
        facts: Code by its label, such as a space or the call that makes the environment.
    """

    about: str
    summary: str
    class_path: str
    facts: Mapping[str, str]


def described() -> dict[str, Described]:
    """Return the facts of every environment by its id."""
    game = parallel_env()
    spaces = {
        f"Action space of {agent}": repr(game.action_space(agent)) for agent in ("sp_0", "sr_0")
    }
    spaces |= {
        f"Observation space of {agent}": repr(game.observation_space(agent))
        for agent in ("sp_0", "sr_0")
    }
    made = {
        "All at once": "roletrust_env.parallel_env()",
        "Agent by agent": "roletrust_env.env()",
        "By name": f'pettingzoo.make("parallel", "{_GAME}")',
    }
    return {
        _GAME: _described(RoleTrustParallelEnv, {**made, **spaces}),
        **{name: _task(name) for name in TASKS},
    }


def attack_tasks() -> Described:
    """Return the facts that all attack tasks have in common."""
    return _described(AttackEnv, {})


def _task(identity: str) -> Described:
    task = gymnasium.make(identity)
    facts = {
        "One game": f'gymnasium.make("{identity}")',
        "A batch": f'gymnasium.make_vec("{identity}", num_envs=1024)',
        "Action space": repr(task.action_space),
        "Observation space": repr(task.observation_space),
        "Rounds": str(task.spec.max_episode_steps if task.spec else None),
    }
    return _described(TASKS[identity], facts)


def _described(environment: type[Any], facts: Mapping[str, str]) -> Described:
    summary, _, about = (inspect.getdoc(environment) or "").partition("\n\n")
    path = f"{environment.__module__}.{environment.__qualname__}"
    return Described(_linked(about), summary, path, facts)


def _linked(text: str) -> str:
    """Return Markdown in which names of the library in backticks are links."""
    return re.sub(r"(?<!`)`(?=[\w.]*[A-Z._])([A-Za-z][\w.]*)`(?!`)", r"{py:obj}`\1`", text)


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
