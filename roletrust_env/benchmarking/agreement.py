"""Agreement of claimed numbers with those of a run on this machine, up to the noise of sampling."""

from collections.abc import Sequence
from statistics import NormalDist
from typing import NamedTuple

import numpy as np

from roletrust_env.benchmarking.schema import CellResult
from roletrust_env.benchmarking.submission import CellClaim, Claim, ClaimedScore, make_claim

ROUNDING = 1e-9

CHOSEN = "chosen utility"
"""Name of the utility in the games that choose the worst case."""

_CHOSEN_BLIND = "chosen blind"

_SEARCH_ERROR = 0.03  # standard deviation of the worst case between searches with other seeds
_LEAST_ERROR = 1e-4  # where all games are alike, another processor rounds otherwise
_EVERY = "all models"
_NORMAL_95, _NORMAL_999 = 1.96, 3.09  # quantiles of the normal distribution, for both sides and for one


class Check(NamedTuple):
    """Result of a check.

    Attributes:
        subject: Part of the submission.
        ok: Whether the part is correct.
        message: Explanation of the result.
    """

    subject: str
    ok: bool
    message: str


def check_cell(claim: CellClaim, result: CellResult, same: bool) -> Check:
    """Compare the claim for a cell with its result on this machine.

    Args:
        claim: Claim for the cell.
        result: Result of the cell on this machine.
        same: Require equal numbers to the last bit. Otherwise each mean must be within the interval.
    """
    subject = f"cell {claim.cell.key}"
    if result.failed:
        return Check(subject, False, f"failed here: {result.failed}")
    own_claim = make_claim(claim.cell, result)
    claimed, own = ({one.attack: one for one in each.attacks} for each in (claim, own_claim))
    if different := sorted(claimed.keys() ^ own.keys()):
        name = different[0]
        return Check(subject, False, f"{name}: {'only in the claim' if name in claimed else 'missing in the claim'}")
    if same:
        wrong = [name for name in claimed if claimed[name] != own[name]]
        return Check(subject, not wrong, f"{wrong[0]}: other numbers" if wrong else "the same to the last bit")
    for name, one in claimed.items():
        pairs = [(metric, score, getattr(own[name].measured, metric)) for metric, score in one.measured]
        for metric, score, own_score in [*pairs, *_chosen(one, result)]:
            if not within(score, own_score):
                return Check(subject, False, f"{name}, {metric}: claimed {score.text}, here {own_score.text}")
    return Check(subject, True, "within the intervals")


def check_bias(claims: Sequence[CellClaim], results: Sequence[CellResult]) -> list[Check]:
    """Compare claimed utilities with those here over all cells of each model, and of all models.

    Each one may exceed the own one by noise, but not all of them: the mean of the differences in standard errors is
    tested on one side, at a level of 0.001 for all these tests. The utility of a cell is that of its worst attack
    here. By the games that choose, it is the mean over the attacks, of which the lowest would be biased.

    Args:
        claims: Claims for cells.
        results: Results of the same cells on this machine.
    """
    found: dict[str, dict[str, list[float]]] = {"utility": {}, CHOSEN: {}}
    for claim, result in zip(claims, results, strict=True):
        own = {one.attack: one for one in make_claim(claim.cell, result).attacks}
        pairs = sorted(
            ((one, own[one.attack]) for one in claim.attacks if one.attack in own), key=lambda p: p[1].chosen
        )
        excesses = {
            "utility": _excess([(one.measured.utility, other.measured.utility) for one, other in pairs[:1]]),
            CHOSEN: _excess([_chosen(one, result)[0][1:] for one, _ in pairs]),
        }
        for name, excess in excesses.items():
            for group in (claim.model, _EVERY):
                found[name].setdefault(group, []).append(excess)
    checks = []
    for name, groups in found.items():
        most, limit = -np.inf, NormalDist().inv_cdf(1 - 0.001 / max(1, len(groups)))
        message = "nothing to compare"
        for group, values in groups.items():
            known = np.array([one for one in values if one == one])
            z = float(known.sum() / max(1.0, np.sqrt(known.size)))
            if known.size and z > most:
                over = f"{z:.1f} standard errors over {known.size} cells"
                most, message = z, f"claims for {group} exceed those here by {over}; {limit:.1f} may be"
        checks.append(Check(f"bias of {name}", most <= limit, message))
    return checks


def check_fresh(claims: Sequence[CellClaim], results: Sequence[CellResult]) -> list[Check]:
    """Compare the claimed worst cases with those of cells with a seed that nobody could know, for each model.

    A model that recognises the games of a public seed is good there only. The mean of the differences over all cells of
    a model is tested on one side, at a level of 0.001. Cells of a scenario share their games, so their noise counts as
    the same. Searches with other seeds find other attacks, which adds an error of its own to each cell. The
    interval of a claim counts at most as much as the one here, for it proves nothing.

    Args:
        claims: Claims for cells.
        results: Results of the same cells with the other seed on this machine.
    """
    pairs: dict[str, list[tuple[CellClaim, CellResult]]] = {}
    for claim, result in zip(claims, results, strict=True):
        pairs.setdefault(claim.model, []).append((claim, result))
    return [_check_fresh(model, mine) for model, mine in pairs.items()]


def _check_fresh(model: str, pairs: Sequence[tuple[CellClaim, CellResult]]) -> Check:
    subject, differences = f"{model} in games with a new seed", list[float]()
    noises: dict[str, float] = {}
    for claim, result in pairs:
        if result.failed:
            return Check(subject, False, f"{claim.cell.key} failed here: {result.failed}")
        own_claim = make_claim(claim.cell, result)
        if not claim.attacks or not own_claim.attacks:
            continue
        claimed, own = (min(each.attacks, key=lambda one: one.chosen).measured.utility for each in (claim, own_claim))
        differences.append((claimed.mean or 0.0) - (own.mean or 0.0))
        half = own.half_95 or 0.0
        noise = float(np.hypot(half, min(half, claimed.half_95 or 0.0))) / _NORMAL_95
        noises[claim.scenario] = noises.get(claim.scenario, 0.0) + noise
    if not differences:
        return Check(subject, True, "no attack was played there")
    number, lead = len(differences), float(np.mean(differences))
    error = float(np.hypot(np.linalg.norm(list(noises.values())) / number, _SEARCH_ERROR / number**0.5))
    message = f"claims exceed those here by {lead:.4f} on average over {number} cells; "
    return Check(subject, lead <= _NORMAL_999 * error, message + f"{_NORMAL_999 * error:.4f} may be")


def _excess(pairs: Sequence[tuple[ClaimedScore, ClaimedScore]]) -> float:
    """Return the mean excess of claimed scores over own ones, in standard errors of a difference; NaN without one."""
    found = []
    for claimed, own in pairs:
        if claimed.mean is None or own.mean is None:
            continue
        error = 2**0.5 * (own.half_95 or 0.0) / _NORMAL_95
        found.append((claimed.mean - own.mean) / max(error, _LEAST_ERROR))
    return float(np.mean(found)) if found else np.nan


def _chosen(claim: Claim, result: CellResult) -> list[tuple[str, ClaimedScore, ClaimedScore]]:
    """Return the utilities in the games for choosing, by trust and of a blind choice, claimed and here."""
    row = next(row for row in result.rows if row.attack == claim.attack)
    claimed = {CHOSEN: (claim.chosen, "utility"), _CHOSEN_BLIND: (claim.chosen_blind, "blind")}
    return [
        (name, ClaimedScore(mean=mean, half_95=None), ClaimedScore.of(row.chosen[kind]))
        for name, (mean, kind) in claimed.items()
    ]


def within(claimed: ClaimedScore, own: ClaimedScore) -> bool:
    """Return whether two means differ by sampling noise at most, by the own interval or else the claimed one."""
    if claimed.mean is None or own.mean is None:
        return claimed.mean == own.mean
    half = own.half_95 if own.half_95 is not None else claimed.half_95 or 0.0
    return abs(claimed.mean - own.mean) <= half * 2**0.5 + ROUNDING
