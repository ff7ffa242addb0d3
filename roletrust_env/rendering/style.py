"""Style of the pictures of a game: colours, lines and fonts."""

from collections.abc import Sequence
from typing import Any

import matplotlib
import numpy as np
from matplotlib.colors import ListedColormap

SIZE, DPI = (12.8, 7.2), 100


# Perceptually uniform and safe for colour-blind readers; its brightest end is left out, which would vanish on white.
SCALE = ListedColormap(matplotlib.colormaps["viridis"](np.linspace(0, 0.93, 256))).with_extremes(bad="#eef1f5")


INK, GREY, PALE = "#1b2430", "#7b8794", "#eef1f5"


ATTACK = "#d55e00"  # vermilion, which is not on the scale


HONEST = ("#0072b2", "#009e73", "#56b4e9", "#332288")  # distinguishable for colour-blind readers, too


CROWD = "#9fb3c8"


KEYS = ("each honest agent", "their mean", "attackers")


# A few curves stay visible even where they coincide: those of attackers are the widest and lie under the honest ones,
# and within each group every further curve is narrower, dashed, and lies on top.
ATTACKS = (ATTACK, "#cc79a7", "#e69f00", "#8c510a")


DASHES: tuple[tuple[float, Sequence[float]], ...] = ((0, ()), (0, (4, 2.5)), (0, (1.2, 1.8)), (0, (6, 2, 1.2, 2)))


WIDTHS = np.asarray((2.8, 2.0, 1.6, 1.3))


STYLE: dict[Any, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 10,
    "text.color": INK,
    "axes.edgecolor": "#c3cad3",
    "axes.labelcolor": GREY,
    "xtick.color": GREY,
    "ytick.color": GREY,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "text.parse_math": False,
    "toolbar": "None",
}
