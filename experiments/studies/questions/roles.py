"""The harm by raters against the harm by providers."""

from collections.abc import Sequence

import numpy as np

from roletrust_env import make_scenario
from roletrust_env.benchmarking import Suite, benchmark
from roletrust_env.benchmarking.schema import AttackResult
from roletrust_env.benchmarking.store import StoredCell
from roletrust_env.benchmarking.suite import Stage, Track
from roletrust_env.benchmarking.worst_case import as_array
from roletrust_env.metrics.confidence import Estimate, Floats, estimate
from roletrust_experiments.plots.charts import Panel
from studies.condition import suite_of
from studies.questions.answers import PATIENCE_S, Effort, Finding, lines, listed, verdict

QUESTION = "Do raters do more harm than providers?"
_PLACES = {"the paper's team": "paper-3x3", "a market": "market"}
_TRACKS = {"raters": "SR", "providers": "SP"}
_SHARE = 1 / 3
_WHAT = {"trust": "trust of the honest", "utility": "utility of consumers"}


def answer(effort: Effort) -> Finding:
    """Play all scripted attacks by a third of the raters, and by a third of the providers."""
    suite = _suite(effort)
    cells = benchmark(suite=suite, progress=False).cells
    measures = {
        (what, f"{who} attack", place): values
        for place in suite.scenarios
        for who in _TRACKS
        for what, values in harm(_rows(cells, place, who), _rows(cells, place, "honest")[0]).items()
    }
    labels = [f"{who} attack" for who in _TRACKS]
    differences = {
        f"{what}, {place}": estimate(
            measures[what, labels[0], place] - measures[what, labels[1], place]
        )
        for what in _WHAT
        for place in suite.scenarios
    }
    panels = [
        Panel(
            title,
            "",
            "less than without the attack",
            lines(measures, what, labels, list(suite.scenarios)),
        )
        for what, title in _WHAT.items()
    ]
    return Finding(QUESTION, sentence(differences), panels, effort.games)


def sentence(differences: dict[str, Estimate]) -> str:
    """Return the answer from the harm by raters minus that by providers."""

    def parts(what: str) -> str:
        parts_of_role = {
            name.partition(", ")[2]: difference
            for name, difference in differences.items()
            if name.startswith(what)
        }
        return listed({f"in {place}": difference for place, difference in parts_of_role.items()})

    return (
        f"{verdict(differences.values())}: where a third of either attack with their worst script, "
        "raters take from "
        f"the trust of the honest {parts('trust')} than providers do, and from the utility of "
        "consumers "
        f"{parts('utility')}."
    )


def harm(attacks: Sequence[AttackResult], calm: AttackResult) -> dict[str, Floats]:
    """Return the harm of the worst attack, for each kind of harm the worst one in the games for
    choosing.

    Args:
        attacks: Results of the attacks.
        calm: Result of the same games with all agents honest.

    Returns:
        For each game, (G,): `trust`, what honest agents lose, see `metrics.damage`, and `utility`,
        what consumers lose, see `metrics.utility`.
    """
    by_trust = max(attacks, key=lambda row: np.nanmean(as_array(row.chosen["damage"])))
    by_utility = min(attacks, key=lambda row: np.nanmean(as_array(row.chosen["utility"])))
    utility = as_array(calm.measured["utility"]) - as_array(by_utility.measured["utility"])
    return {"trust": as_array(by_trust.measured["damage"]), "utility": utility}


def _suite(effort: Effort) -> Suite:
    stages = {
        place: Stage(preset=name, set={"max_cycles": effort.rounds(make_scenario(name).max_cycles)})
        for place, name in _PLACES.items()
    }
    return Suite(
        name="roles",
        models=("role-trust",),
        scenarios=stages,
        tracks={"honest": Track()}
        | {who: Track(roles=(role,), shares=(_SHARE,)) for who, role in _TRACKS.items()},  # type: ignore[arg-type]
        methods=("scripted",),
        attacks=suite_of("attackers").attacks,
        games=effort.games,
        seeds=(effort.seed,),
        limit_s=PATIENCE_S,
    )


def _rows(cells: Sequence[StoredCell], place: str, track: str) -> tuple[AttackResult, ...]:
    """Return the results on a track."""
    return next(done.rows for cell, done in cells if (cell.scenario, cell.track) == (place, track))
