"""The lies of a coalition, and their figure."""

import numpy as np
import pytest

from roletrust_baselines import BadMouthing
from roletrust_env.evaluation.attackers import Scripted
from studies.coalition import lies_figure, watch_lies

pytestmark = pytest.mark.slow

ARGUMENTS = {
    "scenario": "crowd-10x10",
    "agents": [{"role": "SR", "count": 4}, {"role": "SP", "count": 3, "ability": [0.4, 1.0]}],
    "max_cycles": 8,
    "compromised": ["sr_2", "sr_3"],
    "objective": "mislead",
    "noise": 0.0,
    "perturbations": [],
}


def test_who_rates_everybody_0_lies_most_about_the_best():
    """The lie is the whole quality, so it falls with the true place, and such raters lose trust."""
    zero = {name: BadMouthing(level=0.0) for name in ARGUMENTS["compromised"]}
    lies = watch_lies(ARGUMENTS, Scripted(zero), games=5)
    assert lies.by_place.shape == (3, 5)
    assert (np.diff(lies.by_place, axis=0) > 0).all()
    assert -1 <= lies.by_place.min() < lies.by_place.max() <= -0.4
    assert lies.own.shape == lies.honest.shape == (8,)


def test_the_figure_has_a_line_for_each_side():
    lies = watch_lies(ARGUMENTS, Scripted({}), games=2)
    np.testing.assert_allclose(lies.by_place, 0, atol=1e-12)
    left, right = lies_figure(lies).axes
    np.testing.assert_array_equal(left.lines[0].get_xdata(), [1, 2, 3])
    np.testing.assert_allclose(left.lines[0].get_ydata(), 0, atol=1e-12)
    assert [line.get_label() for line in right.lines] == ["liars", "honest raters"]
