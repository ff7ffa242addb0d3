"""Style of each model: a colour, a dash and a mark, so that colour is never the only difference."""

from collections.abc import Sequence
from typing import NamedTuple

from roletrust_experiments.plots.style import ATTACKERS, HONEST

COLOURS = (HONEST[0], ATTACKERS[0], HONEST[1], ATTACKERS[2], ATTACKERS[1], HONEST[2], ATTACKERS[3])
DASHES: tuple[tuple[int, ...], ...] = ((), (7, 3), (2, 2), (9, 3, 2, 3))
MARKS = ("circle", "square", "triangle", "diamond", "inverted_triangle")


class Look(NamedTuple):
    """Style of a model.

    Attributes:
        colour: Colour of its line and its marks.
        dash: Lengths of strokes and gaps in pixels; empty for a solid line.
        mark: Name of its mark in Bokeh.
    """

    colour: str
    dash: tuple[int, ...]
    mark: str


def looks(models: Sequence[str]) -> dict[str, Look]:
    """Return a style for each model; the first 28 have different lines, and the first 35 different marks."""
    return {model: Look(COLOURS[k % 7], DASHES[k % 4], MARKS[k % 5]) for k, model in enumerate(models)}
