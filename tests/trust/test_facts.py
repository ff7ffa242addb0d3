"""The table of facts, from the two functions alone: closed forms to 1e-6, and the digits as
printed."""

from collections.abc import Iterable
from itertools import cycle, islice, repeat
from math import pi, sin, sqrt

import numpy as np
import pytest

from roletrust_env.trust import provider_trust, rater_trust

CLOSED_FORM = 1e-6
TO_STEADY_STATE = 60  # rounds: what is left of the start is 2 ** -60


def play(rounds: Iterable[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """ToR and ToP after each round, (rounds, S) and (rounds, P), everyone rating everyone in every
    round."""
    trust: list[tuple[np.ndarray, np.ndarray]] = []
    last = None
    for ratings in rounds:
        mask = np.ones(ratings.shape, dtype=bool)
        tor, top = (
            trust[-1] if trust else (np.full(len(ratings), 0.5), np.full(len(ratings.T), 0.5))
        )
        tor = rater_trust(ratings, mask, previous=tor, lam=0.5)
        top = provider_trust(
            ratings,
            mask,
            tor=tor,
            previous=top,
            lam=0.5,
            last_ratings=ratings if last is None else last,
            elapsed=np.full(ratings.shape, 0 if last is None else 1),
        )
        trust.append((tor, top))
        last = ratings
    tors, tops = zip(*trust, strict=True)
    return np.array(tors), np.array(tops)


def steady(ratings: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    tors, tops = play(repeat(ratings, TO_STEADY_STATE))
    return tors[-1], tops[-1]


def on_off(*qualities: float) -> np.ndarray:
    """The ToP of one provider through the last full cycle of qualities, all three raters honest."""
    rounds = islice(cycle(qualities), TO_STEADY_STATE * len(qualities))
    _, tops = play(np.full((3, 1), float(quality)) for quality in rounds)
    return tops[-len(qualities) :, 0]


def close(value: float) -> object:
    return pytest.approx(value, abs=CLOSED_FORM)


def printed(value: float, digits: int = 3) -> object:
    return pytest.approx(value, abs=0.5 * 10**-digits)


def sinc(x: float) -> float:
    return sin(pi * x) / (pi * x) if x else 1.0


@pytest.mark.parametrize(
    ("raters", "liars", "lie", "printed_top"),
    [
        pytest.param(3, 1, 0.5, 0.4393, id="one-of-3"),
        pytest.param(10, 1, 0.5, 0.709, id="one-of-10"),
        pytest.param(100, 1, 0.5, 0.921, id="one-of-100"),
        pytest.param(3, 1, 0.0, 0.282, id="one-of-3-rates-0"),
    ],
)
def test_liars_among_honest_raters(raters: int, liars: int, lie: float, printed_top: float) -> None:
    ratings = np.ones((raters, 3))
    ratings[:liars] = lie
    tor, top = steady(ratings)

    share = liars / raters  # the mean rating is 1 - share * (1 - lie)
    honest, liar = 1 - sqrt(share * (1 - lie)), 1 - sqrt((1 - share) * (1 - lie))
    assert tor[liars:] == close(honest)
    assert tor[:liars] == close(liar)
    assert top == close((1 - share) * honest + share * sinc(1 - lie) * liar * lie)
    assert top == printed(printed_top, digits=len(str(printed_top)) - 2)


@pytest.mark.parametrize("raters", [3, 30, 300])
def test_a_third_of_liars_is_never_diluted(raters: int) -> None:
    ratings = np.ones((raters, 3))
    ratings[: raters // 3] = 0.5
    tor, top = steady(ratings)
    assert tor[-1] == close(1 - sqrt(1 / 6))
    assert tor[-1] == printed(0.5918, digits=4)
    assert tor[0] == close(1 - sqrt(1 / 3))
    assert tor[0] == printed(0.4226, digits=4)
    assert top == close(
        (2 * (1 - sqrt(1 / 6)) + (1 - sqrt(1 / 3)) / pi) / 3
    )  # sinc(1/2) / 2 = 1 / pi


def test_a_liar_that_rates_0() -> None:
    ratings = np.ones((3, 3))
    ratings[2] = 0
    tor, top = steady(ratings)
    assert tor[2] == close(1 - sqrt(2 / 3))
    assert top == close(2 / 3 * (1 - sqrt(1 / 3)))


def test_a_liar_that_attacks_one_provider_of_three() -> None:
    ratings = np.ones((3, 3))
    ratings[2, 2] = 0.5
    tor, top = steady(ratings)
    honest, liar = 1 - sqrt(1 / 6) / 3, 1 - sqrt(1 / 3) / 3
    assert tor == close(np.array([honest, honest, liar]))
    assert tor == printed(np.array([0.864, 0.864, 0.808]))
    assert top == close(np.array([(2 * honest + liar) / 3] * 2 + [(2 * honest + liar / pi) / 3]))
    assert top[2] == printed(0.66, digits=2)


@pytest.mark.parametrize(
    ("quality", "printed_top"), [(0.9, 0.885), (0.8, 0.748), (0.7, 0.601), (0.5, 0.318)]
)
def test_constant_quality_among_the_honest(quality: float, printed_top: float) -> None:
    tor, top = steady(np.full((3, 3), quality))
    assert tor == close(1)
    assert top == close(sinc(1 - quality) * quality)
    assert top == printed(printed_top)


def test_on_off_in_turn_loses_all_trust() -> None:
    assert on_off(0, 1) == close(0)


def test_on_off_with_one_bad_round_per_five_good() -> None:
    """The bad round and the good one after it have QoP 0 and halve ToP; every other round has QoP
    1."""
    trust = on_off(0, 1, 1, 1, 1, 1)
    assert trust == close(np.array([10, 5, 13, 17, 19, 20]) / 21)
    assert (trust.min(), trust.max(), trust.mean()) == close((5 / 21, 20 / 21, 2 / 3))
    assert (trust.min(), trust.max(), trust.mean()) == printed((0.238, 0.952, 0.667))


@pytest.mark.parametrize("spread", [0.01, 0.05, 0.1])
def test_noisy_perception_costs_honest_raters_much_trust(spread: float) -> None:
    """QoR is 1 - E sqrt|N(0, s)|, with E sqrt|N(0, 1)| = 2 ** (1/4) * gamma(3/4) / sqrt(pi) =
    0.822."""
    noise = np.random.default_rng(0).normal(0, spread, (300, 300))
    tor, _ = steady(np.clip(0.5 + noise, 0, 1))
    assert tor.mean() == pytest.approx(1 - 0.822 * sqrt(spread), abs=0.01)
    if spread == 0.05:
        assert tor.mean() == pytest.approx(0.816, abs=0.01)
