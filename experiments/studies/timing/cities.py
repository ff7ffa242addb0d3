"""Cost of a round of a city by the number of agents: noise, policies and the round itself, beside plain NumPy."""

import time
import tracemalloc
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from statistics import median
from typing import Any, NamedTuple

import numpy as np

from roletrust_env import JointPolicy, SparseGame
from roletrust_env.game.state import Noise, State
from studies.cities import MET, attackers, city, city_sizes

PLAIN = "plain NumPy"
"""Name of the round of `mean` that is written by hand."""

_ROUNDS = 1000  # more than are ever played here
_SHARE = 0.2


class Parts(NamedTuple):
    """Seconds of the parts of a round: noise and encounters drawn, policies asked, round played. Memory in bytes."""

    noise: float
    policies: float
    step: float


class RoundCost(NamedTuple):
    """Cost of a round.

    Attributes:
        agents: Number of agents.
        services: Number of services, and of ratings, in a round.
        name: Name of the trust model, or `PLAIN`.
        seconds: Processor time of the rounds that were timed, in seconds, which other work on the machine does not add
            to.
        by_hand: The same of the rounds in plain NumPy that were timed in turn with them.
        parts: Medians of its parts; None for plain NumPy, which has no such parts.
        memory: Peak of the memory of three rounds beyond that of the agents and their names, in bytes.
    """

    agents: int
    services: int
    name: str
    seconds: tuple[float, ...]
    by_hand: tuple[float, ...]
    parts: Parts | None
    memory: int


def measure_rounds(
    sizes: Sequence[int],
    models: Mapping[str, Any],
    *,
    repeats: int = 5,
    seed: int = 0,
    advance: Callable[[str], None] = lambda what: None,
) -> list[RoundCost]:
    """Time rounds of cities in which a fifth of the raters bad-mouths, each in turn with plain NumPy.

    Args:
        sizes: Numbers of agents.
        models: Central trust models by name.
        repeats: Number of timed rounds of each.
        seed: Random seed.
        advance: Called with what is measured next, once for each model and size, and for plain NumPy.
    """
    found = []
    for agents in sizes:
        scenario, (raters, providers) = city(agents, _ROUNDS), city_sizes(agents)
        advance(f"{agents:,} agents, {PLAIN}")
        by_hand, memory = _traced(partial(plain, raters, providers, seed))
        rows = []
        for name, model in models.items():
            advance(f"{agents:,} agents, {name}")
            play, peak = _traced(_player(SparseGame(scenario, model), seed))
            turns = [(play(), sum(by_hand())) for _ in range(repeats)]
            parts = Parts(*(median(column) for column in zip(*(taken for taken, _ in turns), strict=True)))
            seconds, hand = tuple(sum(taken) for taken, _ in turns), tuple(taken for _, taken in turns)
            rows.append(RoundCost(agents, MET * raters, name, seconds, hand, parts, peak))
            del play
        hand = rows[0].by_hand
        found += [*rows, RoundCost(agents, MET * raters, PLAIN, hand, hand, None, memory)]
    return found


def _player(game: SparseGame, seed: int) -> Callable[[], Callable[[], Parts]]:
    """Return a function that starts the game and returns a function that plays its next round."""
    seats = JointPolicy(game, attackers(game, "bad-mouthing", _SHARE))

    def start() -> Callable[[], Parts]:
        random = game.random(seed)
        state = game.start(game.draw(random, start=True))
        memories = seats.begin(random)

        def play() -> Parts:
            nonlocal state, memories
            began = time.process_time()
            noise: Noise = game.draw(random)
            drawn = time.process_time()
            actions, memories = seats.act(state, memories, random)
            asked = time.process_time()
            after: State = game.step(state, actions, noise)[0]
            state = after
            return Parts(drawn - began, asked - drawn, time.process_time() - asked)

        return play

    return start


def plain(raters: int, providers: int, seed: int) -> Callable[[], Parts]:
    """Return a function that plays the next round of `mean` in a city, written by hand for this one case in NumPy.

    A fifth of the raters rates 0. Unlike in the game, a rater may meet a provider twice in a round.
    """
    rng = np.random.default_rng(seed)
    ability, top = rng.uniform(0.3, 1.0, providers), np.full(providers, 0.5)
    liars = np.arange(raters) < _SHARE * raters

    def play() -> Parts:
        nonlocal top
        began = time.process_time()
        whom = rng.integers(0, providers, (raters, MET))
        seen = np.clip(ability[whom] + 0.05 * rng.standard_normal((raters, MET)), 0, 1)
        rated = np.where(liars[:, None], 0.0, seen).ravel()
        whom = whom.ravel()
        counts = np.bincount(whom, minlength=providers)
        average = np.bincount(whom, rated, providers) / np.maximum(counts, 1)
        top = np.where(counts > 0, top + 0.5 * (average - top), top)
        return Parts(0.0, 0.0, time.process_time() - began)

    return play


def _traced(start: Callable[[], Callable[[], Parts]]) -> tuple[Callable[[], Parts], int]:
    """Return the function that plays the next round, after three rounds, and the peak of their memory in bytes."""
    tracemalloc.start()
    try:
        play = start()
        for _ in range(3):
            play()
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    return play, peak
