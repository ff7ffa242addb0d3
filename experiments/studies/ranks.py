"""How the ranks of the leaderboard depend on reports and on how consumers choose, and how the
initial trust of its worlds was tuned.

The ranks by reports are those of the published entries. For the others the worst attack on each
model in each setting is played again, with other rates of exploration and with a softmax choice.
Takes about fifteen minutes of a core.
"""

from collections.abc import Mapping
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from roletrust_env.benchmarking import benchmark
from roletrust_env.benchmarking.cells import play_cell
from roletrust_env.benchmarking.leaderboard import WorstCase
from roletrust_env.benchmarking.suite import Cell
from roletrust_env.benchmarking.suite_files import load_suite
from roletrust_env.metrics.confidence import Estimate
from roletrust_env.storage.markdown import markdown_table
from studies.study import Recipe, Run, Study, mean_of, plus_minus, with_ends

CHOICES: dict[str, dict[str, float]] = {
    "exploration 2%": {"explore": 0.02},
    "exploration 20%": {"explore": 0.2},
    "softmax, temperature 0.1": {"explore": 0.0, "temperature": 0.1},
}
"""Changed fields of the access of consumers to providers."""
REPORTS = ("verified", "open")
"""Reports that a setting allows."""
INITIAL = (0.5, 0.6, 0.65, 0.7, 0.75, 0.85)
"""Initial trust that was tried."""
TUNING = 99
"""Seed of the worlds in which the initial trust was tuned; no others of the project have it."""


class Options(NamedTuple):
    """Size of the study.

    Attributes:
        measured: Number of worlds.
        games: Number of games in each world.
    """

    measured: int = 30
    games: int = 1


FILES = ("ranks.csv", "ranks.md", "initial_trust.csv")
RECIPES = {"ranks": Recipe(Options(), {name: f"leaderboards/standard/{name}" for name in FILES})}

Skills = dict[str, dict[str, Estimate]]
"""Mean skill in the worst cases over the settings, by variant and trust model."""


def main(study: Study[Options]) -> None:
    """Play the worst attacks again, and write the table of ranks."""
    cases = published_cases()
    jobs = {
        f"{model} {setting} {choice}": (study.options, model, setting, case.record, choice)
        for (model, setting), case in cases.items()
        for choice in CHOICES
    }
    tunings = {f"initial trust {trust}": (study.options, trust) for trust in INITIAL}
    settings = study.options._asdict()
    runs = study.play(measured, jobs, settings)
    tuned = study.play(solo_skill, tunings, settings)
    if lacking := [key for key in jobs if key not in runs]:
        raise ValueError(f"{len(lacking)} of {len(jobs)} runs failed, the first is {lacking[0]}")
    skills = published_skills(cases) | played_skills(cases, runs)
    study.csv(
        "ranks.csv",
        ["variant", "model", "rank", *with_ends(("skill",))],
        [
            (variant, model, rank, *of_variant[model].interval)
            for variant, of_variant in skills.items()
            for model, rank in ranking(of_variant).items()
        ],
    )
    study.csv(
        "initial_trust.csv",
        ["initial_trust", *with_ends(("skill",))],
        [(trust, *mean_of(tuned[key]["skill"]).interval) for key, (_, trust) in tunings.items()],
    )
    note = (
        "Rank by the mean skill in the worst cases, common choice rule. The columns on choices "
        f"play the same attacks again in {study.options.measured} worlds, games in each: "
        f"{study.options.games}. Made by `{study.command}`."
    )
    study.page("ranks.md", table(skills), note)


def published_cases() -> dict[tuple[str, str], WorstCase]:
    """Return the worst case of each published model in each attacked setting, common choice rule,
    by model and setting.
    """
    board = benchmark()
    return {
        (model, setting): case
        for (model, rule, setting), case in board.worst_cases.items()
        if rule == "common" and board.suite.settings[setting].roles
    }


@cache
def suite_of(options: Options, choice: str) -> Any:
    """Return the suite `standard` with another choice of consumers."""
    standard: Any = load_suite("standard")
    return _resized(standard, options, access={**standard.worlds.set["access"], **CHOICES[choice]})


def solo_skill(options: Options, trust: float) -> Run:
    """Return the skill of the solo model in honest play, in each world of the tuning."""
    suite = _resized(load_suite("standard", TUNING), options, initial_trust=trust)
    cell = Cell(suite.solo["common"], "common", "clean", "honest")
    return {"skill": play_cell(suite, cell).rows[0].measured["skill"]}


def _resized(suite: Any, options: Options, **changed: Any) -> Any:
    """Return a suite of the size of the study, with changed fields of its worlds."""
    worlds = {
        **suite.worlds.model_dump(),
        "set": {**suite.worlds.set, **changed},
        "selection": 1,
        "measured": options.measured,
    }
    changes = {"worlds": worlds, "games": options.games, "selection_games": 1}
    return type(suite).model_validate({**suite.model_dump(), **changes})


def measured(options: Options, model: str, setting: str, record: str, choice: str) -> Run:
    """Return the skill under a recorded attack in each world."""
    cell = Cell(model, "common", setting, "scripts")
    (row,) = play_cell(suite_of(options, choice), cell, records={"worst": record}).rows
    return {"skill": row.measured["skill"]}


def published_skills(cases: Mapping[tuple[str, str], WorstCase]) -> Skills:
    """Return the published skills, over all settings and over those with each kind of reports."""
    standard: Any = load_suite("standard")

    def skills(reports: tuple[str, ...]) -> dict[str, Estimate]:
        return _by_model(
            {
                (model, setting): case.scores["skill"]
                for (model, setting), case in cases.items()
                if standard.settings[setting].reports in reports
            }
        )

    return {"published": skills(REPORTS)} | {
        f"{reports} reports": skills((reports,)) for reports in REPORTS
    }


def played_skills(
    cases: Mapping[tuple[str, str], WorstCase], runs: Mapping[str, Mapping[str, Any]]
) -> Skills:
    """Return the skills with each other choice of consumers."""
    return {
        choice: _by_model(
            {
                (model, setting): np.array(runs[f"{model} {setting} {choice}"]["skill"], float)
                for model, setting in cases
            }
        )
        for choice in CHOICES
    }


def ranking(skills: Mapping[str, Estimate]) -> dict[str, int]:
    """Return the rank of each model, the best first."""
    order = sorted(skills, key=lambda model: -skills[model].mean)
    return {model: rank for rank, model in enumerate(order, 1)}


def table(skills: Skills) -> str:
    """Return the rank and the skill of each model, a column for each variant."""
    ranks = {variant: ranking(of_variant) for variant, of_variant in skills.items()}
    rows = [
        [
            f"`{model}`",
            *(f"{ranks[name][model]} ({plus_minus(skills[name][model])})" for name in skills),
        ]
        for model in ranks["published"]
    ]
    return markdown_table(["model", *skills], rows, 1)


def _by_model(skills: Mapping[tuple[str, str], np.ndarray[Any, Any]]) -> dict[str, Estimate]:
    """Return the mean over settings and worlds; worlds count alike."""
    return {
        model: mean_of(np.mean([x for (name, _), x in skills.items() if name == model], axis=0))
        for model in dict.fromkeys(model for model, _ in skills)
    }
