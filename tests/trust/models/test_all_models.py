"""What every trust model with a name keeps to, on NumPy; what it computes is tested beside this
file."""

from collections.abc import Callable
from typing import Any

import hypothesis.strategies as st
import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis.extra.numpy import arrays
from model_cases import EVERY_MODEL, RoundRatings, assert_close, named, play, random_rounds, read
from refusals import refuses

from roletrust_env.testing.trust_models import (
    check_batch,
    check_full_rounds,
    check_kinds,
    check_permutation,
    check_purity,
    check_silence,
)
from roletrust_env.trust import Ratings, Traits, make_trust_model, trust_models
from roletrust_env.trust.model import registry

SHAPES = [(3, 3), (1, 4), (4, 1), (1, 1), (2, 5, 6), (4, 2, 3, 2)]
DTYPES = np.float32, np.float64


def in_range(trust: np.ndarray) -> bool:
    return bool(np.all((trust >= 0) & (trust <= 1)))


# --- shapes, kinds, ranges ------------------------------------------------------------------------


@EVERY_MODEL
def test_trust_and_state_keep_their_shapes_and_dtypes(name: str) -> None:
    for shape in SHAPES:
        check_kinds(named(name), shape, np.float64)
    check_kinds(named(name), (2, 5, 6), np.float32)


@st.composite
def games(draw: st.DrawFn) -> list[RoundRatings]:
    """Up to four rounds of any ratings and any masks, in any precision."""
    shape = draw(st.tuples(st.integers(1, 4), st.integers(1, 4)))
    dtype = draw(st.sampled_from([np.float32, np.float64]))
    note = st.floats(0, 1, width=8 * dtype().itemsize) | st.sampled_from([0.0, 0.5, 1.0])
    one_round = st.builds(
        RoundRatings.of, arrays(dtype, shape, elements=note), arrays(np.bool_, shape)
    )
    return draw(st.lists(one_round, min_size=1, max_size=4))


@given(rounds=games())
def test_trust_stays_in_0_to_1_and_finite(rounds: list[RoundRatings]) -> None:
    for name in trust_models():
        model = named(name)
        state = play(model, [], rounds[0].ratings)
        for played in rounds:
            state = model.update(state, played.given())
            assert all(map(in_range, read(model, state))), name


@EVERY_MODEL
def test_trust_of_a_peer_whom_all_rate_0_is_in_range(name: str) -> None:
    """And whom one does not rate: nothing is left for it, or what rounding leaves."""
    model, rng, shape = named(name), np.random.default_rng(0), (9, 9, 20)
    peers, mask = np.eye(9, dtype=bool), np.zeros(shape, bool) | ~np.eye(9, dtype=bool)[..., None]
    mask[1, 0] = False
    for dtype in DTYPES:
        rounds = [RoundRatings.of(rng.random(shape).astype(dtype), mask) for _ in range(4)]
        for ratings, _ in rounds:
            ratings[1:, 0] = 0
        assert all(map(in_range, read(model, play(model, rounds, rounds[0].ratings, peers))))


@EVERY_MODEL
def test_update_leaves_its_inputs_alone_and_takes_rounds_without_ratings_and_without_a_mask(
    name: str,
) -> None:
    """Full and partial rounds in any order, so that the time since a rating is 1 here and more
    there."""
    check_purity(named(name), (3, 2, 4))
    check_silence(named(name), (3, 2, 4))
    for shape in ((3, 3), (1, 1), (2, 5, 6)):
        check_full_rounds(named(name), shape)


# --- agents and games are alike -------------------------------------------------------------------


@EVERY_MODEL
def test_a_batch_is_its_games_one_by_one(name: str) -> None:
    for shape in ((5, 3, 4), (1, 3, 2), (3, 1, 2, 2)):
        check_batch(named(name), shape)


@EVERY_MODEL
def test_permuting_agents_permutes_their_trust(name: str) -> None:
    for seed in range(3):
        check_permutation(named(name), seed)


@EVERY_MODEL
def test_the_order_of_two_halves_of_raters_does_not_matter(name: str) -> None:
    """Who rates 0 where others rate 1: rounding must not take sides, and in the end decide."""
    model = named(name)
    cases: list[tuple[int, Callable[..., Any], type, float]] = [
        *((raters, np.asarray, np.float32, 2e-5) for raters in (4, 10, 13)),
        *((raters, np.asarray, np.float64, 1e-12) for raters in (10, 13)),
        (13, torch.asarray, np.float32, 2e-5),
    ]
    for raters, asarray, dtype, tolerance in cases:
        ratings = np.zeros((raters, 3), dtype)
        ratings[: raters // 2, :2] = ratings[raters // 2 :, 2] = 1
        order = np.random.default_rng(raters).permutation(raters)
        peers, like, full = (
            np.zeros(ratings.shape, bool),
            asarray(np.zeros_like(ratings)),
            ratings >= 0,
        )
        one, other = (
            [
                np.asarray(trust)
                for trust in read(
                    model, play(model, [RoundRatings(f, full)] * 30, like, peers, asarray)
                )
            ]
            for f in (ratings, ratings[order])
        )
        assert_close(other, (one[0][order], one[1]), tolerance)


# --- what there is to say before, without and after ratings
# -----------------------------------------


@EVERY_MODEL
def test_before_any_rating_providers_have_the_initial_trust_and_who_is_not_rated_keeps_it(
    name: str,
) -> None:
    model = named(name)
    for shape in SHAPES:
        start = read(model, play(model, [], np.zeros(shape)))
        assert all(map(in_range, start))
        assert not registry.accepted_parameters(name, {"initial": None}) or np.all(start[1] == 0.3)
        silence = RoundRatings.of(np.zeros(shape), np.zeros(shape, bool))
        assert_close(read(model, play(model, [silence] * 3, np.zeros(shape))), start, 1e-12)


@EVERY_MODEL
def test_where_nobody_rates_trust_stays_or_is_forgotten(name: str) -> None:
    """It stays, or goes back towards that of the start; never further away."""
    model, shape = named(name), (4, 3, 5)
    rounds, silence = random_rounds(shape), RoundRatings.of(np.zeros(shape), np.zeros(shape, bool))
    start = read(model, play(model, [], np.zeros(shape)))
    state = play(model, rounds, np.zeros(shape))
    for _ in range(3):
        before, state = state, model.update(state, Ratings(*silence))
        for origin, old, new in zip(start, read(model, before), read(model, state), strict=True):
            assert np.all(abs(new - origin) <= abs(old - origin) + 1e-12)


# --- what a model says of itself
# ----------------------------------------------------------------------


@EVERY_MODEL
def test_the_family_is_the_folder_and_raters_are_trusted_by_a_model_that_does_not_rate_them(
    name: str,
) -> None:
    model, shape = named(name), (4, 3, 5)
    assert f".models.{Traits.of(model).family}." in type(model).__module__
    raters, _ = read(model, play(model, random_rounds(shape), np.zeros(shape)))
    assert model.rates_raters or np.all(raters == 1)


# --- parameters
# ---------------------------------------------------------------------------------------


@EVERY_MODEL
def test_parameters_out_of_range_unknown_or_not_taken_are_refused(name: str) -> None:
    for lam, initial in ((0.5, 0), (0.999, 1)):
        assert make_trust_model(
            name, **registry.accepted_parameters(name, {"lam": lam, "initial": initial})
        )
    wrong = [("lam", value, "[0.5, 1)") for value in (-1.0, 0.49, 1.0, 2.0, float("nan"))]
    wrong += [("initial", value, "[0, 1]") for value in (-0.01, 1.01, float("nan"))]
    for field, value, allowed in wrong:
        taken = registry.accepted_parameters(name, {field: value})
        with refuses(ValueError, field, *((value, allowed) if taken else ())):
            make_trust_model(name, **{field: value})
    with refuses(ValueError, "lambda", name):
        make_trust_model(name, **{"lambda": 0.5})


REFUSED = {
    "beta": {"keep": [1.1]},
    "beta-filtered": {"q": [0.5]},
    "blade": {"levels": [1], "keep": [0.0, 1.1]},
    "fire": {"tolerance": [0], "credibility": [-0.1], "initial": [1.1]},
    "first-hand": {"own": [-1, 0, np.inf, np.nan]},
    "habit": {"levels": [1], "alpha": [0.0]},
    "huber-mean": {"width": [0]},
    "qor": {"theta": [0, 1.1], "initial": [-1]},
    "subjective-logic": {"initial": [-0.5]},
    "travos": {"error": [-0.1], "threshold": [1.5], "bins": [0]},
    "trimmed-mean": {"share": [0.5, -0.1]},
    "wary-role-trust": {"rise": [0, 1.1], "power": [-1, 9], "keep": [1.1], "shock": [-0.1]},
    "yu-singh": {"beta": [0], "memory": [0], "initial": [2]},
}
"""Values out of range, by model and parameter."""


@pytest.mark.parametrize(
    ("name", "field", "value"),
    [
        (name, field, one)
        for name, fields in REFUSED.items()
        for field, values in fields.items()
        for one in values
    ],
)
def test_parameters_out_of_range_are_refused(name: str, field: str, value: float) -> None:
    with refuses(ValueError, field, value):
        make_trust_model(name, **{field: value})
