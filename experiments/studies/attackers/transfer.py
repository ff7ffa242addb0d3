"""Coalitions that are trained against one trust model and play against others."""

from collections.abc import Mapping, Sequence
from time import perf_counter
from typing import NamedTuple

from pydantic import NonNegativeInt

from roletrust_agents.learned.coalition_attacker import CoalitionAttacker
from roletrust_agents.learned.saved import load_attacker
from roletrust_agents.training.coalition_methods import EvolutionSearch
from roletrust_agents.training.universal import universal_coalitions
from roletrust_env.evaluation.search import Budget, SearchResult
from roletrust_env.metrics.confidence import Estimate
from roletrust_env.storage.untrusted import UntrustedModel
from studies.attackers.condition import Condition
from studies.attackers.runs import Run, mean_of

LIMIT = 0.5
"""Utility below which an attack counts as a success."""


class Coalition(NamedTuple):
    """A row of the table: a coalition, by its training.

    Attributes:
        name: Spec of the trust model of the training, or name of a universal coalition.
        models: Names of the trust models of the training.
        universal: True for a universal coalition that comes with the project.
    """

    name: str
    models: tuple[str, ...]
    universal: bool = False

    def knows(self, model: str) -> bool:
        """Return whether a trust model was among those of the training, with any parameters if it is universal."""
        if not self.universal:
            return model == self.name
        return any(model == name or model.startswith(f"{name}:") for name in self.models)

    def key(self, seed: int) -> str:
        """Return the unique key of the run with a seed."""
        return f"{'universal' if self.universal else 'trained on'}|{self.name}|{seed}"


class Kept(UntrustedModel):
    """What is kept of a row, see `play_row`."""

    rounds: NonNegativeInt
    seconds: float
    attack: str
    utility: dict[str, float | None]


class Cell(NamedTuple):
    """A cell of the table.

    Attributes:
        coalition: Row: the coalition.
        model: Column: the trust model that it plays against.
        utility: Utility of the consumer in fresh games, over the seeds.
    """

    coalition: Coalition
    model: str
    utility: Estimate

    @property
    def seen(self) -> bool:
        """True if the trust model was among those of the training."""
        return self.coalition.knows(self.model)


def coalitions(models: Sequence[str]) -> list[Coalition]:
    """Return the rows: a coalition for each trust model, and the universal coalitions that come with the project."""
    rows = [Coalition(model, (model,)) for model in models]
    for name in universal_coalitions():
        card = load_attacker(name).card
        known = (card.trust_model, *card.further_models)
        rows.append(Coalition(name, tuple(dict.fromkeys(model.name for model in known)), universal=True))
    return rows


def play_row(condition: Condition, row: Coalition, seed: int, models: Sequence[str], budget: int, games: int) -> Run:
    """Train the coalition of a row, unless it is universal, and measure it against trust models in fresh games.

    Args:
        condition: Condition of the attack.
        row: The coalition.
        seed: Random seed.
        models: Specs of the trust models to play against.
        budget: Game rounds that the training may play.
        games: Number of fresh games.

    Returns:
        The utility by trust model, and the rounds and seconds of the training.
    """
    began = perf_counter()
    if row.universal:
        found = SearchResult(CoalitionAttacker(universal_coalitions()[row.name]), 0, row.name)
    else:
        found = EvolutionSearch(start="random").search(condition.arguments(row.name), Budget(budget), seed)
    seconds = perf_counter() - began
    utility = {model: condition.utility(model, found.attacker, seed, games) for model in models}
    return {"rounds": found.rounds, "seconds": round(seconds, 3), "attack": found.description, "utility": utility}


def missing_models(row: Coalition, seed: int, models: Sequence[str], runs: Mapping[str, Run]) -> list[str]:
    """Return the trust models against which a coalition has not played yet."""
    played = runs.get(row.key(seed), {}).get("utility", {})
    return [model for model in models if model not in played]


def table(
    rows: Sequence[Coalition], models: Sequence[str], seeds: Sequence[int], runs: Mapping[str, Run]
) -> list[list[Cell]]:
    """Return the cells by row and column; rows that have not been played in full are left out."""
    return [
        [Cell(row, model, mean_of([runs[row.key(seed)]["utility"][model] for seed in seeds])) for model in models]
        for row in rows
        if not any(missing_models(row, seed, models, runs) for seed in seeds)
    ]


def sentences(cells: Sequence[Sequence[Cell]]) -> list[str]:
    """Return what the table says about unseen models: of all trained coalitions, and of each universal one.

    Example:
        >>> row = Coalition("mean", ("mean",))
        >>> cells = [[Cell(row, "mean", Estimate(0.2, 0.1)), Cell(row, "beta", Estimate(0.4, 0.1))]]
        >>> sentences(cells)
        ['Coalitions trained on one model, on the others: mean utility 0.400; 1 of 1 below 0.5.']
    """
    groups: dict[str, list[float]] = {}
    for row in cells:
        name = row[0].coalition.name if row[0].coalition.universal else ""
        groups.setdefault(name, []).extend(cell.utility.mean for cell in row if not cell.seen)
    return [
        f"{f'{name}, on models it was not trained on' if name else 'Coalitions trained on one model, on the others'}: "
        f"mean utility {mean_of([*values]).mean:.3f}; {sum(value < LIMIT for value in values)} of {len(values)} "
        f"below {LIMIT:g}."
        for name, values in groups.items()
        if values
    ]
