"""Wary role-trust, against its formulas loop by loop, and what each of its parts is for."""

from collections.abc import Callable, Iterator, Sequence
from itertools import product
from math import sqrt
from typing import Any

import numpy as np
import pytest
import torch
from model_cases import Matrix, Vector, assert_matches, named, read
from reference import sinc

from roletrust_env.trust import Ratings, make_trust_model

LAM, INITIAL = 0.7, 0.3  # of `named`
RISE, POWER, KEEP, SHOCK = 0.1, 2.0, 0.5, 0.1


def weighted(notes: Vector, weights: Vector) -> float:
    return sum(w * f for w, f in zip(weights, notes, strict=True)) / sum(weights)


def reference(
    rounds: Sequence[tuple[Matrix, Matrix]], peers: Matrix
) -> Iterator[tuple[Vector, Vector]]:
    raters, providers = range(len(peers)), range(len(peers[0]))
    tor, top = [INITIAL for _ in raters], [INITIAL for _ in providers]
    last: dict[tuple[int, int], float] = {}
    when: dict[tuple[int, int], int] = {}
    for now, (ratings, mask) in enumerate(rounds):
        met = [(i, j) for i in raters for j in providers if mask[i][j]]
        last |= {(i, j): ratings[i][j] for i, j in met}
        when |= dict.fromkeys(met, now)

        def opinions(
            j: int, tor: Vector, when: Any = when, now: int = now
        ) -> tuple[list[int], list[float]]:
            who = [i for i in raters if (i, j) in when]
            return who, [KEEP ** (now - when[i, j]) * max(tor[i], 0.01) ** POWER for i in who]

        gaps: dict[int, list[float]] = {}
        for i, j in met:
            who, weights = opinions(j, tor)
            gap = abs(
                weighted([ratings[i][j] - last[k, j] for k in who], weights)
            )  # exactly 0 where all agree
            gaps.setdefault(i, []).append(sqrt(gap))
        tor = list(tor)
        for i, of in gaps.items():
            tor[i] = LAM * (1 - sum(of) / len(of)) + (1 - LAM) * tor[i]

        change = {}
        for j in sorted({j for _, j in met}):
            who, weights = opinions(j, tor)
            change[j] = weighted([sinc(1 - last[i, j]) * last[i, j] for i in who], weights) - top[j]
        middle = sorted(change.values())[len(change) // 2] if len(change) > 1 else 0.0
        top = list(top)
        for j, d in change.items():
            fault = min(d - middle, 0) if middle < -SHOCK else min(d, 0)
            top[j] += LAM * (fault + RISE * (d - fault))
        yield tor, top


def test_the_model_matches_its_reference() -> None:
    assert_matches(named("wary-role-trust"), reference)


def after(rounds: Sequence[Any], **parameters: float) -> tuple[np.ndarray, np.ndarray]:
    """Both trusts after rounds of ratings, NaN where there is none."""
    model = make_trust_model("wary-role-trust", **parameters)
    state = model.start(rounds[0])
    for ratings in rounds:
        state = model.update(state, Ratings(ratings, ratings == ratings))
    raters, providers = map(np.asarray, read(model, state))
    return raters, providers


def test_a_round_by_hand() -> None:
    """Three raters who are equally trusted at first rate 1, 1 and 0; c is 2/3, and the gaps are
    1/3, 1/3 and 2/3."""
    raters, providers = after([np.array([[1.0], [1.0], [0.0]])])
    honest, liar = 0.25 + 0.5 * (1 - sqrt(1 / 3)), 0.25 + 0.5 * (1 - sqrt(2 / 3))
    assert raters == pytest.approx([honest, honest, liar])
    quality = 2 * honest**2 / (2 * honest**2 + liar**2)  # of notes worth 1, 1 and 0
    assert providers == pytest.approx([0.5 + 0.1 * 0.5 * (quality - 0.5)])


@pytest.mark.parametrize(
    ("quality", "trust"), [(0.9, 0.885), (0.8, 0.748), (0.7, 0.601), (0.5, 0.318)]
)
def test_steady_service_among_the_honest_has_the_trust_that_role_trust_gives_it(
    quality: float, trust: float
) -> None:
    raters, providers = after([np.full((3, 3), quality)] * 300)
    assert providers == pytest.approx([trust] * 3, abs=1e-3)
    assert raters == pytest.approx([1] * 3)


def test_good_and_bad_service_in_turn_leaves_a_tenth() -> None:
    """T falls to T / 2, and rises by a twentieth of what that lacks to 1: T = 0.95 T / 2 + 0.05."""
    turns = [np.zeros((3, 1)), np.ones((3, 1))] * 60
    top = 0.05 / (1 - 0.95 / 2)
    assert after(turns)[1] == pytest.approx([top])
    assert after(turns[:-1])[1] == pytest.approx([top / 2])


def test_a_minority_of_liars_costs_a_provider_next_to_nothing_in_the_end() -> None:
    """Of role-trust it would leave 0.28, see `tests/trust/test_facts.py`; the liar's weight tends
    to 0.01 ** 2."""
    lies = [np.array([[1.0] * 3, [1.0] * 3, [0.0] * 3])] * 200
    raters, providers = after(lies)
    assert providers == pytest.approx([1, 1, 1], abs=1e-3)
    assert raters == pytest.approx([1, 1, 0], abs=1e-2)  # of a gap of 0.01 ** 2, the root
    assert after(lies, power=0)[1] == pytest.approx(
        [2 / 3] * 3, abs=1e-4
    )  # every rater counts alike


def test_trust_falls_at_once_and_rises_slowly() -> None:
    good, bad = np.ones((3, 3)), np.ones((3, 3))
    bad[:, 0] = 0
    before, fallen = after([good] * 199)[1], after([good] * 199 + [bad])[1]
    assert fallen == pytest.approx([0.5, 1, 1], abs=1e-3)
    assert before == pytest.approx([1, 1, 1], abs=1e-3)
    back = after([good] * 199 + [bad, good])[1]
    assert back[0] == pytest.approx(0.525, abs=1e-3)  # a twentieth of the way: lam x rise
    assert after([good] * 199 + [bad, good], rise=1)[1][0] == pytest.approx(0.75, abs=1e-3)


def test_what_strikes_all_at_once_is_nobodys_fault() -> None:
    good, dark = np.ones((3, 4)), np.zeros((3, 4))
    dark[:, 0] = np.nan  # nobody met it
    assert after([good] * 199 + [dark] * 4)[1] == pytest.approx([1, *[0.95**4] * 3], abs=1e-3)
    assert after([good] * 199 + [dark] * 4, shock=1)[1] == pytest.approx(
        [1, *[0.5**4] * 3], abs=1e-3
    )


@pytest.mark.parametrize(("fell", "left"), [(1, 0.5), (2, 0.5), (3, 0.95)])
def test_most_must_fall_for_it_to_be_the_worlds_doing(fell: int, left: float) -> None:
    good, bad = np.ones((3, 4)), np.ones((3, 4))
    bad[:, :fell] = 0
    assert after([good] * 199 + [bad])[1][:fell] == pytest.approx([left] * fell, abs=1e-3)


def test_one_provider_alone_is_not_the_world() -> None:
    assert after([np.ones((3, 1))] * 199 + [np.zeros((3, 1))])[1] == pytest.approx([0.5], abs=1e-3)


def test_a_rater_has_its_say_where_it_was_and_is_not() -> None:
    """Two who found a provider good outweigh one liar who is alone there later; and less so, the
    longer ago it was."""
    notes, lie = np.ones((3, 1)), np.array([[np.nan], [np.nan], [0.0]])
    nobody = np.full((3, 1), np.nan)
    alone = after([notes] * 30 + [lie], keep=0)[1][0]
    soon, later = (after([notes] * 30 + [nobody] * n + [lie])[1][0] for n in (0, 3))
    assert alone < later < soon


@pytest.mark.parametrize("notes", [(0, 1), (0.2, 0.8), (0.1, 0.7), (0, 0.3)], ids=str)
@pytest.mark.parametrize(
    ("dtype", "asarray"),
    [(np.float32, np.asarray), (np.float64, np.asarray), (np.float32, torch.asarray)],
    ids=["numpy", "numpy64", "torch"],
)
def test_no_half_of_the_raters_wins(
    notes: Vector, dtype: type, asarray: Callable[..., Any]
) -> None:
    """Whatever their order, and however much their trust counts."""
    for each, power in product((1, 2, 3, 5, 15, 250), (2.0, 8.0)):
        ratings = np.random.default_rng(each).permutation(
            np.array([notes] * each, dtype).reshape(-1, 1)
        )
        ratings = asarray(np.concatenate([ratings, 1 - ratings], axis=1))  # a provider of each half
        raters, providers = after([ratings] * 50, power=power)
        assert np.ptp(raters) == 0
        gap = (dtype(notes[1]) - dtype(notes[0])) / 2
        assert raters[0] == pytest.approx(1 - sqrt(gap), abs=1e-5)
        middle = (
            np.mean([sinc(1 - note) * note for note in notes]),
            np.mean([sinc(f) * (1 - f) for f in notes]),
        )
        assert providers == pytest.approx(middle, abs=0.05)  # on its way there


def test_one_rater_more_decides() -> None:
    """Also of many in single precision, where the lead of one is small."""
    for raters, winners in ((13, 7), (2001, 1001)):
        for side in (0, 1):
            ratings = np.full((raters, 1), 1 - side, np.float32)
            ratings[-winners:] = side
            trust = after([ratings] * 60)[0]
            assert trust[-1] > 0.9
            assert trust[0] < 0.1


def test_a_rater_in_the_middle_of_a_tie_is_right() -> None:
    raters, _ = after([np.array([[0.0], [0.5], [1.0]])] * 60)
    assert raters == pytest.approx([1 - sqrt(0.5), 1, 1 - sqrt(0.5)])
