"""What the paper says, held against a run that is too short or has holes."""

import numpy as np
import pytest

from roletrust_env import make_scenario
from roletrust_env.evaluation.curves import Curves
from roletrust_experiments.paper.claims import Window, check_bad_mouthing

SCENARIO, ATTACK = make_scenario("paper-3x3"), Window(20.0, 45.0)


@pytest.mark.parametrize(
    ("gone", "said"),
    [
        ((0, 20), "no round calmly before the attack"),
        ((15, 18), "no round just before 18 s"),
        ((18, 20.5), "no round from 18 to 20 s"),
        ((20, 60), "no round steadily under the attack"),
    ],
)
def test_a_run_without_the_rounds_it_takes_is_refused_in_one_line(gone, said):
    """As on a machine that is too slow for its robots."""
    times = np.arange(0.5, 60.5, 0.5)
    times = times[(times < gone[0]) | (times > gone[1])]
    trust = np.ones((len(times), 3, 1))
    with pytest.raises(ValueError, match=said):
        check_bad_mouthing(Curves(times, trust, trust, trust, trust, trust), SCENARIO, ATTACK)
