"""The paper's Figures 3 and 4 as files."""

from collections.abc import Mapping
from pathlib import Path

from matplotlib.figure import Figure

from roletrust_env.evaluation.curves import Curves
from roletrust_env.storage.files import write_csv, write_json
from roletrust_env.world.scenario import Scenario
from roletrust_experiments.paper.figures import COLUMNS, Figures, Paper, loop_note
from roletrust_experiments.plots.curves import Panel, trust_figure
from roletrust_experiments.plots.figure_files import write_figure
from roletrust_experiments.plots.style import INK


def write_figures(found: Figures, out: Path) -> list[str]:
    """Write both figures as tables and pictures, and the claims as `results.json`; return the names
    of the files.

    Raises:
        OSError: A file cannot be written.
    """
    scenario, note = found.game.scenario, loop_note(found.game)
    written = [
        name
        for paper, curves in zip(found.papers, found.curves, strict=True)
        for name in write_paper(out, f"figure{paper.number}", paper, {"": curves}, scenario, note)
    ]
    written.append("results.json")
    write_json(out / "results.json", {**found.data(), "files": written})
    return written


def write_paper(
    out: Path,
    stem: str,
    paper: Paper,
    runs: Mapping[str, Curves],
    scenario: Scenario,
    note: str | None = None,
) -> list[str]:
    """Write one of the paper's figures, as a table of each run and as a picture, and return the
    names of the files.

    Arguments as for `paper_figure`; tables have the name `stem`, and further ones also that of
    their run.
    """
    written: list[str] = []
    for run, curves in runs.items():
        written.append(f"{stem}-{run}.csv" if written else f"{stem}.csv")
        rows = zip(
            curves.time_s.tolist(),
            *curves.tor[..., 0].T.tolist(),
            *curves.top[..., 0].T.tolist(),
            strict=True,
        )
        write_csv(out / written[-1], COLUMNS, rows)
    write_figure(out / f"{stem}.png", paper_figure(paper, runs, scenario, note))
    return [*written, f"{stem}.png"]


def paper_figure(
    paper: Paper, runs: Mapping[str, Curves], scenario: Scenario, note: str | None = None
) -> Figure:
    """Return a figure with trust of raters above trust of providers, over time, for one run after
    the other.

    Args:
        paper: Figure of the paper.
        runs: Curves of one game each, by the name of the run.
        scenario: Scenario with the perturbations.
        note: Note below the figure, on the frames.
    """
    period, panels = scenario.period_s, []
    for run, curves in runs.items():
        which = f" {run}" if run else ""
        panels.append(
            Panel(f"trust of raters,{which} ToR", COLUMNS[1:4], curves.tor, curves.time_s)
        )
        panels.append(
            Panel(f"trust of providers,{which} ToP", COLUMNS[4:], curves.top, curves.time_s)
        )
    figure = trust_figure(
        paper.title,
        panels,
        max(float(curves.time_s[-1]) for curves in runs.values()),
        attackers=[paper.attacker],
        attacks=[paper.attack],
        perturbed=[(blow.start * period, blow.stop * period) for blow in scenario.perturbations],
        labels=(paper.label, "fast target"),
        notes=[note] if note else [],
    )
    for axes in figure.axes[::2]:
        for level in paper.levels:
            axes.hlines(level, *paper.attack, color=INK, linewidth=1, linestyle=":", zorder=5)
            axes.text(
                paper.attack.stop_s + 0.8,
                level,
                f"paper: {level:g}",
                fontsize=9,
                va="center",
                color=INK,
            )
    return figure
