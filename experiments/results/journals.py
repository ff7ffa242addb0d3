"""What a manager's journal holds, as the curves of a game."""

from collections.abc import Sequence

import numpy as np

from experiments.results.recording import Curves
from roletrust_env.live.journal import Entry


def curves_of(entries: Sequence[Entry], start: int, period: int, period_s: float) -> Curves:
    """The curves of a team that stayed as it was; rewards and delivered quality, which nobody can know, are NaN.

    Args:
        entries: the rounds.
        start: of round 0, nanoseconds.
        period: between rounds, nanoseconds.
        period_s: between rounds, seconds of the scenario. Trust after the services of round r stands at
            (r + 1) * period_s.
    """
    rounds = np.array([round((entry.stamp - start) / period) for entry in entries])
    tor = np.array([entry.trust.tor for entry in entries])[..., None]
    top = np.array([entry.trust.top for entry in entries])[..., None]
    trust = np.concatenate([tor, top], axis=1)
    return Curves((rounds + 1) * period_s, tor, top, trust, np.full_like(trust, np.nan), np.full_like(top, np.nan))


def latencies_ms(entries: Sequence[Entry]) -> list[float]:
    """From the services' stamp to the trust that follows, milliseconds, of rounds in which nobody was missing."""
    return [(entry.closed - entry.stamp) / 1e6 for entry in entries if not entry.missing]
