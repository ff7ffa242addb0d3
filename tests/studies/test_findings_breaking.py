"""Where a model breaks, read off made-up numbers, and of a model that nothing can break."""

import pytest

from roletrust_env.metrics.confidence import Estimate
from studies.questions.breaking import Break, breaking, sentence

pytestmark = pytest.mark.slow


def over(*means, half=0.05):
    """What is left beyond a half with more and more liars."""
    return {round(0.1 * k, 1): Estimate(mean, half) for k, mean in enumerate(means)}


def test_it_breaks_between_the_last_share_that_holds_and_the_first_that_does_not():
    found = breaking(over(0.5, 0.3, 0.1, -0.1, -0.3))
    assert found == pytest.approx(Break(0.25, 0.2, 0.3))


def test_what_is_not_shown_widens_the_interval():
    found = breaking(over(0.5, 0.03, -0.03, -0.3))
    assert found == pytest.approx(Break(0.15, 0.0, 0.3))


def test_a_model_that_recovers_has_broken_all_the_same():
    assert breaking(over(0.5, -0.5, 0.5))[1:] == (0.0, 0.1)


def test_one_that_never_breaks_is_said_to_hold():
    found = breaking(over(0.5, 0.4, 0.3))
    assert found == Break(1.0, 0.2, 1.0)
    assert "over 20% (if at all) lie with rock" in sentence({"rock": found}, set(), {})


def test_the_sentence_names_every_model_once_and_why_some_are_not_measured():
    breaks = {"b": Break(0.25, 0.2, 0.3), "a": Break(0.22, 0.2, 0.3), "c": Break(0.45, 0.4, 0.5)}
    words = sentence(breaks, {"constant"}, {"mine": "returned NaN"})
    assert "20% to 30% lie with a, b; 40% to 50% lie with c" in words
    assert words.endswith("; nothing to lose without liars: constant; not measured: mine (returned NaN).")
