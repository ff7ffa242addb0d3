"""How each model is drawn: a colour, a dash and a mark, so that none is told by its colour alone."""

from collections.abc import Sequence
from typing import NamedTuple

from roletrust_experiments.plots.style import ATTACKERS, HONEST

COLOURS = (HONEST[0], ATTACKERS[0], HONEST[1], ATTACKERS[2], ATTACKERS[1], HONEST[2], ATTACKERS[3])
DASHES: tuple[tuple[int, ...], ...] = ((), (7, 3), (2, 2), (9, 3, 2, 3))
MARKS = ("circle", "square", "triangle", "diamond", "inverted_triangle")


class Look(NamedTuple):
    """How a model is drawn.

    Attributes:
        colour: of its line and its marks.
        dash: lengths of strokes and gaps in pixels; empty for a solid line.
        mark: by its name in Bokeh.
    """

    colour: str
    dash: tuple[int, ...]
    mark: str


def looks(models: Sequence[str]) -> dict[str, Look]:
    """A look for each model; no two of the first 28 have the same line, and no two of the first 35 the same mark."""
    return {model: Look(COLOURS[k % 7], DASHES[k % 4], MARKS[k % 5]) for k, model in enumerate(models)}
