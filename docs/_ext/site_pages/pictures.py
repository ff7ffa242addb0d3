"""The pictures of all pages, drawn again only when the source that draws them changes.

They show trust models under the same attacks, attacks on the same trust model, and a game of each
environment.
"""

import hashlib
import shlex
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from pydantic import TypeAdapter, ValidationError

from roletrust_env import Game, JointPolicy, Scenario, make_scenario
from roletrust_env.evaluation.games import attacks_in_words
from roletrust_env.evaluation.specs import parse_attacks, parse_settings, with_settings
from roletrust_env.storage.files import prepare_folder, write_text
from roletrust_experiments.catalogue import Entry
from roletrust_experiments.commands.console import errors, progress_bar
from roletrust_experiments.plots.figure_files import write_figure
from roletrust_experiments.plots.style import ATTACKED, INK
from roletrust_experiments.plots.video import write_video
from studies.models import (
    ATTACKS,
    ROUNDS,
    SCENARIO,
    WORDS,
    Panel,
    draw_panel,
    legend_keys,
    play_panel,
)

MODEL = "role-trust"
"""Trust model that every attack is shown on: the paper's."""

CARD = "4 of 10 raters bad-mouth"
"""Attack of `python -m studies models` under which all trust models are shown side by side."""

GAMES = 8
"""Number of games; a picture shows their mean."""

_RATERS, _PROVIDERS = {"sr_[0-3]": "4 of 10 raters"}, {"sp_[01]": "2 of 10 providers"}
_RESERVE = 3
_STRANGER = (
    'agents=[{role="SR", count=10, noise=0.005}, {role="SP", count=10}, {role="SP", reserve=3}]'
)
"""The agents of the crowd, and a provider with further identities."""

STAGED: Mapping[str, tuple[str, tuple[str, ...]]] = {
    "RoleTrust-v0": ("paper-3x3", ("sr_2=bad-mouthing:level=0,start=20",)),
    "RoleTrust/ProviderAttack-v0": ("paper-3x3", ("sp_2=on-off:period=5,duty=0.4,start=20",)),
    "RoleTrust/RaterAttack-v0": ("paper-3x3", ("sr_2=bad-mouthing:level=0.5,start=20",)),
    "RoleTrust/DualAttack-v0": ("peers", ("srsp_5=collusion:start=20",)),
    "RoleTrust/CollusionAttack-v0": (
        "crowd-10x10",
        ("sr_[89]=collusion:start=20", "sp_9=collusion:start=20"),
    ),
}
"""The filmed game of each environment by its id: scenario and attackers, with a script in place of
the learner."""

_FILM_ROUNDS = 80
_REPOSITORY = Path(__file__).parents[3]
_DRAWN_BY = ("roletrust_env", "agents", "baselines", "experiments", "docs/_ext")


class Picture(NamedTuple):
    """A picture of the catalogue.

    Attributes:
        file: Name of the file in the folder of pictures.
        title: Title in a few words.
        words: Description for readers who cannot see it.
    """

    file: str
    title: str
    words: str


class Shown(NamedTuple):
    """A game in which an attack is shown.

    Attributes:
        preset: Name of the scenario.
        settings: Changes of the scenario, as after `--set`.
        texts: Attackers, as after `--attack`.
        who: Attackers in a few words.
    """

    preset: str
    settings: tuple[str, ...]
    texts: tuple[str, ...]
    who: str

    @property
    def scenario(self) -> Scenario:
        """The scenario with its changes."""
        return with_settings(make_scenario(self.preset), parse_settings(self.settings))

    @property
    def command(self) -> str:
        """The command that plays these games."""
        options = [("--set", text) for text in self.settings] + [
            ("--attack", text) for text in self.texts
        ]
        lines = (f"{name} {shlex.quote(text)}" for name, text in options)
        return " \\\n    ".join([f"roletrust play {self.preset} --games {GAMES}", *lines])


class Film(NamedTuple):
    """A film on a page.

    Attributes:
        name: Name of the film and of its last picture, without `.mp4` and `.png`.
        words: Description for readers who cannot see it.
    """

    name: str
    words: str


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


def draw(folder: Path, models: Mapping[str, Entry], attacks: Mapping[str, Entry]) -> Drawn:
    """Return all pictures; draw those that are missing or out of date.

    Args:
        folder: Parent of the folders of pictures.
        models: Trust models of the catalogue.
        attacks: Attacks of the catalogue.
    """
    kept, reader, source = folder / "drawn.json", TypeAdapter(Drawn), _source(*models, *attacks)
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
        model_pictures(folder / "models", models),
        attack_pictures(folder / "attacks", attacks),
        films(folder / "films"),
    )
    write_text(kept, reader.dump_json(drawn, indent=1).decode())
    return drawn


def _source(*names: str) -> str:
    """Return a digest of the code that plays and draws, and of the names of what is drawn."""
    digest = hashlib.sha256("\n".join(names).encode())
    for path in sorted(path for part in _DRAWN_BY for path in (_REPOSITORY / part).rglob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()


def model_pictures(folder: Path, names: Iterable[str]) -> dict[str, list[Picture]]:
    """Draw every trust model under the attacks of `python -m studies models`.

    Args:
        folder: Folder of the pictures.
        names: Names of the models.

    Returns:
        Pictures by model, the same attacks for each.
    """
    rules = make_scenario(SCENARIO).change(max_cycles=ROUNDS)
    attacks = {title: parse_attacks(texts, rules) for title, texts in ATTACKS.items()}
    found: dict[str, list[Picture]] = {}
    for name in names:
        found[name] = []
        for title, policies in attacks.items():
            file = f"{name}-{list(ATTACKS).index(title)}.svg"
            words = _draw(folder / file, JointPolicy(Game(rules, name), policies), title)
            found[name].append(
                Picture(file, title, f"Trust over time in {name}, {title}: {words}.")
            )
    return found


def attack_pictures(folder: Path, entries: Mapping[str, Entry]) -> dict[str, Picture]:
    """Draw every attack on one trust model, by attack. See `how_shown`."""
    found = {}
    for name, entry in entries.items():
        shown, file = how_shown(name, entry), f"{name}.svg"
        joint_policy = JointPolicy(
            Game(shown.scenario, MODEL), parse_attacks(shown.texts, shown.scenario)
        )
        words = _draw(folder / file, joint_policy, name)
        found[name] = Picture(
            file, shown.who, f"Trust over time in {MODEL} under {name} by {shown.who}: {words}."
        )
    return found


def how_shown(name: str, entry: Entry) -> Shown:
    """Return the game that shows an attack: raters, providers, both as a ring, or a provider with
    identities attack.
    """
    rounds = f"max_cycles={ROUNDS}"
    parameters, channels = entry["parameters"], set(entry["channels"] or ())
    if entry["channels"] is None:  # only the file of a trained attacker says what it does
        return Shown(
            "paper-3x3", (rounds,), (f"sp_2={name}:path=provider-3x3",), "1 of 3 providers"
        )
    if "presence" in channels:
        texts = (f"sp_10={name}:reserve={_RESERVE}",)
        return Shown(
            SCENARIO, (rounds, _STRANGER), texts, f"a provider with {_RESERVE} more identities"
        )
    who = {
        **(_RATERS if channels & {"ratings", "silence"} else {}),
        **(_PROVIDERS if channels & {"quality", "treatment"} else {}),
    }
    window = (
        f":start={ROUNDS // 4},stop={3 * ROUNDS // 4}"
        if {"start", "stop"} <= set(parameters)
        else ""
    )
    return Shown(
        SCENARIO,
        (rounds,),
        tuple(f"{agents}={name}{window}" for agents in who),
        ", ".join(who.values()),
    )


def _draw(path: Path, joint_policy: JointPolicy, title: str) -> str:
    """Play and draw; return the description of the picture."""
    panel = play_panel(joint_policy, 0, games=GAMES)
    write_figure(path, _panel_figure(panel, title))
    return _in_words(panel)


def _panel_figure(panel: Panel, title: str) -> Figure:
    """One panel by itself, small."""
    figure = Figure(figsize=(3.6, 2.7), layout="constrained")
    axes = figure.subplots()
    draw_panel(axes, panel)
    axes.set_title(title, color=INK, fontsize=10)
    axes.set_xlabel("time (s)", color=INK, fontsize=9)
    axes.set_ylabel("trust", color=INK, fontsize=9)
    keys = [*legend_keys([panel]), Patch(facecolor=ATTACKED, label="during the attack")]
    figure.legend(
        handles=keys, loc="outside lower center", ncols=2, frameon=False, fontsize=8, labelcolor=INK
    )
    return figure


def _in_words(panel: Panel) -> str:
    """Return the description of a panel for readers who cannot see it."""
    start, stop = (
        int(np.searchsorted(panel.time_s, second, side="right")) for second in panel.attacked
    )
    told = []
    for (trust, whose), values in panel.lines.items():
        before, meanwhile = values[max(start - 1, 0)], values[start:stop]
        there = meanwhile[
            ~np.isnan(meanwhile)
        ]  # none in a round in which all such agents have left
        during = f"{there.min():.2f} to {there.max():.2f} in it" if len(there) else "absent in it"
        told.append(f"{trust} of {WORDS[trust, whose]} {before:.2f} before, {during}")
    return (
        f"the attack lasts from {panel.attacked[0]:g} s to {panel.attacked[1]:g} s; "
        f"{', '.join(told)}"
    )


def films(folder: Path) -> dict[str, Film]:
    """Film a game of each environment.

    Args:
        folder: Folder of the films.

    Returns:
        Films by the id of the environment.
    """
    found = {}
    with progress_bar(errors) as progress:
        for identity, (preset, attacks) in STAGED.items():
            rules = make_scenario(preset).change(max_cycles=_FILM_ROUNDS)
            policies, name = parse_attacks(attacks, rules), file_name(identity)
            write_video(folder / f"{name}.mp4", JointPolicy(Game(rules), policies), 0, progress)
            attack = f"{attacks_in_words(policies)} by {', '.join(policies)}, marked"
            words = f"A game of {identity} in {rules.name}: {attack}; all other agents are honest."
            found[identity] = Film(name, words)
    return found


def file_name(identity: str) -> str:
    """Return the file name of an environment's id.

    Example:
        >>> file_name("RoleTrust/RaterAttack-v0")
        'rater-attack-v0'
    """
    last = identity.rpartition("/")[2]
    return "".join(f"-{c.lower()}" if c.isupper() else c for c in last).lstrip("-")
