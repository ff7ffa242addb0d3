"""Whether the places of agents matter: a run beside one in which trust models see the agents in another order.

Both runs search and measure with the same random numbers. A model that treats all agents alike has the same scores in
both, but for rounding, which may decide between providers with equal trust, and so lead a search elsewhere.
"""

from collections.abc import Sequence
from typing import NamedTuple

from roletrust_env.benchmarking.leaderboard import Floats, score_table
from roletrust_env.benchmarking.store import StoredCell
from roletrust_env.benchmarking.suite import Suite
from roletrust_env.benchmarking.worst_case import WorstCase, attack_scores, worst_cases
from roletrust_env.metrics.confidence import Estimate, over_seeds


class PlaceEffect(NamedTuple):
    """Scores of a model that sees the agents in order, and how they differ where it sees them shuffled.

    Attributes:
        model: Name of the model.
        clean: Mean score over the tracks on which all agents are honest; NaN if there are none.
        clean_change: Mean difference of that score in the same games: shuffled minus in order.
        worst: Mean score of the worst case over the conditions.
        worst_change: Mean difference of that score in the same games.
    """

    model: str
    clean: Estimate
    clean_change: Estimate
    worst: Estimate
    worst_change: Estimate


def place_effects(
    suite: Suite, stored: Sequence[StoredCell], shuffled: Suite, stored_shuffled: Sequence[StoredCell]
) -> list[PlaceEffect]:
    """Return how the scores of each model change if it sees the agents shuffled, with intervals over games and seeds.

    Args:
        suite: Suite of a run in which models see the agents in order. It may have more seeds than the other one.
        stored: Cells of that run with their results.
        shuffled: Suite of the other run, with `places = "shuffled"`.
        stored_shuffled: Cells of the other run with their results.

    Raises:
        ValueError: The suites differ in more than places, or a cell is missing or failed.
    """
    if suite.places == "shuffled" or shuffled.places != "shuffled":
        raise ValueError(
            f"places is {suite.places!r} in the suite {suite.name} and {shuffled.places!r} in {shuffled.name}; it must "
            "be 'shuffled' in the second one only"
        )
    alike = suite.model_copy(update={"places": shuffled.places, "seeds": shuffled.seeds})
    played = shuffled.cells()
    differs = alike.score != shuffled.score or alike.cells() != played
    if differs or any(alike.rules(cell) != shuffled.rules(cell) for cell in played):
        raise ValueError(f"the suites {suite.name} and {shuffled.name} differ in more than places and seeds")
    one, other = (_scores(shuffled, own) for own in (stored, stored_shuffled))
    columns = [one[0], other[0] - one[0], one[1], other[1] - one[1]]
    models = shuffled.model_names
    estimates = [over_seeds(values, len(models)).estimates for values in columns]
    return [PlaceEffect(*row) for row in zip(models, *estimates, strict=True)]


def _scores(suite: Suite, stored: Sequence[StoredCell]) -> tuple[Floats, Floats]:
    """Return the clean score and that of the worst case of each model, seed and game, shape (M, S, G) each."""
    wanted = {cell.key: cell for cell in suite.cells()}
    part = [one for one in stored if one.cell.key in wanted and not one.result.failed]
    if missing := [wanted[key] for key in wanted.keys() - {one.cell.key for one in part}]:
        raise ValueError(f"cell {min(missing).key} is missing or failed")
    honest: dict[bool, list[WorstCase]] = {True: [], False: []}
    for one in worst_cases(attack_scores(suite, part)).values():
        honest[not suite.tracks[one.condition.track].roles].append(one)
    models = suite.model_names
    clean, worst = (score_table(honest[which], models) for which in (True, False))
    return clean, worst
