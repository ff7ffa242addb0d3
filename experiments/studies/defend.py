"""Trust models that are trained against a population of attackers, and attackers against the
models, in turn.

The payoffs of all known models against all known attackers are a matrix, whose equilibrium is
solved. Then an attacker is trained in each condition against the models' mixture, and each learner
against the attackers' mixture, and all join the matrix. What the best responses win in other games
is a lower bound of the NashConv.

At the end, the learned models stand beside the fixed ones: under the attackers that were found, one
that is trained against each model alone with the same budget, and attackers and worlds that no
training has met. The number is skill: 1 for the best choice of a consumer, 0 for a blind one. With
several runs, all is trained again with other seeds, and intervals cover games and trainings.

The best model of each learner is written into the folder of its seed, as the text that `--model`
takes or as a network. Half an hour on one core for three runs.
"""

from collections.abc import Hashable, Mapping, Sequence
from typing import TypeVar

import numpy as np

from roletrust_agents.learned.saved import digest
from roletrust_agents.learned.saved_defence import DefenceCard, save_defence, weights_bytes
from roletrust_agents.training.defence_learners import NetworkLearner
from roletrust_agents.training.runs import write_bytes
from roletrust_env import __version__
from roletrust_env.metrics.confidence import Interval, over_seeds
from roletrust_env.storage.files import write_text
from roletrust_env.storage.markdown import markdown_table
from roletrust_experiments.plots.charts import Panel, Series, panels_figure
from studies.defence.fronts import Front
from studies.defence.game import Options, label, play_game
from studies.study import Recipe, Run, Study, with_ends

Measured = Mapping[str, Sequence[float]]
"""What one run has measured, by the name of a column, each in its games, shape (G,)."""

Row = dict[str, Interval]
"""Means with their intervals, by the name of a column."""

Key = TypeVar("Key", bound=Hashable)


_TABLES = ("defence.md", "defence.png", "iterations.csv", "comparison.csv", "leads.csv")
_SAVED = ("leave-one-out.txt", "first-hand.txt", "network.json", "network.safetensors")
FILES = {name: f"defence/{name}" for name in _TABLES} | {
    f"seed-0/{name}": f"defence/{name}" for name in _SAVED
}
RECIPES = {"defence": Recipe(Options(), FILES)}

_SHOWN = 0.005  # least probability of a model in the text

_WINS = {
    "value": "value",
    "attack": "attackers win",
    "defence": "defence wins",
    "nash_conv": "NashConv, at least",
    "worst": "mixture at worst",
    "single": "best model alone",
}
_WINS_LEGEND = (
    "Skill: 1 for the best choice of a consumer, 0 for a blind one; means ± half of the 95% "
    "interval. "
    "Value: of both mixtures against each other. Attackers and defence win: by their best "
    "responses; NashConv: both "
    "together. Mixture at worst, best model alone: under the best responses."
)
_SKILLS = {
    "clean": "clean",
    "worst": "worst found",
    "strangers": "strangers",
    "worlds": "other worlds",
}
_SKILLS_LEGEND = (
    "Clean: nobody attacks. Worst found: under the worst attacker of the game, or one that is "
    "trained against this "
    "model alone. Strangers: under the worst attacker that no training has met. Other worlds: the "
    "same in other "
    "conditions."
)
_LEADS_LEGEND = "Skill of the learned model less that of the one beside it, in the same games."


def main(study: Study[Options]) -> None:
    """Play all games and comparisons, and write what they come to."""
    asked = study.options
    seeds = range(study.seed, study.seed + asked.runs)
    played = study.play(
        play_game,
        {f"seed-{seed}": (asked, seed) for seed in seeds},
        {**asked._asdict(), "runs": None},
    )
    for key, run in played.items():
        _save(study, key, run)
    runs = list(played.values())
    iterations = over_runs(
        {k: [run["iterations"][k] for run in runs] for k in range(asked.iterations)}
    )
    models, over = compare(runs, list(dict.fromkeys((*asked.model, *asked.beside))))
    leads = [(name, other, row) for name, others in over.items() for other, row in others.items()]
    study.csv(
        "iterations.csv",
        ["iteration", *with_ends(_WINS)],
        [[k, *_cells(row, _WINS)] for k, row in iterations.items()],
    )
    study.csv(
        "comparison.csv",
        ["model", *with_ends(_SKILLS)],
        [[name, *_cells(row, _SKILLS)] for name, row in models.items()],
    )
    study.csv(
        "leads.csv",
        ["model", "beside", *with_ends(_SKILLS)],
        [[name, other, *_cells(row, _SKILLS)] for name, other, row in leads],
    )
    over_what = f"{len(runs)} runs, 95% intervals over runs and games"
    note = f"{len(asked.front)} conditions of {asked.suite}, {over_what}"
    title = "What do trust models and attackers reach when both are trained against each other?"
    study.figure("defence.png", panels_figure(title, _panels(iterations, models), note))
    skills = list(_SKILLS.values())
    study.page(
        "defence.md",
        markdown_table(
            ["iteration", *_WINS.values()],
            [[str(k + 1), *_texts(row, _WINS)] for k, row in iterations.items()],
            1,
        ),
        _WINS_LEGEND,
        markdown_table(
            ["model", *skills],
            [[f"`{name}`", *_texts(row, _SKILLS)] for name, row in models.items()],
            1,
        ),
        _SKILLS_LEGEND,
        markdown_table(
            ["model", "beside", *skills],
            [[f"`{a}`", f"`{b}`", *_texts(row, _SKILLS)] for a, b, row in leads],
            2,
        ),
        _LEADS_LEGEND,
        _mixture(runs),
        f"{note}. Made by `{study.command}`.",
    )


def over_runs(measured: Mapping[Key, Sequence[Measured]]) -> dict[Key, Row]:
    """Return means with 95% intervals over games, and over runs if there are several, see
    `over_seeds`.

    Args:
        measured: What each run has measured, by what it is about.
    """
    rows: dict[Key, Row] = {key: {} for key in measured}
    for column in next(iter(measured.values()))[0]:
        values = np.array([[run[column] for run in runs] for runs in measured.values()])
        for key, estimate in zip(measured, over_seeds(values, len(values)).estimates, strict=True):
            rows[key][column] = estimate.interval
    return rows


def compare(
    runs: Sequence[Run], fixed: Sequence[str]
) -> tuple[dict[str, Row], dict[str, dict[str, Row]]]:
    """Return the models over all runs, the best worst case first, and the lead of each learned one
    over each fixed one.

    The name of a learned model of several runs does not say in which iteration it came.
    """
    theirs = {name: [run["compared"][name] for run in runs] for name in fixed}
    ours, leads = {}, {}
    for learner, k in runs[0]["learned"].items():
        name = f"{learner}, trained" if len(runs) > 1 else label(learner, k)
        ours[name] = [run["compared"][label(learner, run["learned"][learner])] for run in runs]
        apart = {
            o: [_apart(*pair) for pair in zip(ours[name], each, strict=True)]
            for o, each in theirs.items()
        }
        leads[name] = over_runs(apart)
    # Apart from the fixed ones: each run trains its own learned models, so their means vary more.
    rows = over_runs(ours) | over_runs(theirs)
    return dict(sorted(rows.items(), key=lambda row: -row[1]["worst"].value)), leads


def _apart(own: Measured, other: Measured) -> Measured:
    return {column: np.subtract(own[column], other[column]).tolist() for column in own}


def _save(study: Study[Options], folder: str, run: Run) -> None:
    """Write the best model of each learner of a run: its spec, or the files of a network."""
    for name, k in run["learned"].items():
        path = study.out / folder / name.replace(":", ".")
        if name != NetworkLearner.name:
            write_text(path.with_suffix(".txt"), run["specs"][label(name, k)] + "\n")
            continue
        asked, learner, vector = study.options, NetworkLearner(), np.array(run["vectors"][name])
        weights = np.array(learner.weights(vector))
        card = DefenceCard(
            package_version=__version__,
            parameters=learner.parameters(vector),
            conditions=tuple(str(Front.parse(asked.suite, front)) for front in asked.front),
            iteration=k + 1,
            seed=int(folder.removeprefix("seed-")),
            settings={"steps": asked.steps, "budget": asked.budget, "explored": asked.explored},
            weights_sha256=digest(weights_bytes(weights)),
        )
        save_defence(weights, card, path, write_bytes)


def _panels(iterations: Mapping[int, Row], models: Mapping[str, Row]) -> list[Panel]:
    def lines(columns: Mapping[str, str]) -> list[Series]:
        at = [k + 1 for k in iterations]
        return [
            Series(label, at, [row[name] for row in iterations.values()])
            for label, name in columns.items()
        ]

    def rows(columns: Mapping[str, str]) -> list[Series]:
        return [
            Series(label, list(models), [row[name] for row in models.values()])
            for label, name in columns.items()
        ]

    wins = {"either side": "nash_conv", "attackers": "attack", "defence": "defence"}
    worst = {"mixture, attackers respond": "worst", "best model alone": "single"}
    return [
        Panel("what a best response wins", "iteration", "skill", lines(wins)),
        Panel("the defence", "iteration", "skill", lines(worst)),
        Panel("at the end: the worst attacker found", "", "skill", rows({"met": "worst"})),
        Panel(
            "attackers that nobody has met",
            "",
            "skill",
            rows({"in the same worlds": "strangers", "in other worlds": "worlds"}),
        ),
    ]


def _mixture(runs: Sequence[Run]) -> str:
    """Return the mean equilibrium at the end in words."""
    weights = {
        name: float(np.mean([run["mixture"][name] for run in runs])) for name in runs[0]["mixture"]
    }
    parts = [f"{name}: {weight:.0%}" for name, weight in weights.items() if weight >= _SHOWN]
    return f"The defence's mixture at the end: {'; '.join(parts)}."


def _cells(row: Row, columns: Mapping[str, str]) -> list[float]:
    return [x for name in columns for x in row[name]]


def _texts(row: Row, columns: Mapping[str, str]) -> list[str]:
    return [
        f"{interval.value + 0.0:.3f} ± {(interval.high - interval.low) / 2:.3f}"
        for interval in (row[name] for name in columns)
    ]
