"""Answers to what the paper claims or leaves open, each with a figure, numbers with intervals and a
sentence.

The questions are about larger systems (`dilution`), honest agents (`noise`), the share of liars
from which on no model can know better (`mirrored`), ToA (`both-roles`), cutting agents off
(`admission`), and raters that see only the providers near them (`movement`).

Compared games use the same random numbers. A rule turns the numbers into a sentence, and the
sentence says where a difference is not shown. Minutes on two cores.
"""

from typing import NamedTuple

from roletrust_experiments.plots.charts import Panel, Series, panels_figure
from studies.questions import admission, both_roles, dilution, mirrored, movement, noise
from studies.questions.answers import Effort
from studies.study import Recipe, Run, Study

QUESTIONS = {
    "dilution": dilution.answer,
    "noise": noise.answer,
    "mirrored": mirrored.answer,
    "both-roles": both_roles.answer,
    "admission": admission.answer,
    "movement": movement.answer,
}

_INTRODUCTION = """\
This page answers with measurements what Su and Saint-Jore ([EWSN 2023](https://hal.science/hal-04161463)) claim or
leave open. The trust model is theirs, `role-trust`, unless another one is named. Compared games use the same random
numbers. The numbers are means with 95% intervals over the games. A rule turns the numbers into sentences: a difference
whose interval contains 0 is not shown, and the sentence says "neither more nor less". Intervals are not corrected for
multiple comparisons: of twenty differences that do not exist, one is shown by chance. The code is in
`experiments/studies/questions`; `python -m studies findings` also writes a table of the numbers of each figure.
`roletrust figures` repeats the experiment of the paper with rendered cameras and a people detector, and compares each
statement about its Figures 3 and 4 with the measurement."""  # noqa: E501


class Options(NamedTuple):
    """Questions and effort.

    Attributes:
        question: Questions to answer.
        games: Number of games for each mean.
        quick: Try it out, with short games and only the first values of each parameter.
    """

    question: tuple[str, ...] = tuple(QUESTIONS)
    games: int = 48
    quick: bool = False


FILES = {f"findings/{name}.png": f"findings/{name}.png" for name in QUESTIONS}
RECIPES = {"findings": Recipe(Options(), {"findings.md": "findings.md", **FILES})}


def main(study: Study[Options]) -> None:
    """Answer the questions, and write the page."""
    names, games, quick = study.options
    if unknown := set(names) - set(QUESTIONS):
        raise ValueError(f"unknown question {min(unknown)!r}; questions are {', '.join(QUESTIONS)}")
    effort = Effort(games, study.seed, quick)
    study.workers = 1  # a question takes all cores itself
    answers = study.play(answer, {name: (name, effort) for name in names}, effort._asdict())
    parts = ["# The paper, answered", _INTRODUCTION]
    for name, finding in answers.items():
        panels = [Panel(*panel) for panel in finding["panels"]]
        panels = [
            panel._replace(series=[Series(*series_fields) for series_fields in panel.series])
            for panel in panels
        ]
        rows = [
            (panel.title, series.label, at, *map(float, value))
            for panel in panels
            for series in panel.series
            for at, value in zip(series.at, series.values, strict=True)
        ]
        study.csv(f"findings/{name}.csv", ("figure", "series", "at", "value", "low", "high"), rows)
        note = f"{finding['games']} games for each value; 95% intervals"
        study.figure(f"findings/{name}.png", panels_figure(finding["question"], panels, note))
        command = (
            f"findings --question {name} --games {games} --seed {study.seed}{' --quick' * quick}"
        )
        picture = f"![{finding['question']}](findings/{name}.png)"
        parts += [
            f"## {finding['question']}",
            picture,
            finding["sentence"],
            f"    python -m studies {command}",
        ]
    study.page("findings.md", *parts)


def answer(name: str, effort: Effort) -> Run:
    """Answer a question. Returns the fields of a `Finding` as plain data."""
    return QUESTIONS[name](effort)._asdict()
