"""Numbers by hash: as random as can be told, and the same wherever they are made."""

import warnings
from collections.abc import Callable
from hashlib import sha256

import numpy as np
import pytest
import torch
from refusals import refuses
from scipy import stats

from roletrust_baselines import OnOff
from roletrust_env import Game, JointPolicy, Random, counter_rng, make_scenario, record

LIBRARIES = pytest.mark.parametrize(
    "like",
    [np.zeros((), np.float32), torch.zeros(()), torch.zeros((), dtype=torch.float64)],
    ids=["numpy32", "torch32", "torch64"],
)
PVALUE = 1e-5  # of some hundred tests; the keys are fixed, so that they do not fail by chance


def key(*words: int) -> list[np.ndarray]:
    return [np.array([word], np.uint32) for word in words]


def words_of(like: object, found: list[np.ndarray]) -> list[object]:
    if isinstance(like, np.ndarray):
        return list(found)
    return [torch.asarray(word.view(np.int32)) for word in found]


def rounds(
    seed: int, made: Callable[..., np.ndarray], cells: int, games: int, number: int
) -> np.ndarray:
    """The numbers of some rounds as a game draws them, (rounds, cells, games)."""
    random, like = Random(np.random.default_rng(seed)), np.zeros(())
    keys = [random.round_key() for _ in range(number)]
    return np.stack(
        [
            made(
                like, cells, counter_rng.counters(like, games), [k[0, i : i + 1] for i in range(4)]
            )
            for k in keys
        ]
    )


# --- the same everywhere
# ----------------------------------------------------------------------------


def test_the_hash_is_pcg4d() -> None:
    """Word by word with Python's own numbers, after the paper's listing."""

    def slow(v: list[int]) -> list[int]:
        v = [(x * 1664525 + 1013904223) % 2**32 for x in v]
        for half in range(2):
            for to, a, b in ((0, 1, 3), (1, 2, 0), (2, 0, 1), (3, 1, 2)):
                v[to] = (v[to] + v[a] * v[b]) % 2**32
            if half == 0:
                v = [x ^ (x >> 16) for x in v]
        return v

    for seed in range(50):
        words = np.random.default_rng(seed).integers(0, 2**32, 4, dtype=np.uint32)
        expected = slow(words.tolist())
        assert [int(word[0]) for word in counter_rng.scramble(key(*words))] == expected
        tensors = counter_rng.scramble(words_of(torch.zeros(()), key(*words)))
        assert [int(word[0]) % 2**32 for word in tensors] == expected


@LIBRARIES
@pytest.mark.parametrize("made", [counter_rng.normal, counter_rng.uniform])
def test_every_library_makes_the_same_numbers(like: object, made: Callable) -> None:
    found = key(1, 2**31 + 5, 2**32 - 1, 77)
    expected = made(np.zeros(()), 10, counter_rng.counters(np.zeros(()), 33), found)
    numbers = made(like, 10, counter_rng.counters(like, 33), words_of(like, found))
    assert numbers.shape == (10, 33)
    assert numbers.dtype == like.dtype
    np.testing.assert_allclose(
        np.asarray(numbers), expected, rtol=0, atol=1e-13 if "64" in str(like.dtype) else 1e-5
    )


@pytest.mark.parametrize("made", [counter_rng.normal, counter_rng.uniform])
def test_a_games_numbers_do_not_depend_on_its_company(made: Callable) -> None:
    like, found = np.zeros((), np.float32), key(4, 3, 2, 1)
    crowd = made(like, 7, counter_rng.counters(like, 5000), found)
    for e in (0, 1, 2047, 2048, 4999):
        alone = made(like, 7, counter_rng.counters(like, 5000)[e : e + 1], found)
        np.testing.assert_allclose(crowd[:, e], alone[:, 0], rtol=0, atol=1e-6)


@pytest.mark.parametrize("preset", ["paper-3x3", "robots-that-move", "open-system"])
def test_the_first_game_of_a_batch_has_the_luck_of_a_game_alone(preset: str) -> None:
    game = Game(make_scenario(preset))
    one, many = game.random(3), game.random(3)
    for t in range(150):
        alone, batch = game.draw(one, start=t in (0, 70)), game.draw(many, (4,), start=t in (0, 70))
        for a, b in zip(alone, batch, strict=True):
            assert (a is None) == (b is None)
            if a is not None:
                np.testing.assert_allclose(a, b[..., 0], rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("preset", "expected"),
    [("robots-that-move", "57ad67e29ba5f426"), ("open-system", "345829c3be8090db")],
)
def test_seeds_deal_what_they_have_always_dealt(preset: str, expected: str) -> None:
    """Uniform numbers are whole multiples of 2 ** -24, the same on every machine; these are of
    version 0.1.0."""
    game, digest = Game(make_scenario(preset)), sha256()
    random = game.random(0)
    for start in (True, False, False):
        for luck in (*game.draw(random, (2,), start=start)[1:], random.uniform((3,))):
            digest.update(b"" if luck is None else (luck * 2**24).astype("<u4").tobytes())
    assert digest.hexdigest()[:16] == expected


def test_what_policies_draw_does_not_change_the_luck_of_the_game() -> None:
    game = Game(make_scenario("paper-3x3"))
    quiet, busy = game.random(0), game.random(0)
    for _ in range(70):
        busy.uniform((3,))
        assert np.array_equal(game.draw(quiet).perception, game.draw(busy).perception)


def test_policies_that_play_at_random_have_the_same_luck_alone_and_in_a_batch() -> None:
    game = Game(make_scenario("crowd-10x10").change(max_cycles=30))
    joint_policy = JointPolicy(
        game, {f"sp_{i}": OnOff(switching="random", period=6) for i in range(5)}
    )
    alone, few, many = (
        record(joint_policy, game.random(0), batch).quality for batch in ((), (3,), (70,))
    )
    assert np.array_equal(alone, few[..., 0])
    assert np.array_equal(few, many[..., :3])
    assert not np.array_equal(few[..., 0], few[..., 1])


def test_nothing_warns() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        game = Game(make_scenario("open-system"))
        for batch in ((), (3,)):
            random = game.random(2**40)
            game.draw(random, batch, start=True)
            game.draw(random, batch)
            random.normal(())


# --- as random as can be told
# -----------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(4))
def test_uniform_numbers_are_uniform_and_pairs_of_them_independent(seed: int) -> None:
    """Neighbours in every direction: cells, those of one hash among them, games, rounds; and other
    streams."""
    numbers = rounds(seed, counter_rng.uniform, 9, 64, 512)
    assert numbers.min() >= 0
    assert numbers.max() < 1
    assert stats.kstest(numbers.ravel(), "uniform").pvalue > PVALUE
    pairs = {
        "rounds": (numbers[1:], numbers[:-1]),
        "cells": (numbers[:, 1:], numbers[:, :-1]),
        "one hash": (numbers[:, 3:], numbers[:, :-3]),
        "games": (numbers[..., 1:], numbers[..., :-1]),
        "distant games": (numbers[..., 32:], numbers[..., :-32]),
        "seeds": (numbers, rounds(seed + 1, counter_rng.uniform, 9, 64, 512)),
    }
    for name, (a, b) in pairs.items():
        cells, *_ = np.histogram2d(a.ravel(), b.ravel(), 32, [[0, 1], [0, 1]])
        assert stats.chisquare(cells.ravel()).pvalue > PVALUE, name


@pytest.mark.parametrize("seed", range(4))
def test_normal_numbers_are_normal_in_every_cell_and_uncorrelated(seed: int) -> None:
    numbers = rounds(seed, counter_rng.normal, 9, 64, 512)
    for cell in range(9):
        assert stats.kstest(numbers[:, cell].ravel(), "norm").pvalue > PVALUE
    assert stats.normaltest(numbers.ravel()).pvalue > PVALUE  # skewness and kurtosis
    correlation = np.corrcoef(numbers.swapaxes(0, 1).reshape(9, -1))
    assert np.abs(correlation - np.eye(9)).max() < 5 / np.sqrt(64 * 512)
    squares = np.corrcoef((numbers.swapaxes(0, 1).reshape(9, -1)) ** 2)
    assert np.abs(squares - np.eye(9)).max() < 5 / np.sqrt(64 * 512)


def test_words_repeat_as_seldom_as_those_of_chance() -> None:
    """A birthday test: among n words of 32 bits, n^2 / 2^33 pairs are expected to be alike."""
    games = np.arange(2**16, dtype=np.uint32)[None]
    groups = np.arange(4, dtype=np.uint32)[:, None]
    words = np.stack(counter_rng.scramble((groups, games, *key(5, 9)))).ravel()
    alike = len(words) - len(np.unique(words))
    expected = len(words) ** 2 / 2**33
    assert abs(alike - expected) < 5 * np.sqrt(expected)


def test_streams_of_a_round_have_nothing_in_common() -> None:
    random, like = Random(np.random.default_rng(0)), np.zeros(())
    found = random.round_key()
    games = counter_rng.counters(like, 20_000)
    a, b = (
        counter_rng.uniform(like, 4, games, [found[k, i : i + 1] for i in range(4)]) for k in (0, 1)
    )
    assert abs(np.corrcoef(a.ravel(), b.ravel())[0, 1]) < 5 / np.sqrt(a.size)


def test_a_random_wants_a_generator() -> None:
    with refuses(ValueError, "3", "numpy.random.Generator"):
        Random(3)
