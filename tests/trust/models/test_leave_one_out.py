"""Leave-one-out trust, against its formulas loop by loop, and what each of its parts is for."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from model_cases import Matrix, Vector, assert_matches, named, read

from roletrust_env.trust import Ratings, make_trust_model
from roletrust_env.trust.models.central.leave_one_out import LeaveOneOut

INITIAL, KEEP, PRIOR, POWER, DOUBT = 0.3, 0.9, 0.2, 6.0, 0.8  # of `named`


def reference(
    rounds: Sequence[tuple[Matrix, Matrix]],
    peers: Matrix,
    own: float = 0.0,
    limit: float = 1.0,
    modesty: float = 1.0,
) -> Iterator[tuple[Vector, Vector]]:
    raters, providers = range(len(peers)), range(len(peers[0]))
    tor = [DOUBT**POWER for _ in raters]
    said: dict[tuple[int, int], tuple[float, float]] = {}  # sum of ratings and their number, faded
    for ratings, mask in rounds:
        met = [(i, j) for i in raters for j in providers if mask[i][j]]
        rated = {j for _, j in met}
        said = {
            (i, j): tuple(KEEP * x if j in rated else x for x in pair)
            for (i, j), pair in said.items()
        }  # type: ignore[misc]
        for i, j in met:
            total, count = said.get((i, j), (0.0, 0.0))
            said[i, j] = total + ratings[i][j], count + 1

        def weigh(tor: Vector, said: Any = said) -> dict[tuple[int, int], tuple[float, float]]:
            return {
                (i, j): (n / (1 + limit * n) * tor[i], s / n) for (i, j), (s, n) in said.items()
            }

        def base(weights: Any) -> float:
            means = []
            for j in {j for _, j in weights}:
                of = [weights[i, k] for i, k in weights if k == j]
                total = sum(w for w, _ in of)
                means.append(sum(w * x for w, x in of) / total if total > 0 else INITIAL)
            middle = sorted(means)[len(means) // 2] if len(means) > 1 else INITIAL
            return INITIAL - modesty * max(INITIAL - middle, 0)

        weights, after = weigh(tor), list(tor)
        b = base(weights)
        for i in {i for i, _ in met}:
            agreed, compared = DOUBT, 1.0
            for j in [k for h, k in said if h == i]:
                others = [
                    ((own if h == i else 1) * w, x)
                    for (h, k), (w, x) in weights.items()
                    if k == j and (own or h != i)
                ]
                heard = sum(w for w, _ in others)
                view = (PRIOR * b + sum(w * x for w, x in others)) / (PRIOR + heard)
                total, count = said[i, j]
                evidence = count / (1 + limit * count) * heard / (heard + PRIOR)
                agreed += evidence * (1 - abs(total / count - view))
                compared += evidence
            after[i] = (agreed / compared) ** POWER
        tor, weights = after, weigh(after)
        b, top = base(weights), []
        for j in providers:
            of = [weights[i, k] for i, k in weights if k == j]
            top.append((PRIOR * b + sum(w * x for w, x in of)) / (PRIOR + sum(w for w, _ in of)))
        yield tor, top


def test_the_model_matches_its_reference() -> None:
    assert_matches(named("leave-one-out"), reference)


@pytest.mark.parametrize(
    "parts", [{"own": 0.5}, {"limit": 0.0}, {"modesty": 0.0}, {"own": 1.0, "limit": 0.3}], ids=str
)
def test_without_a_part_it_matches_it_too(parts: dict[str, float]) -> None:
    model = make_trust_model("leave-one-out", initial=INITIAL, **parts)
    assert_matches(model, lambda rounds, peers: reference(rounds, peers, **parts))


def after(rounds: Sequence[Any], **parameters: float) -> tuple[np.ndarray, np.ndarray]:
    """Both trusts after rounds of ratings, NaN where there is none."""
    model = make_trust_model("leave-one-out", **parameters)
    state = model.start(np.zeros(np.shape(rounds[0])))
    for ratings in rounds:
        state = model.update(state, Ratings(ratings, ratings == ratings))
    raters, providers = map(np.asarray, read(model, state))
    return raters, providers


def test_a_rating_that_is_alone_says_nothing_of_its_rater() -> None:
    alone = np.array([[0.0, np.nan], [np.nan, 1.0]])
    assert after([alone] * 5)[0] == pytest.approx([DOUBT**POWER] * 2)
    assert after([alone] * 5, own=1)[0] != pytest.approx([DOUBT**POWER] * 2, abs=0.01)


def test_a_minority_of_liars_loses_its_weight() -> None:
    lies = [np.array([[1.0] * 3] * 3 + [[0.0] * 3])] * 60
    raters, providers = after(lies)
    assert raters[:3] == pytest.approx([raters[0]] * 3)
    assert raters[3] < raters[0] / 100
    assert providers == pytest.approx([1, 1, 1], abs=0.1)
    assert after(lies, power=0)[1] == pytest.approx(
        [0.75] * 3, abs=0.05
    )  # every rater counts alike


def test_who_repeats_itself_does_not_outvote_the_others() -> None:
    """Three honest raters once, then a liar by itself forty times: of those voices it has one."""
    once, lie = np.array([[1.0]] * 3 + [[np.nan]]), np.array([[np.nan]] * 3 + [[0.0]])
    game = [once, *[lie] * 40]
    assert after(game, keep=1, power=0)[1][0] == pytest.approx((1.5 + 0.1) / (1.5 + 40 / 41 + 0.2))
    assert after(game, keep=1, power=0, limit=0)[1][0] == pytest.approx((3 + 0.1) / (43 + 0.2))


@given(
    ratings=arrays(np.float64, (4, 7), elements=st.floats(0, 1)),
    mask=arrays(np.bool_, (4, 7)),
    rounds=st.integers(1, 3),
    initial=st.sampled_from([0.2, 0.5, 1.0]),
)
def test_the_unrated_outrank_no_more_than_half_of_the_rated(
    ratings: np.ndarray, mask: np.ndarray, rounds: int, initial: float
) -> None:
    mask[:, 0] = False  # nobody rates the first
    model = LeaveOneOut(initial=initial)
    state = model.start(ratings)
    for turn in range(rounds):
        state = model.update(state, Ratings(np.roll(ratings, turn, 0), mask))
    trust, rated = model.provider_trust(state), mask.any(axis=0)
    if rated.sum() > 1:
        assert (trust[rated] < trust[0] - 1e-9).sum() <= rated.sum() // 2
    assert trust[0] <= initial + 1e-12


@pytest.mark.parametrize("modesty", [0.0, 1.0])
def test_where_most_are_bad_a_newcomer_is_no_better(modesty: float) -> None:
    bad = np.array([[0.1, 0.1, 0.2, np.nan]] * 3)
    trust = after([bad] * 20, modesty=modesty)[1]
    assert trust[3] == pytest.approx(0.1 if modesty else 0.5, abs=0.01)
    assert (trust[3] <= trust[2]) == bool(modesty)


def test_the_trust_of_a_rater_counts_for_its_earlier_ratings_too() -> None:
    """A rater that is found to lie about others loses weight where nobody rates any more."""
    first = np.array([[np.nan, 0.0], [1.0, np.nan], [1.0, np.nan]])
    then = [np.array([[0.0, np.nan], [1.0, np.nan], [1.0, np.nan]])] * 10
    before, later = after([first])[1][1], after([first, *then])[1][1]
    assert later > before + 0.1
