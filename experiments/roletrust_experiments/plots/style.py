"""Style of all figures: colours for colour-blind readers (Okabe and Ito 2008), and plain axes."""

from collections.abc import Iterable
from typing import Literal

from matplotlib.axes import Axes

ATTACKER = "#D55E00"
ATTACKERS = (ATTACKER, "#CC79A7", "#E69F00", "#8C510A")
HONEST = ("#0072B2", "#009E73", "#56B4E9", "#000000")
DASHES = ("-", (0, (5, 1.6)), (0, (1.2, 1.2)), (0, (6, 1.6, 1.2, 1.6)))
INK, QUIET = "#222222", "#6B7280"
PERTURBED, ATTACKED = "#9CA3AF", "#FBE3D2"


def quiet(axes: Axes, along: Literal["x", "y", "both"]) -> None:
    """Draw a light grid along an axis, and no frame at the top and on the right."""
    axes.grid(axis=along, color="#E5E7EB", linewidth=0.8)
    axes.set_axisbelow(True)
    axes.tick_params(colors=QUIET, labelcolor=INK, length=3)
    axes.spines[["top", "right"]].set_visible(False)


def tidy(axes: Axes, label: str) -> None:
    """Set a trust axis from 0 to 1 with a light grid."""
    axes.set_ylim(-0.03, 1.05)
    axes.set_yticks([0, 0.25, 0.5, 0.75, 1], ["0", "", "0.5", "", "1"])
    axes.set_ylabel(label, color=INK)
    quiet(axes, "y")
    axes.margins(x=0)
    axes.spines[["left", "bottom"]].set_color("#9CA3AF")


def shade(
    axes: Axes, windows: Iterable[tuple[float, float]], colour: str, label: str | None = None
) -> None:
    """Shade time intervals, with a label above each; labels of attacks are a line higher than
    others.
    """
    attack = colour == ATTACKED
    for start, stop in windows:
        axes.axvspan(
            start,
            stop,
            color=colour,
            alpha=1.0 if attack else 0.38,
            linewidth=0,
            zorder=0.1 if attack else 0.2,
        )
        if label:
            axes.text(
                (start + stop) / 2,
                1.1 if attack else 1.02,
                label,
                transform=axes.get_xaxis_transform(),
                ha="center",
                va="bottom",
                fontsize=9,
                color=ATTACKER if attack else QUIET,
            )
