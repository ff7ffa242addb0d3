"""The figure of an answer: its note and its legend do not lie on each other."""

import pytest

from roletrust_env.metrics.confidence import Interval
from studies.charts import Panel, Series, panels_figure

pytestmark = pytest.mark.slow

NOTE = "4 conditions of standard, 95% intervals over games"


def panels(labels):
    series = [Series(label, [1, 2], [Interval(0.5, 0.4, 0.6)] * 2) for label in labels]
    return [Panel("left", "iteration", "skill", series), Panel("right", "iteration", "skill", series)]


@pytest.mark.parametrize("many", [1, 2, 4, 8, 12])
def test_the_note_has_a_place_of_its_own(many):
    labels = [f"from honest play {k}" for k in range(many)]
    figure = panels_figure("What?", panels(labels), NOTE)
    figure.draw_without_rendering()
    below = figure.get_supxlabel()
    (*legends,) = figure.legends
    assert NOTE in [below, *(legend.get_title().get_text() for legend in legends)]
    for legend in legends:
        boxes = [text.get_window_extent() for text in legend.get_texts()]
        if below:
            (note,) = [text for text in figure.texts if text.get_text() == below]
            assert not any(box.overlaps(note.get_window_extent()) for box in boxes)
        inside = figure.bbox.padded(1)
        assert all(inside.contains(*corner) for box in boxes for corner in box.corners())
