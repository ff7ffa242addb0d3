"""Curves of a game from the rounds that a manager has published."""

from collections.abc import Sequence

import numpy as np

from roletrust_env.evaluation.curves import Curves
from roletrust_env.live.journal import JournalEntry
from roletrust_env.live.team import PublishedTrust


def curves_from_rounds(rounds: Sequence[PublishedTrust], start: int, period: int, period_s: float) -> Curves:
    """Return the curves of a team. Unknown values are NaN: rewards, delivered quality, and trust before an agent joins.

    Args:
        rounds: One or more rounds.
        start: Start of round 0, nanoseconds.
        period: Time between rounds, nanoseconds.
        period_s: Time between rounds by the scenario's clock, seconds. The trust after the services of round r is at
            (r + 1) * period_s.
    """
    number = np.array([round((one.stamp - start) / period) for one in rounds])
    raters, providers, nan = rounds[-1].tor, rounds[-1].top, float("nan")
    tor = np.array([[one.tor.get(name, nan) for name in raters] for one in rounds])[..., None]
    top = np.array([[one.top.get(name, nan) for name in providers] for one in rounds])[..., None]
    trust = np.concatenate([tor, top], axis=1)
    return Curves((number + 1) * period_s, tor, top, trust, np.full_like(trust, nan), np.full_like(top, nan))


def latencies_ms(entries: Sequence[JournalEntry]) -> list[float]:
    """Return the times from the services' stamp to the resulting trust, for complete rounds, milliseconds."""
    return [(entry.closed - entry.stamp) / 1e6 for entry in entries if not entry.missing]
