"""Claims of Su and Saint-Jore (2023) on their Figures 3 and 4, checked against a run."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from roletrust_env.evaluation.curves import Curves
from roletrust_env.world.scenario import Scenario

SETTLE_S = 5.0
"""Seconds until trust has settled after a start, a perturbation or the start of an attack: 10
rounds, 2 ** -10."""

_VISIBLE = 0.1  # depth from which a dip can be seen in the figure

_CALM, _DIP = "calm: min of all", "least dip"

VERDICTS = {True: "ok", False: "not ok", None: "n/a"}
"""Words for whether a claim holds."""

Mask = npt.NDArray[np.bool_]


class Window(NamedTuple):
    """Start and end of an attack, in seconds."""

    start_s: float
    stop_s: float


class Claim(NamedTuple):
    """One line of the table.

    Attributes:
        figure: Number of the paper's figure.
        what: Quantity.
        paper: Statement of the paper.
        needed: Criterion of the check.
        measured: Measured values in words.
        values: Measured values.
        ok: True if the criterion is met; None if it does not apply.
    """

    figure: int
    what: str
    paper: str
    needed: str
    measured: str
    values: list[float]
    ok: bool | None


def check_on_off(curves: Curves, scenario: Scenario, attack: Window) -> list[Claim]:
    """Return the claims on Figure 3, with an attack by provider 3."""
    on = _some(
        (curves.time_s > attack.start_s) & (curves.time_s <= attack.stop_s), "under the attack"
    )
    top = curves.top[on, :, 0]
    victim, others = float(top[:, 2].min()), [float(top[:, j].min()) for j in (0, 1)]
    return [
        *_before(3, curves, scenario, attack),
        Claim(
            3, "attack: min ToP_3", "down to 0", "< 0.1", _words([victim]), [victim], victim < 0.1
        ),
        Claim(
            3,
            "attack: min ToP_1,2",
            "a small dip",
            "> 0.6",
            _words(others),
            others,
            min(others) > 0.6,
        ),
    ]


def check_bad_mouthing(curves: Curves, scenario: Scenario, attack: Window) -> list[Claim]:
    """Return the claims on Figure 4, with an attack by rater 3."""
    steady = _some(steady_under(curves.time_s, scenario, attack), "steadily under the attack")
    tor = curves.tor[steady, :, 0].mean(axis=0).tolist()
    top = curves.top[steady, :, 0].max(axis=0).tolist()
    honest, liar = tor[:2], tor[2]
    near_honest, near_liar = all(abs(t - 0.59) <= 0.06 for t in honest), abs(liar - 0.42) <= 0.06
    return [
        *_before(4, curves, scenario, attack),
        Claim(4, "steady: ToR_3", "down to 0.4", "0.42 ± 0.06", _words([liar]), [liar], near_liar),
        Claim(
            4, "steady: ToR_1,2", "down to 0.6", "0.59 ± 0.06", _words(honest), honest, near_honest
        ),
        Claim(4, "steady: max ToP", "below 0.5", "< 0.5", _words([max(top)]), top, max(top) < 0.5),
    ]


def in_clear_view(checked: Sequence[Claim]) -> bool:
    """Return whether calm trust shows a person in clear view throughout."""
    return all(claim.ok for claim in checked if claim.what == _CALM)


def for_given_frames(checked: Sequence[Claim]) -> list[Claim]:
    """Return the claims that apply to given frames. They are calibrated to the rendered scene.

    No level applies without a person in clear view. The fast target blurs the frames; if the
    detector still recognises the person, there is no dip.
    """
    if not in_clear_view(checked):
        return [claim._replace(ok=None) for claim in checked]
    return [
        claim._replace(ok=claim.ok or None) if claim.what.startswith(_DIP) else claim
        for claim in checked
    ]


def calm_before(time_s: npt.NDArray[np.float64], scenario: Scenario, attack: Window) -> Mask:
    """Return the moments before the attack with no event in the last `SETTLE_S` seconds."""
    return (time_s >= SETTLE_S) & (time_s <= attack.start_s) & ~_perturbed(time_s, scenario)


def steady_under(time_s: npt.NDArray[np.float64], scenario: Scenario, attack: Window) -> Mask:
    """Return the moments of the attack with no other event in the last `SETTLE_S` seconds."""
    return (
        (time_s >= attack.start_s + SETTLE_S)
        & (time_s <= attack.stop_s)
        & ~_perturbed(time_s, scenario)
    )


def spans(time_s: npt.NDArray[np.float64], mask: Mask) -> str:
    """Return the intervals of a mask in words, such as `5-18 s, 25-30 s`."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(int)))
    return ", ".join(f"{time_s[a]:g}-{time_s[b - 1]:g} s" for a, b in edges.reshape(-1, 2))


def _before(figure: int, curves: Curves, scenario: Scenario, attack: Window) -> list[Claim]:
    """Return the claims of both figures: high trust at first, and a dip of every camera for the
    fast target.
    """
    calm = _some(calm_before(curves.time_s, scenario, attack), "calmly before the attack")
    low = float(min(curves.tor[calm].min(), curves.top[calm].min()))
    claims = [Claim(figure, _CALM, "-", "> 0.9", _words([low]), [low], low > 0.9)]
    for blow in scenario.perturbations:
        start, stop = blow.start * scenario.period_s, blow.stop * scenario.period_s
        before = _some(
            (curves.time_s > start - 2) & (curves.time_s <= start), f"just before {start:g} s"
        )
        during = _some(
            (curves.time_s > start) & (curves.time_s <= stop), f"from {start:g} to {stop:g} s"
        )
        high, low_each = curves.top[before, :, 0].mean(axis=0), curves.top[during, :, 0].min(axis=0)
        least = int((high - low_each).argmin())
        level, dip = float(high[least]), float(low_each[least])
        words, needed = f"{level:.2f} to {dip:.2f}", f"≥ {_VISIBLE} deep"
        seen = level - dip >= _VISIBLE
        claims.append(
            Claim(figure, f"{_DIP}, {start:g} s", "they dip", needed, words, [level, dip], seen)
        )
    return claims


def _some(moments: Mask, when: str) -> Mask:
    """Return the moments.

    Raises:
        ValueError: There are none, for example on a machine that is too slow for the rounds.
    """
    if not moments.any():
        raise ValueError(f"no round {when}: too few rounds to check the paper's claims")
    return moments


def _perturbed(time_s: npt.NDArray[np.float64], scenario: Scenario) -> Mask:
    """Return the moments of a perturbation and of the `SETTLE_S` seconds after it."""
    struck = np.zeros(time_s.shape, dtype=bool)
    for blow in scenario.perturbations:
        start, stop = blow.start * scenario.period_s, blow.stop * scenario.period_s
        struck |= (time_s > start) & (time_s < stop + SETTLE_S)
    return struck


def _words(values: list[float]) -> str:
    return ", ".join(f"{value:.3f}" for value in values)
