"""Whether an attacker of one trust model harms the others, too.

A coalition is trained by evolution, from random networks, against each trust model (rows), and
plays against every trust model (columns) in fresh games, the same ones for all rows. The number is
the utility of a consumer that goes to the most trusted provider, as a share of the best possible.
Lower is a better attack. A frame or a star marks the trust models of the training.

The universal coalitions that come with the project are further rows. They are not trained here, and
were trained in turn against the marked trust models. `--on` adds columns without training on them,
such as a model of another package or, as a URL, a service. Hours for all models.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from roletrust_agents.learned.coalition_attacker import CoalitionAttacker
from roletrust_agents.learned.saved import load_attacker
from roletrust_agents.training.coalition_methods import EvolutionSearch
from roletrust_agents.training.universal import universal_coalitions
from roletrust_env.evaluation.search import Budget, SearchResult
from roletrust_env.metrics.confidence import Estimate
from roletrust_env.storage.markdown import markdown_table
from roletrust_env.trust import trust_models
from roletrust_experiments.plots.style import ATTACKER, HONEST, INK, QUIET
from studies.condition import Condition
from studies.study import Recipe, Run, Study, mean_of

LIMIT = 0.5
"""Utility below which an attack counts as a success."""

_CELL, _LETTER = 0.46, 0.085  # inches of a cell of the heat map, and of a letter of its names
_DARK = 0.35  # distance from 0.5 beyond which numbers are white


class Options(NamedTuple):
    """Rows and columns of the table, and the condition.

    Attributes:
        model: Specs of the trust models to train on and to play on; all that are installed if left
            out.
        on: Specs of further trust models to play on.
        budget: Rounds x games of each training.
        suite: Suite with the scenario and the track.
        scenario: Name of the scenario in the suite.
        track: Name of the track in the suite, which says who is compromised.
        share: Share of compromised agents in each role of the track.
        games: Number of fresh games that measure each coalition.
        runs: Number of trainings, with the seed of the study and those after it.
    """

    model: tuple[str, ...] = ()
    on: tuple[str, ...] = ()
    budget: int = 300_000
    suite: str = "two-worlds"
    scenario: str = "crowd"
    track: str = "raters"
    share: float = 0.5
    games: int = 50
    runs: int = 3


_FILES = ("transfer.png", "transfer.md", "transfer.csv")
RECIPES = {"transfer": Recipe(Options(), {name: f"attackers/{name}" for name in _FILES})}


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
        """Return whether a trust model was among those of the training, with any parameters if it
        is universal.
        """
        if not self.universal:
            return model == self.name
        return model.partition(":")[0] in self.models

    def key(self, seed: int) -> str:
        """Return the unique key of the run with a seed."""
        return f"{'universal' if self.universal else 'trained on'}|{self.name}|{seed}"


Table = Mapping[Coalition, Mapping[str, Estimate]]
"""Utility of the consumer in fresh games, over the seeds, by coalition and by the trust model that
it plays against."""


def main(study: Study[Options]) -> None:
    """Train and play all coalitions, and write the table."""
    asked = study.options
    condition = Condition.of(asked.suite, asked.scenario, asked.track, asked.share)
    models = list(asked.model or trust_models())
    columns = list(dict.fromkeys([*models, *asked.on]))
    rows, seeds = coalitions(models), range(study.seed, study.seed + asked.runs)
    effort = (columns, asked.budget, asked.games)
    jobs = {row.key(seed): (condition, row, seed, *effort) for row in rows for seed in seeds}
    played = study.play(play_row, jobs, {"condition": condition.describe(), "effort": effort})
    lines_of_rows = {
        row: {
            name: mean_of([played[row.key(seed)]["utility"][name] for seed in seeds])
            for name in columns
        }
        for row in rows
        if all(row.key(seed) in played for seed in seeds)
    }
    cells = [
        (row, name, utility)
        for row, line in lines_of_rows.items()
        for name, utility in line.items()
    ]
    study.csv(
        "transfer.csv",
        ("trained_on", "universal", "played_on", "seen", "utility", "half_95"),
        [
            (row.name, row.universal, name, row.knows(name), *utility[:2])
            for row, name, utility in cells
        ],
    )
    title = f"Trained on one trust model, played on others ({condition})"
    study.figure("transfer.png", _figure(title, lines_of_rows), colours=None)
    table = [
        [
            row.name,
            *(f"{estimate.mean:.2f}{'*' * row.knows(name)}" for name, estimate in line.items()),
        ]
        for row, line in lines_of_rows.items()
    ]
    study.page(
        "transfer.md",
        markdown_table(["trained on", *columns], table, names=1),
        f"Utility of the consumer in {asked.games} fresh games, mean over the runs ({asked.runs}), "
        "with "
        f"{asked.budget:,} rounds of training each. Lower is a better attack. A star: trained on "
        "this trust model. "
        f"Condition: {condition}.",
        *sentences(lines_of_rows),
        f"Made by `{study.command}`.",
    )


def coalitions(models: Sequence[str]) -> list[Coalition]:
    """Return the rows: a coalition for each trust model, and the universal coalitions that come
    with the project.
    """
    rows = [Coalition(model, (model,)) for model in models]
    for name in universal_coalitions(wide=False):
        card = load_attacker(name).card
        known = (card.trust_model, *card.further_models)
        rows.append(
            Coalition(name, tuple(dict.fromkeys(model.name for model in known)), universal=True)
        )
    return rows


def play_row(
    condition: Condition, row: Coalition, seed: int, models: Sequence[str], budget: int, games: int
) -> Run:
    """Train the coalition of a row, unless it is universal, and measure it against trust models in
    fresh games.

    Args:
        condition: Condition of the attack.
        row: The coalition.
        seed: Random seed.
        models: Specs of the trust models to play against.
        budget: Game rounds that the training may play.
        games: Number of fresh games.

    Returns:
        The utility by trust model, and the attack in a few words.
    """
    if row.universal:
        result = SearchResult(CoalitionAttacker(universal_coalitions()[row.name]), 0, row.name)
    else:
        result = EvolutionSearch(start="random", wide=False).search(
            condition.arguments(row.name), Budget(budget), seed
        )
    utility = {model: condition.utility(model, result.attacker, seed, games) for model in models}
    return {"attack": result.description, "utility": utility}


def sentences(table: Table) -> list[str]:
    """Return what the table says about unseen models: of all trained coalitions, and of each
    universal one.

    Example:
        >>> sentences({Coalition("mean", ("mean",)): {"mean": Estimate(0.2, 0.1), "beta": Estimate(0.4, 0.1)}})
        ['Coalitions trained on one model, on the others: mean utility 0.400; 1 of 1 below 0.5.']
    """  # noqa: E501
    groups: dict[str, list[float]] = {}
    for row, line in table.items():
        unseen = [estimate.mean for name, estimate in line.items() if not row.knows(name)]
        groups.setdefault(row.name if row.universal else "", []).extend(unseen)
    return [
        f"{f'{name}, on models it was not trained on' if name else 'Coalitions trained on one model, on the others'}: "  # noqa: E501
        f"mean utility {mean_of([*values]).mean:.3f}; {sum(value < LIMIT for value in values)} of "
        f"{len(values)} "
        f"below {LIMIT:g}."
        for name, values in groups.items()
        if values
    ]


def _figure(title: str, table: Table) -> Figure:
    """Return a heat map of the utility: trained on the rows, played on the columns."""
    rows = [row.name for row in table]
    columns = [name.rpartition(":")[2] for name in next(iter(table.values()))]
    names = _LETTER * max(map(len, (*rows, *columns)))
    size = max(5.5, _CELL * len(columns) + names + 1.6), _CELL * len(rows) + names + 1.6
    figure = Figure(figsize=size, layout="constrained")
    axes = figure.subplots()
    values = np.array([[estimate.mean for estimate in line.values()] for line in table.values()])
    colours = LinearSegmentedColormap.from_list("utility", [ATTACKER, "#FDF3EC", HONEST[0]])
    image = axes.imshow(np.ma.masked_invalid(values), cmap=colours, vmin=0, vmax=1, aspect="auto")
    for k, (row, line) in enumerate(table.items()):
        for j, name in enumerate(line):
            ink = "white" if abs(values[k, j] - 0.5) > _DARK else INK
            axes.text(
                j, k, f"{values[k, j]:.2f}", ha="center", va="center", fontsize=7.5, color=ink
            )
            if row.knows(name):
                axes.add_patch(
                    Rectangle(
                        (j - 0.47, k - 0.47), 0.94, 0.94, fill=False, edgecolor=INK, linewidth=1.5
                    )
                )
    axes.set_xticks(
        range(len(columns)), columns, rotation=55, ha="right", rotation_mode="anchor", fontsize=8.5
    )
    axes.set_yticks(range(len(rows)), rows, fontsize=8.5)
    axes.tick_params(colors=QUIET, labelcolor=INK, length=0)
    axes.set_xlabel("played on", color=INK)
    axes.set_ylabel("trained on, or universal", color=INK)
    axes.spines[:].set_visible(False)
    figure.colorbar(image, ax=axes, shrink=0.7, pad=0.01).set_label(
        "utility of the consumer", color=INK
    )
    figure.suptitle(title, x=0.012, ha="left", fontsize=12, fontweight="bold", color=INK)
    figure.supxlabel(
        "a frame: trained on this trust model", x=0.99, ha="right", fontsize=8.5, color=QUIET
    )
    return figure
