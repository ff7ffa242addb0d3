"""The words of an answer say what its numbers say."""

import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from roletrust_env.metrics.confidence import Estimate, estimate
from studies.questions import admission, both_roles, dilution, movement, noise
from studies.questions.answers import amount, in_words, listed, sign, verdict

pytestmark = pytest.mark.slow

MORE, LESS, OPEN = Estimate(0.2, 0.1), Estimate(-0.2, 0.1), Estimate(0.1, 0.2)

estimates = st.builds(Estimate, st.floats(-1, 1), st.floats(0, 1))


@given(estimates)
def test_rounded_numbers_lie_on_the_same_side_of_0_as_the_exact_ones(one):
    mean, half = map(float, re.findall(r"-?\d+\.\d+", amount(one)))
    assert sign(Estimate(mean, half)) == sign(one) or abs(abs(one.mean) - one.half) < 1e-8


@given(estimates)
def test_a_difference_is_told_once_and_in_its_direction(one):
    words = in_words(one, "up", "down", "open")
    assert [word in words for word in ("up", "down", "open")] == [
        sign(one) > 0,
        sign(one) < 0,
        sign(one) == 0,
    ]


def test_one_game_shows_nothing():
    assert sign(estimate(np.array([0.5]))) == 0
    assert verdict([Estimate(0.5, float("nan"))]) == "Not shown"


def test_what_is_not_shown_is_bounded_by_its_interval():
    words = listed({"a": MORE, "b": OPEN})
    assert words == "0.200 ± 0.100 more a and neither more nor less b (within ± 0.300)"


def names_of(module):
    """The differences that a question's sentence is made of."""
    if module is admission:
        kinds = admission.GAIN, admission.BLIND, admission.STRICT, admission.CUT
        return [f"{what}, {who}" for what in kinds for who in ("calm", "war")]
    if module is both_roles:
        return [
            f"{name}, {what}" for name in ("liars", "cheats", "seldom") for what in ("gap", "auc")
        ]
    return [
        f"{what}, {radius} m, {other}"
        for what in (movement.HARM, movement.UTILITY)
        for radius in (4, 2)
        for other in (movement.EVERYONE, movement.STILL)
    ]


@pytest.mark.parametrize("module", [admission, both_roles, movement])
def test_a_sentence_turns_with_its_numbers(module):
    names = names_of(module)
    more, less, hidden = (module.sentence(dict.fromkeys(names, one)) for one in (MORE, LESS, OPEN))
    assert (" more" in more, " less" in more) == (True, False)
    assert (" less" in less, " more" in less) == (True, False)
    assert "neither more nor less" in hidden
    assert "0.200 ± 0.100" not in hidden


@pytest.mark.parametrize(
    ("module", "yes", "no"),
    [(admission, MORE, LESS), (both_roles, LESS, MORE)],
)
def test_a_verdict_is_given_only_where_all_numbers_agree(module, yes, no):
    names = names_of(module)
    assert "Yes" in module.sentence(dict.fromkeys(names, yes))
    assert "No, the other way round" in module.sentence(dict.fromkeys(names, no))
    assert "Not shown" in module.sentence(dict.fromkeys(names, OPEN))
    assert "It depends" in module.sentence(dict.fromkeys(names, yes) | {names[0]: no})


def test_dilution_is_told_of_each_kind_of_liars_by_its_own_number():
    names = [
        f"{who}, {lie}"
        for who in ("one liar", "a third lies")
        for lie in ("rate 0.5 as in the paper", "rate 0")
    ]
    falls = [MORE, MORE, OPEN, LESS]
    differences = {f"{dilution.FROM}, {name}": Estimate(0.6, 0.1) for name in names}
    differences |= {
        f"{dilution.FALLS}, {name}": one for name, one in zip(names, falls, strict=True)
    }
    fixed_number, fixed_share = dilution.sentence(differences, 3, 9).split(";")
    assert fixed_number.count("0.200 ± 0.100 less") == 2
    assert "neither more nor less (0.100 ± 0.200)" in fixed_share
    assert "0.200 ± 0.100 more" in fixed_share


@pytest.mark.parametrize(("one", "word"), [(MORE, "more"), (LESS, "less")])
def test_noise_is_told_beside_a_liar(one, word):
    differences = {noise.RATERS: MORE, noise.PROVIDERS: MORE, noise.LIAR: one, noise.SHARE: one}
    assert noise.sentence(differences).count(f"0.200 ± 0.100 {word}") == 2
