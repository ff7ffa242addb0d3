"""The paper's Figures 3 and 4, and what the cameras saw, as pictures."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

from roletrust_env.evaluation.curves import Curves
from roletrust_env.storage.files import write_csv
from roletrust_env.world.scenario import Scenario
from roletrust_experiments.paper.figures import COLUMNS, Paper
from roletrust_experiments.plots.curves import Panel, trust_figure
from roletrust_experiments.plots.figure_files import write_figure
from roletrust_experiments.plots.style import ATTACKER, HONEST, INK, QUIET


class Still(NamedTuple):
    """The images of the cameras in one round.

    Attributes:
        what: Event in the round.
        time_s: Start of the round in seconds.
        frames: Images of all cameras, (P, height, width, 3), RGB.
        perceived: Probability that the person is there, mean over the raters, (P,).
    """

    what: str
    time_s: float
    frames: npt.NDArray[np.uint8]
    perceived: npt.NDArray[np.float64]


def write_paper(
    out: Path, stem: str, paper: Paper, runs: Mapping[str, Curves], scenario: Scenario, note: str | None = None
) -> list[str]:
    """Write one of the paper's figures, as a table of each run and as a picture, and return the names of the files.

    Arguments as for `paper_figure`; tables have the name `stem`, and further ones also that of their run.
    """
    written: list[str] = []
    for run, curves in runs.items():
        written.append(f"{stem}-{run}.csv" if written else f"{stem}.csv")
        rows = zip(curves.time_s.tolist(), *curves.tor[..., 0].T.tolist(), *curves.top[..., 0].T.tolist(), strict=True)
        write_csv(out / written[-1], COLUMNS, rows)
    write_figure(out / f"{stem}.png", paper_figure(paper, runs, scenario, note))
    return [*written, f"{stem}.png"]


def paper_figure(paper: Paper, runs: Mapping[str, Curves], scenario: Scenario, note: str | None = None) -> Figure:
    """Return a figure with trust of raters above trust of providers, over time, for one run after the other.

    Args:
        paper: Figure of the paper.
        runs: Curves of one game each, by the name of the run.
        scenario: Scenario with the perturbations.
        note: Note below the figure, on the frames.
    """
    period, panels = scenario.period_s, []
    for run, curves in runs.items():
        which = f" {run}" if run else ""
        panels.append(Panel(f"trust of raters,{which} ToR", COLUMNS[1:4], curves.tor, curves.time_s))
        panels.append(Panel(f"trust of providers,{which} ToP", COLUMNS[4:], curves.top, curves.time_s))
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
            axes.text(paper.attack.stop_s + 0.8, level, f"paper: {level:g}", fontsize=9, va="center", color=INK)
    return figure


def montage_figure(stills: Sequence[Still]) -> Figure:
    """Return the images of each camera (column) at some times (row), with the probability of a person."""
    columns = len(stills[0].frames)
    layout = ConstrainedLayoutEngine(w_pad=0.03, h_pad=0.03, wspace=0.01, hspace=0.01)
    figure = Figure(figsize=(3.1 * columns + 0.4, 2.45 * len(stills) + 0.3), layout=layout)
    grid = figure.subplots(len(stills), columns, squeeze=False)
    for k, (row, still) in enumerate(zip(grid, stills, strict=True)):
        for j, axes in enumerate(row):
            axes.imshow(still.frames[j])
            axes.set_xticks([])
            axes.set_yticks([])
            sure = float(still.perceived[j])
            for spine in axes.spines.values():
                spine.set(color=HONEST[1] if sure > 0.5 else ATTACKER, linewidth=2.2)
            axes.text(
                0.97,
                0.05,
                f"P(person) = {sure:.2f}",
                transform=axes.transAxes,
                ha="right",
                va="bottom",
                fontsize=9.5,
                color="white",
                bbox={"facecolor": "black", "alpha": 0.65, "linewidth": 0, "boxstyle": "round,pad=0.3"},
            )
            if k == 0:
                axes.set_title(f"camera of SP_{j + 1}", fontsize=10.5, color=INK)
        row[0].set_ylabel(f"{still.what}\n{still.time_s:g} s", fontsize=10.5, color=INK)
    figure.supxlabel("green frame: a person is seen; orange: none", fontsize=9, color=QUIET)
    return figure
