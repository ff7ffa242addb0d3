"""The pictures of the catalogue: trust models under the same attacks, and attacks on the same trust model."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import NamedTuple

from rich.progress import Progress

from roletrust_env import Game, JointPolicy, Scenario, make_scenario
from roletrust_env.evaluation.specs import parse_attacks
from roletrust_env.world.group import AgentGroup
from roletrust_experiments.commands.catalogue import Entry
from roletrust_experiments.commands.console import errors, progress_bar
from roletrust_experiments.commands.models import ATTACKS, ROUNDS, SCENARIO
from roletrust_experiments.plots.figure_files import write_figure
from roletrust_experiments.plots.models import in_words, panel_figure, play_panel

MODEL = "role-trust"
"""The trust model that every attack is shown on: the paper's."""

CARD = "4 of 10 raters bad-mouth"
"""The attack of `roletrust models` under which all trust models are shown side by side."""

GAMES = 8
"""Games of which a picture shows the mean."""

_RATERS, _PROVIDERS = {"sr_[0-3]": "4 of 10 raters"}, {"sp_[01]": "2 of 10 providers"}
_RESERVE = 3


class Picture(NamedTuple):
    """A picture of the catalogue.

    Attributes:
        file: its name, in the folder of pictures.
        title: what is drawn, in a few words.
        words: what it shows, for who cannot see it.
    """

    file: str
    title: str
    words: str


class Shown(NamedTuple):
    """How an attack is shown.

    Attributes:
        scenario: in which.
        texts: who attacks and how, as behind `--attack`.
        who: that is, in a few words.
    """

    scenario: Scenario
    texts: tuple[str, ...]
    who: str


def model_pictures(folder: Path, names: Iterable[str], *, quick: bool) -> dict[str, list[Picture]]:
    """Draw every trust model under the attacks of `roletrust models`.

    Args:
        folder: for the pictures.
        names: of the models.
        quick: draw one attack only.

    Returns:
        The pictures by model, the same attacks for each.
    """
    rules = make_scenario(SCENARIO).change(max_cycles=ROUNDS)
    titles = [CARD] if quick else list(ATTACKS)
    attacks = {title: parse_attacks(ATTACKS[title], rules) for title in titles}
    found: dict[str, list[Picture]] = {}
    with progress_bar(errors) as progress:
        for name in names:
            found[name] = []
            for title, policies in attacks.items():
                joint_policy, file = (
                    JointPolicy(Game(rules, name), policies),
                    f"{name}-{list(ATTACKS).index(title)}.svg",
                )
                words = _draw(folder / file, joint_policy, title, progress)
                found[name].append(Picture(file, title, f"Trust over time in {name}, {title}: {words}."))
    return found


def attack_pictures(folder: Path, entries: Mapping[str, Entry]) -> dict[str, Picture]:
    """Draw every attack on one trust model, by attack. See `how_shown`."""
    found = {}
    with progress_bar(errors) as progress:
        for name, entry in entries.items():
            shown, file = how_shown(name, entry), f"{name}.svg"
            joint_policy = JointPolicy(Game(shown.scenario, MODEL), parse_attacks(shown.texts, shown.scenario))
            words = _draw(folder / file, joint_policy, f"{name}: {shown.who}", progress)
            found[name] = Picture(file, shown.who, f"Trust over time in {MODEL} under {name} by {shown.who}: {words}.")
    return found


def how_shown(name: str, entry: Entry) -> Shown:
    """In which game an attack is shown and by whom: raters, providers, a ring, or a stranger with identities."""
    crowd = make_scenario(SCENARIO).change(max_cycles=ROUNDS)
    parameters, channels = entry["parameters"], set(entry["channels"] or ())
    if entry["channels"] is None:  # only what was learned knows what it does
        trio = make_scenario("paper-3x3").change(max_cycles=ROUNDS)
        return Shown(trio, (f"sp_2={name}:path=provider-3x3",), "1 of 3 providers")
    if "presence" in channels:
        stranger = AgentGroup(role="SP", reserve=_RESERVE)
        texts = (f"sp_10={name}:reserve={_RESERVE}",)
        return Shown(
            crowd.change(agents=(*crowd.agents, stranger)), texts, f"a provider with {_RESERVE} more identities"
        )
    who = {
        **(_RATERS if channels & {"ratings", "silence"} else {}),
        **(_PROVIDERS if channels & {"quality", "treatment"} else {}),
    }
    window = f":start={ROUNDS // 4},stop={3 * ROUNDS // 4}" if {"start", "stop"} <= set(parameters) else ""
    return Shown(crowd, tuple(f"{agents}={name}{window}" for agents in who), ", ".join(who.values()))


def _draw(path: Path, joint_policy: JointPolicy, title: str, progress: Progress) -> str:
    """Play and draw; what is to be seen, in words."""
    panel = play_panel(joint_policy, 0, progress, title, games=GAMES)
    write_figure(path, panel_figure(panel, title))
    return in_words(panel)
