"""One game of an attack, round by round: what it does, what becomes of trust, and what it gains."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from roletrust_env.arrays import Array
from roletrust_env.evaluation.search import HELD_OUT, MeasuredSearch, TaskArguments, exact_task, play, sources
from roletrust_env.game.attack_task import AttackTask
from roletrust_env.game.state import Actions

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Trajectory:
    """What T rounds of one held-out game left behind.

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
        """The rows of a table, one for each round and quantity; of ratings the mean over the honest providers."""
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
    moments = list(play(task, finding.attacker, (1, 1), *sources(task, seed, HELD_OUT)))
    trust = [task.game.published(moment.state.game) for moment in moments]
    tor, top = (np.stack([pair[k][:, 0, 0] for pair in trust]) for k in range(2))
    victims = [i for i, name in enumerate(roster.provider_names) if name not in bad]
    deeds = [_deeds(task, moment.action) for moment in moments]
    quality = {name: np.stack([chosen[name] for chosen, _ in deeds]) for name in deeds[0][0]}
    ratings = {name: np.stack([given[name] for _, given in deeds])[:, victims] for name in deeds[0][1]}
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
    objective, cost = (np.array([float(moment.outcome[k][0, 0]) for moment in moments]) for k in (1, 2))
    called = called or finding.name
    return Trajectory(called, quality, ratings, own, mine, honest, objective, cost, task.stealth.weight)


def _deeds(task: AttackTask, action: Array | Actions) -> tuple[dict[str, Floats], dict[str, Floats]]:
    """The quality that the attacker's agents choose in one game, by name, and their ratings, (P,) each."""
    roster = task.game.roster
    quality, ratings, at = {}, {}, 0
    if isinstance(action, Actions):
        for name in task.identities:
            if name in roster.provider_names:
                quality[name] = action.quality[roster.provider_names.index(name), 0, 0]
            if name in roster.rater_names:
                ratings[name] = action.ratings[roster.rater_names.index(name), :, 0, 0]
        return quality, ratings
    for name in task.compromised:
        if name in roster.provider_names:
            quality[name] = action[at, 0, 0]
            at += 1
        if name in roster.rater_names:
            ratings[name] = action[at : at + roster.n_providers, 0, 0]
            at += roster.n_providers
    return quality, ratings
