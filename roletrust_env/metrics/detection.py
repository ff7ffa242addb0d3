"""How well trust tells attackers from honest agents. An attacker is what is to be found: the positive class."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from roletrust_env.metrics.score import Flags, Floats, Score, mean_or_nan, ratio


class Classified(NamedTuple):
    """How a threshold of trust sorts agents into attackers and honest ones, one number for each game.

    Attributes:
        mcc: correlation of Matthews (1975), in [-1, 1]: 1 all right, 0 as by chance.
        precision: share of attackers among those who are under the threshold.
        recall: share of the attackers who are.
        false_alarms: share of the honest who are.
    """

    mcc: Score
    precision: Score
    recall: Score
    false_alarms: Score


def auc(trust: Floats, attackers: Sequence[int]) -> Score:
    """Area under the ROC curve: the chance that an attacker has less trust than an honest agent, ties counting half.

        auc = (pairs with trust[attacker] < trust[honest] + half of those with equal trust) / pairs

    That is the statistic of Mann and Whitney (1947) over the number of pairs (Hanley and McNeil 1982).

    Args:
        trust: of each agent, (N, ...), at some moment or on average; NaN where one is absent.
        attackers: places of the attackers.
    """
    bad = _marked(trust, attackers)
    difference = trust[~bad][None] - trust[bad][:, None]  # (attackers, honest, ...)
    known = ~np.isnan(difference)
    wins = (difference > 0) + 0.5 * (difference == 0)
    share = ratio((wins * known).sum(axis=(0, 1)), known.sum(axis=(0, 1)))
    return Score.where(~np.isnan(share), share, "there are no attackers or no honest agents")


def classified(trust: Floats, attackers: Sequence[int], threshold: float = 0.5) -> Classified:
    """Whom a threshold takes for an attacker: who has less trust.

    With TP attackers and FP honest agents under the threshold, and FN attackers and TN honest agents not under it:

        mcc       = (TP TN - FP FN) / sqrt((TP + FP) (TP + FN) (TN + FP) (TN + FN))
        precision = TP / (TP + FP),   recall = TP / (TP + FN),   false_alarms = FP / (FP + TN)

    Args:
        trust: of each agent, (N, ...); NaN where one is absent.
        attackers: places of the attackers.
        threshold: of trust.
    """
    bad = _marked(trust, attackers).reshape(-1, *[1] * (trust.ndim - 1))
    there, low = ~np.isnan(trust), trust < threshold
    hits, alarms = (low & bad).sum(axis=0), (low & ~bad).sum(axis=0)
    missed, passed = (there & ~low & bad).sum(axis=0), (there & ~low & ~bad).sum(axis=0)
    product = 1.0 * (hits + alarms) * (hits + missed) * (passed + alarms) * (passed + missed)
    mcc = ratio(1.0 * hits * passed - 1.0 * alarms * missed, np.sqrt(product))
    return Classified(
        Score.where(product > 0, mcc, "all agents, or none, are attackers or are taken for such"),
        Score.where(hits + alarms > 0, ratio(hits, hits + alarms), "nobody is taken for an attacker"),
        Score.where(hits + missed > 0, ratio(hits, hits + missed), "there are no attackers"),
        Score.where(alarms + passed > 0, ratio(alarms, alarms + passed), "there are no honest agents"),
    )


def rounds_to_detection(trust: Floats, attackers: Sequence[int], start: int = 0, alarms: float = 0.01) -> Score:
    """Rounds from the start of an attack until its attackers are told apart.

    They are, once some threshold has all of them below it and at most a share `alarms` of the honest.

        rounds = min {r >= 0: share of the honest k with trust[start + r, k] <= max over attackers of trust[start + r]
                      is at most alarms}

    Args:
        trust: (T, N, ...), NaN where an agent is absent.
        attackers: places of the attackers.
        start: first round of the attack.
        alarms: share of the honest that may be taken for attackers.

    Raises:
        ValueError: `start` is no round of the game.
    """
    if not 0 <= start < len(trust):
        raise ValueError(f"start is {start}; it must be a round of the game, from 0 to {len(trust) - 1}")
    bad = _marked(trust[0], attackers)
    theirs, ours = trust[start:, bad], trust[start:, ~bad]
    highest = np.where(np.isnan(theirs), -np.inf, theirs).max(axis=1, initial=-np.inf)
    wrong = ratio((ours <= highest[:, None]).sum(axis=1), (~np.isnan(ours)).sum(axis=1))
    apart = np.isfinite(highest) & (wrong <= alarms)
    return Score.where(apart.any(axis=0), apart.argmax(axis=0), "the attackers were never told apart")


def false_alarms(trust: Floats, honest: Sequence[int], threshold: float = 0.5) -> Score:
    """The share of rounds and honest agents in which trust is under the threshold, as under a perturbation.

        share = mean over rounds t and honest agents k of [trust[t, k] < threshold]

    Args:
        trust: (T, N, ...), NaN where an agent is absent.
        honest: places of the honest.
        threshold: of trust.
    """
    ours = trust[:, list(honest)]
    share = mean_or_nan(np.where(np.isnan(ours), np.nan, ours < threshold), axis=(0, 1))
    return Score.where(~np.isnan(share), share, "none of the honest was ever there")


def _marked(trust: Floats, places: Sequence[int]) -> Flags:
    """Which of the agents on the first axis are in these places."""
    marked = np.zeros(len(trust), bool)
    marked[list(places)] = True
    return marked
