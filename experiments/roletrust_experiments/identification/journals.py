"""What a manager has published, as the curves of a game."""

from collections.abc import Sequence

import numpy as np

from roletrust_env.evaluation.curves import Curves
from roletrust_env.live.journal import Entry, Published


def curves_of(rounds: Sequence[Published], start: int, period: int, period_s: float) -> Curves:
    """The curves of a team. What nobody can know is NaN: rewards, delivered quality, trust of whoever came later.

    Args:
        rounds: one or more.
        start: of round 0, nanoseconds.
        period: between rounds, nanoseconds.
        period_s: between rounds, seconds of the scenario. Trust after the services of round r stands at
            (r + 1) * period_s.
    """
    number = np.array([round((one.stamp - start) / period) for one in rounds])
    raters, providers, nan = rounds[-1].tor, rounds[-1].top, float("nan")
    tor = np.array([[one.tor.get(name, nan) for name in raters] for one in rounds])[..., None]
    top = np.array([[one.top.get(name, nan) for name in providers] for one in rounds])[..., None]
    trust = np.concatenate([tor, top], axis=1)
    return Curves((number + 1) * period_s, tor, top, trust, np.full_like(trust, nan), np.full_like(top, nan))


def latencies_ms(entries: Sequence[Entry]) -> list[float]:
    """From the services' stamp to the trust that follows, milliseconds, of rounds in which nobody was missing."""
    return [(entry.closed - entry.stamp) / 1e6 for entry in entries if not entry.missing]
