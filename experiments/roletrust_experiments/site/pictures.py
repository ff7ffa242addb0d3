"""The pictures of the catalogue: trust models under the same attacks, and attacks on the same trust model."""

import shlex
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import NamedTuple

from roletrust_env import Game, JointPolicy, Scenario, make_scenario
from roletrust_env.evaluation.specs import parse_attacks, parse_settings, with_settings
from roletrust_experiments.commands.catalogue import Entry
from roletrust_experiments.plots.figure_files import write_figure
from studies.models import ATTACKS, ROUNDS, SCENARIO, in_words, panel_figure, play_panel

MODEL = "role-trust"
"""Trust model that every attack is shown on: the paper's."""

CARD = "4 of 10 raters bad-mouth"
"""Attack of `python -m studies.models` under which all trust models are shown side by side."""

GAMES = 8
"""Number of games; a picture shows their mean."""

_RATERS, _PROVIDERS = {"sr_[0-3]": "4 of 10 raters"}, {"sp_[01]": "2 of 10 providers"}
_RESERVE = 3
_STRANGER = 'agents=[{role="SR", count=10, noise=0.005}, {role="SP", count=10}, {role="SP", reserve=3}]'
"""The agents of the crowd, and a provider with further identities."""


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
        options = [("--set", text) for text in self.settings] + [("--attack", text) for text in self.texts]
        lines = [
            f"roletrust play {self.preset} --games {GAMES}",
            *(f"{name} {shlex.quote(text)}" for name, text in options),
        ]
        return " \\\n    ".join(lines)


def model_pictures(folder: Path, names: Iterable[str], *, quick: bool) -> dict[str, list[Picture]]:
    """Draw every trust model under the attacks of `python -m studies.models`.

    Args:
        folder: Folder of the pictures.
        names: Names of the models.
        quick: Whether to draw one attack only.

    Returns:
        Pictures by model, the same attacks for each.
    """
    rules = make_scenario(SCENARIO).change(max_cycles=ROUNDS)
    titles = [CARD] if quick else list(ATTACKS)
    attacks = {title: parse_attacks(ATTACKS[title], rules) for title in titles}
    found: dict[str, list[Picture]] = {}
    for name in names:
        found[name] = []
        for title, policies in attacks.items():
            joint_policy, file = (
                JointPolicy(Game(rules, name), policies),
                f"{name}-{list(ATTACKS).index(title)}.svg",
            )
            words = _draw(folder / file, joint_policy, title)
            found[name].append(Picture(file, title, f"Trust over time in {name}, {title}: {words}."))
    return found


def attack_pictures(folder: Path, entries: Mapping[str, Entry]) -> dict[str, Picture]:
    """Draw every attack on one trust model, by attack. See `how_shown`."""
    found = {}
    for name, entry in entries.items():
        shown, file = how_shown(name, entry), f"{name}.svg"
        joint_policy = JointPolicy(Game(shown.scenario, MODEL), parse_attacks(shown.texts, shown.scenario))
        words = _draw(folder / file, joint_policy, name)
        found[name] = Picture(file, shown.who, f"Trust over time in {MODEL} under {name} by {shown.who}: {words}.")
    return found


def how_shown(name: str, entry: Entry) -> Shown:
    """Return the game that shows an attack: raters, providers, both as a ring, or a provider with identities attack."""
    rounds = f"max_cycles={ROUNDS}"
    parameters, channels = entry["parameters"], set(entry["channels"] or ())
    if entry["channels"] is None:  # only the file of a trained attacker says what it does
        return Shown("paper-3x3", (rounds,), (f"sp_2={name}:path=provider-3x3",), "1 of 3 providers")
    if "presence" in channels:
        texts = (f"sp_10={name}:reserve={_RESERVE}",)
        return Shown(SCENARIO, (rounds, _STRANGER), texts, f"a provider with {_RESERVE} more identities")
    who = {
        **(_RATERS if channels & {"ratings", "silence"} else {}),
        **(_PROVIDERS if channels & {"quality", "treatment"} else {}),
    }
    window = f":start={ROUNDS // 4},stop={3 * ROUNDS // 4}" if {"start", "stop"} <= set(parameters) else ""
    return Shown(SCENARIO, (rounds,), tuple(f"{agents}={name}{window}" for agents in who), ", ".join(who.values()))


def _draw(path: Path, joint_policy: JointPolicy, title: str) -> str:
    """Play and draw; return the description of the picture."""
    panel = play_panel(joint_policy, 0, games=GAMES)
    write_figure(path, panel_figure(panel, title))
    return in_words(panel)
