"""What is measured without noise is what the paper's equations come to."""

import numpy as np
import pytest

from roletrust_baselines import BadMouthing
from roletrust_env import make_scenario
from studies.questions import dilution, noise
from studies.questions.answers import Effort, honest, last, lost, play

pytestmark = pytest.mark.slow


@pytest.fixture
def asked():
    return Effort(games=3, seed=0, quick=False)


@pytest.mark.parametrize(
    ("size", "liars", "level"), [(3, 1, 0.5), (9, 3, 0.5), (9, 1, 0.0), (30, 10, 0.5)]
)
def test_dilution(asked, size, liars, level):
    crowd = make_scenario("crowd-10x10")
    groups = [{**group.model_dump(), "count": size} for group in crowd.agents]
    scenario = crowd.change(agents=groups, noise=0.0, max_cycles=60)
    attackers = dict.fromkeys(last(scenario, "SR", liars), BadMouthing(level=level))
    struck, calm = play(asked, scenario, attackers), play(asked, scenario)
    tor, top = struck.trust[-1, 0], struck.trust[-1, size]
    of_raters, of_providers = dilution.closed_form(liars / size, level)
    np.testing.assert_allclose(
        [1 - tor, 1 - top], np.array([[of_raters], [of_providers]]) + np.zeros(3), atol=1e-6
    )
    both = ((size - liars) * of_raters + size * of_providers) / (2 * size - liars)
    np.testing.assert_allclose(lost(struck, calm, honest(scenario, attackers)), both, atol=1e-3)


def test_the_share_of_liars_alone_decides_without_noise():
    """The steady state of Figure 4: ToR 0.5918 and ToP 0.4393 for one liar of three."""
    np.testing.assert_allclose(
        1 - np.array(dilution.closed_form(1 / 3, 0.5)), [0.5918, 0.4393], atol=5e-5
    )


def test_noise(asked):
    many = asked._replace(games=40)
    crowd = make_scenario("crowd-10x10").change(max_cycles=40)
    groups = [
        group.model_dump() | ({"ability": 0.5} if group.role == "SP" else {})
        for group in crowd.agents
    ]
    runs = [play(many, crowd.change(agents=groups).change(noise=level)) for level in (0.05, 0.0)]
    assert lost(*runs, range(10)).mean() == pytest.approx(noise.closed_form(0.05, 10), abs=0.002)


def test_the_same_luck_meets_who_attacks_and_who_does_not(asked):
    scenario = make_scenario("crowd-10x10").change(max_cycles=12)
    later = dict.fromkeys(last(scenario, "SR", 2), BadMouthing(start=8))
    struck, calm = play(asked, scenario, later), play(asked, scenario)
    np.testing.assert_array_equal(struck.trust[:8], calm.trust[:8])
    assert (struck.trust[-1] < calm.trust[-1])[:8].all()
