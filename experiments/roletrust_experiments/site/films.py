"""A film of a game for each environment."""

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from roletrust_env import Game, make_scenario
from roletrust_env.evaluation.specs import parse_attacks
from roletrust_experiments.commands.console import errors, progress_bar
from roletrust_experiments.playing.names import attacks_in_words
from roletrust_experiments.plots.video import write_video

_ROUNDS = 80


class Film(NamedTuple):
    """A film on a page.

    Attributes:
        name: Name of the film and of its last picture, without `.mp4` and `.png`.
        words: Description for readers who cannot see it.
    """

    name: str
    words: str


class Staged(NamedTuple):
    """A game that is filmed: a scenario, and the attackers as after `--attack`."""

    scenario: str
    attacks: tuple[str, ...]


STAGED: Mapping[str, Staged] = {
    "RoleTrust-v0": Staged("paper-3x3", ("sr_2=bad-mouthing:level=0,start=20",)),
    "RoleTrust/ProviderAttack-v0": Staged("paper-3x3", ("sp_2=on-off:period=5,duty=0.4,start=20",)),
    "RoleTrust/RaterAttack-v0": Staged("paper-3x3", ("sr_2=bad-mouthing:level=0.5,start=20",)),
    "RoleTrust/DualAttack-v0": Staged("peers", ("srsp_5=collusion:start=20",)),
    "RoleTrust/CollusionAttack-v0": Staged("crowd-10x10", ("sr_[89]=collusion:start=20", "sp_9=collusion:start=20")),
}
"""The filmed game of each environment by its id: its default scenario, with a script in place of the learner."""


def films(folder: Path, *, quick: bool) -> dict[str, Film]:
    """Film a game of each environment.

    Args:
        folder: Folder of the films.
        quick: Whether to film two rounds only.

    Returns:
        Films by the id of the environment.
    """
    found = {}
    with progress_bar(errors) as progress:
        for identity, staged in STAGED.items():
            rules = make_scenario(staged.scenario).change(max_cycles=2 if quick else _ROUNDS)
            policies = parse_attacks(staged.attacks, rules)
            name = file_name(identity)
            write_video(folder / f"{name}.mp4", Game(rules), policies, 0, progress)
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
