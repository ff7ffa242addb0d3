"""Panels of means: their note stands above the legend, and all in the figure."""

import pytest

from roletrust_env.metrics.confidence import Interval
from roletrust_experiments.plots.charts import Panel, Series, panels_figure


@pytest.mark.parametrize("many", [1, 2, 12])
def test_the_note_has_a_place_of_its_own(many):
    series = [
        Series(f"from honest play {k}", [1, 2], [Interval(0.5, 0.4, 0.6)] * 2) for k in range(many)
    ]
    figure = panels_figure(
        "What?", [Panel("left", "iteration", "skill", series)] * 2, "4 conditions of standard"
    )
    figure.draw_without_rendering()
    notes = [figure.get_supxlabel(), *(legend.get_title().get_text() for legend in figure.legends)]
    assert "4 conditions of standard" in notes
    assert bool(figure.legends) == (many > 1)
    for legend in figure.legends:
        box = legend.get_window_extent()
        assert figure.bbox.padded(1).contains(*box.min)
        assert figure.bbox.padded(1).contains(*box.max)
