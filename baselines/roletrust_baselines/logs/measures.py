"""All measures of a trust model on one log: forecasts and attacks, or crowd work."""

from collections.abc import Callable, Mapping
from typing import Any

from roletrust_baselines.logs.crowd import crowd_work, read_crowd
from roletrust_baselines.logs.folders import Folder
from roletrust_baselines.logs.forecasts import forecasts, next_rating, rated_before, rater_forward
from roletrust_baselines.logs.replay import ATTACKS, Replay, replay_attacks, search_attack
from roletrust_baselines.logs.rounds import TooSmallError
from roletrust_env.data.columns import Columns
from roletrust_env.data.log import read_ratings
from roletrust_env.metrics.confidence import Interval

Found = dict[tuple[str, str], Interval]
"""Measures by protocol and name."""


def log_measures(
    log: Folder, every: float, scale: tuple[float, float], same_agents: bool, search: int, seed: int
) -> Callable[[Any], tuple[Found, dict[str, str]]]:
    """Read a log once, and return a function from a model to its measures.

    The function also returns the reasons why protocols could not be played, by what they are.
    """
    if log.truth is not None:
        crowd = read_crowd(log.path, log.truth)
        return lambda model: (_named("crowd work", crowd_work(model, crowd, seed)), {})
    ratings = read_ratings(log.path, Columns("1", "2", "3", "4"), scale=scale, same_agents=same_agents, repeats=True)

    def forecast(model: Any) -> Found:
        before = forecasts(model, ratings, every, same_agents=same_agents)
        found = _named("rated before", rated_before(before, ratings, scale, seed))
        found |= _named("next rating", next_rating(before, ratings, seed))
        return found | _named("rater forward", rater_forward(before, ratings, seed))

    def attacked(model: Any) -> Found:
        found: Found = {}
        replay = Replay(model, ratings, every, same_agents=same_agents)
        for attack, shift in replay_attacks(replay, seed=seed).items():
            found["attack", f"{attack.goal}, honest"] = shift.before
            found["attack", f"{attack.goal}, {attack.accounts} {attack.origin}"] = shift.after
        for attack in ATTACKS if search else ():
            worst = search_attack(replay, attack, search, seed)
            found["searched attack", f"{attack.goal}, {attack.accounts} {attack.origin}"] = worst.shift.after
        return found

    def measure(model: Any) -> tuple[Found, dict[str, str]]:
        found: Found = {}
        missing = {}
        for protocols, play in (("forecasts", forecast), ("attacks", attacked)):
            try:
                found |= play(model)
            except TooSmallError as error:
                missing[protocols] = str(error)
        return found, missing

    return measure


def _named(protocol: str, measures: Mapping[str, Interval]) -> Found:
    return {(protocol, what): value for what, value in measures.items()}
