"""The page, the figure and the tables of `python -m studies.defend`."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from rich.markup import escape

from roletrust_env.metrics.confidence import Interval
from roletrust_env.storage.files import write_csv, write_text
from roletrust_env.storage.markdown import markdown_table
from roletrust_experiments.commands.console import console, number_table
from roletrust_experiments.plots.figure_files import write_figure
from studies.charts import Panel, Series, panels_figure
from studies.defence.comparison import Row
from studies.defence.double_oracle import Game
from studies.defence.fronts import Front
from studies.defence.progress import Iteration

LONGEST = 300
"""Length of the longest spec of a model that a text shows, in letters."""

_SHOWN = 0.005  # least probability of a model in the text
_FEW = 12  # games below which the worst attack is chosen by chance

_WINS = {
    "value": "value",
    "attack": "attackers win",
    "defence": "defence wins",
    "nash_conv": "NashConv, at least",
    "worst": "mixture at worst",
    "single": "best model alone",
}
_WINS_LEGEND = (
    "Skill: 1 for the best choice of a consumer, 0 for a blind one; means ± half of the 95% interval. "
    "Value: of both mixtures against each other. Attackers and defence win: by their best responses; NashConv: both "
    "together. Mixture at worst, best model alone: under the best responses."
)
_SKILLS = {"clean": "clean", "worst": "worst found", "strangers": "strangers", "worlds": "other worlds"}
_SKILLS_LEGEND = (
    "Clean: nobody attacks. Worst found: under the worst attacker of the game, or one that is trained against this "
    "model alone. Strangers: under the worst attacker that no training has met. Other worlds: the same in other "
    "conditions."
)


_LEADS_LEGEND = "Skill of the learned model less that of the one beside it, in the same games."


class Report(NamedTuple):
    """Content of the page, the figure and the tables.

    Attributes:
        games: Games with other seeds, played to their end.
        found: Numbers of each iteration.
        rows: Models beside each other.
        leads: Lead of each learned model over each fixed one.
        warnings: Lines of `caveats`.
        command: Command that made it.
    """

    games: Sequence[Game]
    found: Sequence[Iteration]
    rows: Sequence[Row]
    leads: Mapping[str, Sequence[Row]]
    warnings: Sequence[str]
    command: str


def caveats(fronts: Sequence[Front], games: int) -> list[str]:
    """Return what a reader of the numbers must know about these conditions and this number of games."""
    lines = [
        f"{one.name}: the suite {one.condition.suite.name} knows no attackers there, so strangers are its scripts at "
        "their defaults."
        for one in fronts
        if not one.has_strangers
    ]
    if games < _FEW:
        lines.append(f"{games} games choose the worst attack, which is mostly chance; give {_FEW} or more.")
    return lines


def write_report(out: Path, report: Report) -> None:
    """Write the page, the figure and the tables into a folder."""
    found, rows = report.found, report.rows
    header = ("iteration", *_with_ends(_WINS))
    write_csv(out / "iterations.csv", header, [[one.number, *_cells(one, _WINS)] for one in found])
    write_csv(
        out / "comparison.csv", ("model", *_with_ends(_SKILLS)), [[row.name, *_cells(row, _SKILLS)] for row in rows]
    )
    pairs = [(name, row) for name, over in report.leads.items() for row in over]
    header = ("model", "beside", *_with_ends(_SKILLS))
    write_csv(out / "leads.csv", header, [[name, row.name, *_cells(row, _SKILLS)] for name, row in pairs])
    at = [one.number + 1 for one in found]
    wins = {"either side": "nash_conv", "attackers": "attack", "defence": "defence"}
    skills = {"mixture, attackers respond": "worst", "best model alone": "single"}
    names = [row.name for row in rows]
    strangers = _strangers(names, rows)
    panels = [
        Panel("what a best response wins", "iteration", "skill", _lines(at, found, wins)),
        Panel("the defence", "iteration", "skill", _lines(at, found, skills)),
        Panel("at the end: the worst attacker found", "", "skill", [Series("met", names, [row.worst for row in rows])]),
        *([Panel("attackers that nobody has met", "", "skill", strangers)] if strangers else ()),
    ]
    fronts, runs = report.games[0].fronts, len(report.games)
    played = f"{runs} runs, 95% intervals over runs and games" if runs > 1 else "95% intervals over games"
    each = "`defence.json` of each run" if runs > 1 else "`defence.json`"
    note = f"{len(fronts)} condition{'s' * (len(fronts) > 1)} of {fronts[0].condition.suite.name}, {played}"
    question = "What do trust models and attackers reach when both are trained against each other?"
    write_figure(out / "defence.png", panels_figure(question, panels, note), colours=256)
    won = [[str(one.number + 1), *_texts(one, _WINS)] for one in found]
    tables = [
        markdown_table(["iteration", *_WINS.values()], won, names=1),
        _WINS_LEGEND,
        markdown_table(
            ["model", *_SKILLS.values()], [[f"`{row.name}`", *_texts(row, _SKILLS)] for row in rows], names=1
        ),
        _SKILLS_LEGEND,
        markdown_table(
            ["model", "beside", *_SKILLS.values()],
            [[f"`{name}`", f"`{row.name}`", *_texts(row, _SKILLS)] for name, row in pairs],
            names=2,
        ),
        _LEADS_LEGEND,
        *report.warnings,
        _mixture(report.games),
        f"{note}. Made by `{report.command}`; {each} has the settings, the software and every step.",
    ]
    write_text(out / "defence.md", "\n\n".join(tables) + "\n")


def _lines(at: Sequence[int], found: Sequence[Iteration], names: dict[str, str]) -> list[Series]:
    return [Series(label, at, [getattr(one, name) for one in found]) for label, name in names.items()]


def _strangers(names: Sequence[str], rows: Sequence[Row]) -> list[Series]:
    kinds = {"in the same worlds": "strangers", "in other worlds": "worlds"}
    return [
        Series(label, names, [getattr(row, kind) for row in rows])
        for label, kind in kinds.items()
        if all(getattr(row, kind) for row in rows)
    ]


def _mixture(games: Sequence[Game]) -> str:
    """Return the mean equilibrium at the end in words, with the numbers of the learned models in that of one run."""
    last = games[0].setup.iterations
    weights = np.mean([game.solution(last).models for game in games], axis=0)
    models = {
        name: _described(name, spec) if len(games) == 1 else name
        for name, spec in games[0].known(last).defences.items()
    }
    parts = [f"{text}: {weight:.0%}" for text, weight in zip(models.values(), weights, strict=True) if weight >= _SHOWN]
    return f"The defence's mixture at the end: {'; '.join(parts)}."


def _described(name: str, spec: str) -> str:
    """Return a model with its numbers; those of a network are too many."""
    return name if len(spec) > LONGEST or spec == name else f"{name} (`{spec}`)"


def _with_ends(columns: Iterable[str]) -> list[str]:
    return [f"{name}{end}" for name in columns for end in ("", "_low", "_high")]


def _cells(one: Iteration | Row, columns: Iterable[str]) -> list[float | None]:
    return [x for name in columns for x in getattr(one, name) or (None,) * 3]


def _texts(one: Iteration | Row, columns: Iterable[str]) -> list[str]:
    return [_text(getattr(one, name)) for name in columns]


def _text(value: Interval | None) -> str:
    return "" if value is None else f"{value.value + 0.0:.3f} ± {(value.high - value.low) / 2:.3f}"


def print_report(report: Report) -> None:
    """Print the tables, each with its legend."""
    table = number_table("Iterations", _WINS_LEGEND, *_WINS.values(), name="iteration")
    for one in report.found:
        table.add_row(str(one.number + 1), *_texts(one, _WINS))
    console.print(table)
    table = number_table("Trust models at the end", _SKILLS_LEGEND, *_SKILLS.values(), name="model")
    for row in report.rows:
        table.add_row(escape(row.name), *_texts(row, _SKILLS))
    console.print(table)
    for name, over in report.leads.items():
        table = number_table(f"Lead of {escape(name)}", _LEADS_LEGEND, *_SKILLS.values(), name="beside")
        for row in over:
            table.add_row(escape(row.name), *_texts(row, _SKILLS))
        console.print(table)
