"""The package robustrep as a trust model: `--on studies.robustrep:RobustRep`."""

from importlib.util import find_spec
from typing import Any, NamedTuple

import numpy as np
from pydantic import PositiveInt

from roletrust_env.arrays import Array, namespace
from roletrust_env.parameters import Share, checked_dataclass
from roletrust_env.trust.ratings import Ratings


class Records(NamedTuple):
    """Ratings of the last rounds, (window, S, P, ...), NaN where there is none; trust of raters and of providers."""

    ratings: Array
    tor: Array
    top: Array


@checked_dataclass
class RobustRep:
    """Score of the package robustrep, made for agents that rate each other on a blockchain.

    Every rater has one vote on a provider, the median of its ratings, and trust is the median of the votes. The package
    rates no raters. Its weights of evidence and its clusters of identities need facts that a game does not have.

    Attributes:
        initial: Trust before any rating.
        window: Number of rounds whose ratings count. The package keeps all.

    Raises:
        ValueError: The package is not installed.
    """

    initial: Share = 0.5
    window: PositiveInt = 50

    rates_raters = False
    source = "package robustrep"
    differentiable = False

    def __post_init__(self) -> None:
        """Check that the package is installed."""
        if find_spec("robustrep") is None:
            raise ValueError("RobustRep needs the package robustrep: pip install 'roletrust-env[peers]'")

    def start(self, like: Array) -> Records:
        """Return no ratings, and the initial trust of the providers. See `TrustModel.start`."""
        xp = namespace(like)
        empty = xp.stack([0 * like + xp.nan] * self.window)
        return Records(empty, 0 * like[:, 0] + 1, 0 * like[0] + self.initial)

    def update(self, state: Records, ratings: Ratings) -> Records:
        """Return the state after one round of ratings. See `TrustModel.update`."""
        xp, values = namespace(ratings.values), ratings.values
        given = xp.where(ratings.weights > 0, values, xp.nan)[None, ...]
        records = xp.concat((state.ratings[1:], given))
        scores = _scores(np.asarray(records).reshape(*records.shape[:3], -1)).reshape(state.top.shape)
        new = xp.asarray(scores, dtype=values.dtype, device=values.device)
        return state._replace(ratings=records, top=xp.where(xp.isnan(new), state.top, new))

    def rater_trust(self, state: Records) -> Array:
        """Return 1 for every rater. See `TrustModel.rater_trust`."""
        return state.tor

    def provider_trust(self, state: Records) -> Array:
        """Return the score of each provider. See `TrustModel.provider_trust`."""
        return state.top


def _scores(ratings: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """Return the score of each provider in each game, shape (P, games); NaN without a rating.

    Args:
        ratings: Ratings, shape (rounds, S, P, games); NaN where there is none.
    """
    import pandas as pd
    from robustrep import Config, score

    round, rater, provider, game = np.nonzero(~np.isnan(ratings))
    many, games = ratings.shape[2:]
    columns = {
        "rater": rater,
        "ratee": game * many + provider,
        "value": 100 * ratings[round, rater, provider, game],
        "scale": "d0",  # percent; the package reads the scale of each tag off its values
        "tag": game,
        "ts": round,
        "evidence_uri": "",
        "source": "",
    }
    scores = np.full(games * many, np.nan)
    if rater.size:
        result = score(pd.DataFrame(columns), Config(bootstrap_n=0, min_clusters=1))
        scores[result["ratee"].astype(int)] = result["robust_score"].astype(float)
    return scores.reshape(games, -1).T
