"""The paper's Figures 3 and 4, and what the cameras saw, as pictures."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

from roletrust_env.evaluation.curves import Curves
from roletrust_env.storage.files import write_csv
from roletrust_env.world.scenario import Scenario
from roletrust_experiments.paper.figures import COLUMNS, Paper
from roletrust_experiments.plots.figure_files import write_figure
from roletrust_experiments.plots.style import ATTACKED, ATTACKER, DASHES, HONEST, INK, PERTURBED, QUIET, shade, tidy


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
    """Return a figure with trust of raters above trust of providers, over time, and the runs side by side.

    Args:
        paper: Figure of the paper.
        runs: Curves of one game each, by the name of the run.
        scenario: Scenario with the perturbations.
        note: Note below the figure, on the frames.
    """
    figure = Figure(figsize=(9.6 if len(runs) == 1 else 1.6 + 7.8 * len(runs), 5.6), layout="constrained")
    grid = figure.subplots(2, len(runs), sharex=True, sharey="row", squeeze=False)
    for k, (run, curves) in enumerate(runs.items()):
        _draw((grid[0, k], grid[1, k]), paper, curves, scenario)
        if len(runs) > 1:
            grid[0, k].set_title(run, loc="left", fontsize=10.5, color=INK, pad=28)
        for axes in grid[:, k] if k else ():
            axes.set_ylabel("")
    for axes in grid[:, -1]:
        axes.legend(loc="center left", bbox_to_anchor=(1.005, 0.5), frameon=False, labelcolor=INK, handlelength=2.6)
    figure.suptitle(paper.title, x=0.012, ha="left", fontsize=12.5, fontweight="bold", color=INK)
    if note:
        figure.supxlabel(note, x=0.99, ha="right", fontsize=9, color=QUIET)
    return figure


def _draw(column: tuple[Axes, Axes], paper: Paper, curves: Curves, scenario: Scenario) -> None:
    """Draw one run: ToR in the upper axes, ToP in the lower."""
    upper, lower = column
    period = scenario.period_s
    fast = [(blow.start * period, blow.stop * period) for blow in scenario.perturbations]
    for axes, name, trust in ((upper, "ToR", curves.tor), (lower, "ToP", curves.top)):
        top = axes is upper
        tidy(axes, "trust of raters, ToR" if top else "trust of providers, ToP")
        shade(axes, [(paper.attack.start_s, paper.attack.stop_s)], ATTACKED, paper.label if top else None)
        shade(axes, fast, PERTURBED, "fast target" if top else None)
        for level in paper.levels if top else ():
            axes.hlines(level, *paper.attack, color=INK, linewidth=1, linestyle=":", zorder=5)
            axes.text(paper.attack.stop_s + 0.8, level, f"paper: {level:g}", fontsize=9, va="center", color=INK)
        for i in range(trust.shape[1]):
            label = f"{name}_{i + 1}"
            bad = label == paper.attacker  # its curve lies broad under the others, so that none hides another
            axes.plot(
                curves.time_s,
                trust[:, i, 0],
                color=ATTACKER if bad else HONEST[i],
                linestyle="-" if bad else DASHES[i],
                linewidth=3.4 if bad else 1.7,
                zorder=3 if bad else 4,
                label=f"{label} (attacker)" if bad else label,
            )
    lower.set_xlabel("time (s)", color=INK)
    lower.set_xticks(np.arange(0, curves.time_s[-1] + 1, 10))


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
