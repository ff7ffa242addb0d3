"""What the paper says, held against a run that is too short or has holes."""

import numpy as np
import pytest
from refusals import refuses

from roletrust_env import make_scenario
from roletrust_env.evaluation.curves import Curves
from roletrust_experiments.paper.claims import Window, check_bad_mouthing

SCENARIO, ATTACK = make_scenario("paper-3x3"), Window(20.0, 45.0)


@pytest.mark.parametrize(
    ("gone", "words"),
    [
        ((0, 20), ("calmly",)),
        ((15, 18), ("18",)),
        ((18, 20.5), ("18", "20")),
        ((20, 60), ("steadily",)),
    ],
)
def test_a_run_without_the_rounds_it_takes_is_refused_in_one_line(gone, words):
    """As on a machine that is too slow for its robots."""
    times = np.arange(0.5, 60.5, 0.5)
    times = times[(times < gone[0]) | (times > gone[1])]
    trust = np.ones((len(times), 3, 1))
    with refuses(ValueError, *words):
        check_bad_mouthing(Curves(times, trust, trust, trust, trust, trust), SCENARIO, ATTACK)
