"""Worlds without luck, in which attacks are scored by the real game, for the tests of optima."""

import numpy as np

from roletrust_env import Actions, Game, Random, Scenario, make_scenario


def certain(rounds: int, **changes) -> Scenario:
    return make_scenario("paper-3x3").change(
        noise=0.0, perturbations=(), max_cycles=rounds, **changes
    )


def play(scenario: Scenario, quality, lies=None, liars: int = 0):
    """ToP and ToR after each round of the real game, where provider 0 and the last raters attack:
    (T, ...) each."""
    game, random, batch = Game(scenario), Random(np.random.default_rng(0)), np.shape(quality)[1:]
    state = game.start(game.draw(random, batch, start=True))
    top, tor = [], []
    for t in range(scenario.max_cycles):
        qualities, ratings = np.ones((game.roster.n_providers, *batch)), state.service.copy()
        qualities[0] = quality[t]
        if liars:
            ratings[-liars:] = lies[t]
        state, _ = game.step(state, Actions(qualities, ratings), game.draw(random, batch))
        top.append(game.published(state)[1])
        tor.append(game.published(state)[0])
    return np.array(top), np.array(tor)


def exploit(scenario: Scenario, quality):
    """The score of a provider by the issue's words, from the real game."""
    top, _ = play(scenario, quality)
    return (top[:, 0] * (1 - quality)).mean(axis=0)


def damage(
    scenario: Scenario,
    lies,
    liars: int,
    weight: float,
    tolerance: float,
    per_provider: bool = False,
):
    """The score of raters by the issue's words, from the real game; lies (T, ...), or (T, P, ...)
    per provider."""
    honest = np.ones((len(lies), *np.shape(lies)[1 + per_provider :]))
    top, tor = play(scenario, honest, lies, liars)
    gap = tor[:, :-liars].mean(axis=1) - tor[:, -liars:].mean(axis=1)
    return ((1 - top).mean(axis=1) - weight * np.maximum(0, gap - tolerance)).mean(axis=0)


def every_sequence(options: np.ndarray, length: int) -> np.ndarray:
    """All sequences of options, (length, len(options) ** length)."""
    return np.array(np.meshgrid(*[options] * length, indexing="ij")).reshape(length, -1)
