"""One game of an attack, round by round: what it does, what becomes of trust, and what it gains."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from roletrust_env.evaluation.attackers import Scripted
from roletrust_env.evaluation.measurement import HELD_OUT, TaskArguments, exact_task, judged_rollout, random_sources
from roletrust_env.evaluation.search import MeasuredSearch
from roletrust_env.game.attack_task import AttackTask
from roletrust_env.game.state import Actions

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Trajectory:
    """The record of T rounds of one held-out game.

    Attributes:
        name: of the rung.
        quality: that each compromised provider chose, by its name, (T,); its identities, too, where they can be called.
        ratings: that each compromised rater gave the honest providers, by its name, (T, H); NaN where none was due.
        own: trust of each compromised agent, by `"ToR of sr_0"` and the like, (T,).
        mine: mean trust of the compromised agents, by `"ToR"` and `"ToP"`, (T,), as far as there are such agents.
        honest: the same of the honest ones.
        objective: of each round, (T,).
        cost: of each round, unweighted, (T,).
        price: what a unit of cost takes off the score.
    """

    name: str
    quality: dict[str, Floats]
    ratings: dict[str, Floats]
    own: dict[str, Floats]
    mine: dict[str, Floats]
    honest: dict[str, Floats]
    objective: Floats
    cost: Floats
    price: float

    header: ClassVar[tuple[str, ...]] = ("attack", "round", "quantity", "value")

    def lines(self) -> Iterator[tuple[str, int, str, float]]:
        """Yield the rows of a table, one for each round and quantity; ratings are means over the honest providers."""
        columns = {
            **{f"quality of {name}": values for name, values in self.quality.items()},
            **{f"mean rating by {name}": values.mean(axis=1) for name, values in self.ratings.items()},
            **self.own,
            **{f"{trust} compromised": values for trust, values in self.mine.items()},
            **{f"{trust} honest": values for trust, values in self.honest.items()},
            "objective": self.objective,
            "cost": self.cost,
        }
        for quantity, values in columns.items():
            for round, value in enumerate(values.tolist()):
                yield self.name, round, quantity, value


def watch(arguments: TaskArguments, finding: MeasuredSearch, seed: int, called: str | None = None) -> Trajectory:
    """Play one held-out game of what a rung found in the run with a seed; it is called by the rung or by a name."""
    task = exact_task(arguments)
    roster, bad = task.game.roster, {*task.identities, *task.joint_policy.attackers}
    rounds = list(judged_rollout(task, finding.attacker, (1, 1), *random_sources(task, seed, HELD_OUT)))
    trust = [task.game.published(played.round.state) for played in rounds]
    tor, top = (np.stack([pair[k][:, 0, 0] for pair in trust]) for k in range(2))
    victims = [i for i, name in enumerate(roster.provider_names) if name not in bad]
    # Only policies decide on identities in reserve; an action of the task does not.
    names = task.identities if isinstance(finding.attacker, Scripted) else task.compromised
    chosen = [_chosen(task, names, played.round.actions) for played in rounds]
    quality = {name: np.stack([values[name] for values, _ in chosen]) for name in chosen[0][0]}
    ratings = {name: np.stack([values[name] for _, values in chosen])[:, victims] for name in chosen[0][1]}
    for given in ratings.values():
        given[0] = np.nan  # nothing has been served yet
    shown = [name for name in task.identities if name in quality or name in ratings]
    own: dict[str, Floats] = {}
    mine: dict[str, Floats] = {}
    honest: dict[str, Floats] = {}
    for kind, names, values in (("ToR", roster.rater_names, tor), ("ToP", roster.provider_names, top)):
        for group, members in ((mine, shown), (honest, [name for name in names if name not in bad])):
            places = [names.index(name) for name in members if name in names]
            if places:
                group[kind] = values[:, places].mean(axis=1)
            if group is mine:
                own |= {f"{kind} of {names[place]}": values[:, place] for place in places}
    objective, cost = (np.array([float(played.outcome[k][0, 0]) for played in rounds]) for k in (1, 2))
    called = called or finding.name
    return Trajectory(called, quality, ratings, own, mine, honest, objective, cost, task.stealth.weight)


def _chosen(task: AttackTask, names: Sequence[str], actions: Actions) -> tuple[dict[str, Floats], dict[str, Floats]]:
    """Return the quality that some agents choose in one game, by name, and their ratings, (P,) each."""
    roster = task.game.roster
    quality = {
        name: actions.quality[roster.provider_names.index(name), 0, 0]
        for name in names
        if name in roster.provider_names
    }
    ratings = {
        name: actions.ratings[roster.rater_names.index(name), :, 0, 0] for name in names if name in roster.rater_names
    }
    return quality, ratings
