"""Helpers of the tests of the compiled engine: a round, and the same round of the rules."""

from typing import Any

import numpy as np

from roletrust_env import Game, make_scenario
from roletrust_env.compiled.engine import CompiledBatch, CompiledGame, Program
from roletrust_env.game.state import Actions, State
from roletrust_env.randomness import Random
from roletrust_env.trees import arrays


class Round:
    """A round in which all agents act, and what is observed after it."""

    def __init__(self, scenario: Any, model: Any, like: Any) -> None:
        self.game = Game(scenario, model, like)

    def __call__(self, state: Any, quality: Any, ratings: Any, key: Any, random: Any) -> Any:
        game = self.game
        after, rewards = game.step(state, Actions(quality, ratings), game.noise(key))
        return after, (rewards, game.agent_trust(after), *game.observations(after))


def record(preset: str, model: Any, dtype: Any = np.float64, batch: bool = False) -> Program:
    """Return the recorded round of a preset."""
    scenario = make_scenario(preset)
    game = Game(scenario, model, np.zeros((), dtype))
    random = game.random(seed=0)
    state = game.start(game.draw(random, start=True))
    return Program.record(
        lambda like: Round(scenario, model, like),
        state,
        (state.quality, state.ratings, random.round_key()),
        batch=batch,
    )


def start(game: Game, batch: tuple[int, ...] = ()) -> tuple[State, Random]:
    """Return the state at the start of a seeded game, and its random numbers."""
    random = game.random(seed=1)
    return game.start(game.draw(random, batch, start=True)), random


def act(state: State, rng: np.random.Generator) -> tuple[Any, Any]:
    """Return qualities and ratings; half of the ratings are honest."""
    dtype = state.ratings.dtype
    lies = rng.random(state.ratings.shape).astype(dtype)
    honest = rng.random(state.ratings.shape) < 0.5
    return rng.random(state.quality.shape).astype(dtype), np.where(honest, state.service, lies)


def largest_gap(one: Any, other: Any) -> float:
    """Return the largest difference of two trees of arrays."""
    return max(
        float(np.max(abs(np.asarray(a, float) - np.asarray(b, float)), initial=0.0))
        for a, b in zip(arrays(one), arrays(other), strict=True)
    )


def episode_gap(preset: str, model: Any, program: Program, rounds: int | None = None) -> float:
    """Return the largest difference between a compiled game and the rules, in an episode."""
    reference = Round(make_scenario(preset), model, np.zeros(()))
    game, rng, worst = reference.game, np.random.default_rng(0), 0.0
    state, random = start(game)
    compiled = CompiledGame(program)
    compiled.begin(state)
    for _ in range(rounds or game.scenario.max_cycles):
        quality, ratings = act(state, rng)
        key = random.round_key()
        state, shown = reference(state, quality, ratings, key, random)
        played = compiled.play(quality, ratings, key)
        worst = max(worst, largest_gap(state, compiled.state), largest_gap(shown, played))
    return worst


def batch_gap(
    preset: str, model: Any, program: Program, games: int, rounds: int, dtype: Any = np.float64
) -> float:
    """Return the largest difference between compiled games side by side and the rules."""
    reference = Round(make_scenario(preset), model, np.zeros((), dtype))
    game, rng, worst = reference.game, np.random.default_rng(0), 0.0
    state, random = start(game, (games,))
    batch, after = CompiledBatch(program), state
    for _ in range(rounds):
        quality, ratings = act(state, rng)
        key = random.round_key()
        state, rewards = game.step(state, Actions(quality, ratings), game.noise(key, (games,)))
        shown = rewards, game.agent_trust(state), *game.observations(state)
        after, played = batch.play(after, quality, ratings, key)
        worst = max(worst, largest_gap(state, after), largest_gap(shown, played))
    return worst
