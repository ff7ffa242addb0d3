"""Metrics of detection: separation of attackers, the positive class, from honest agents by their
trust.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from roletrust_env.metrics.score import (
    AgentFloats,
    Flags,
    Floats,
    RoundWeights,
    Score,
    TrustByRound,
    mean_or_nan,
    ratio,
)


class Classification(NamedTuple):
    """Quality of the classification by a threshold of trust, one number for each game.

    Attributes:
        mcc: Correlation of Matthews (1975) in [-1, 1]: 1 is perfect, 0 is chance.
        precision: Share of attackers among the agents below the threshold.
        recall: Share of the attackers that are below the threshold.
        false_alarms: Share of the honest agents that are below the threshold.
    """

    mcc: Score
    precision: Score
    recall: Score
    false_alarms: Score


def auc(trust: AgentFloats, attackers: Sequence[int]) -> Score:
    """Return the area under the ROC curve: the probability that an attacker has less trust than an
    honest agent.

        auc = (pairs with trust[attacker] < trust[honest] + half of the pairs with equal trust) /
                pairs

    This is the statistic of Mann and Whitney (1947) divided by the number of pairs (Hanley and
    McNeil 1982).

    Args:
        trust: Trust of each agent, in a round or on average, shape (N, ...); NaN where one is
            absent.
        attackers: Indices of the attackers.
    """
    bad = _mask(trust, attackers)
    difference = trust[~bad][None] - trust[bad][:, None]  # (attackers, honest, ...)
    known = ~np.isnan(difference)
    wins = (difference > 0) + 0.5 * (difference == 0)
    share = ratio((wins * known).sum(axis=(0, 1)), known.sum(axis=(0, 1)))
    return Score.where(~np.isnan(share), share, "there are no attackers or no honest agents")


def classify(
    trust: AgentFloats, attackers: Sequence[int], threshold: float = 0.5
) -> Classification:
    """Classify the agents with trust below a threshold as attackers, and return the quality of this
    classification.

    With TP attackers and FP honest agents below the threshold, and FN attackers and TN honest
    agents not below it:

        mcc       = (TP TN - FP FN) / sqrt((TP + FP) (TP + FN) (TN + FP) (TN + FN))
        precision = TP / (TP + FP),   recall = TP / (TP + FN),   false_alarms = FP / (FP + TN)

    Args:
        trust: Trust of each agent, shape (N, ...); NaN where one is absent.
        attackers: Indices of the attackers.
        threshold: Threshold of trust.
    """
    bad = _mask(trust, attackers).reshape(-1, *[1] * (trust.ndim - 1))
    present, low = ~np.isnan(trust), trust < threshold
    tp, fp = (low & bad).sum(axis=0), (low & ~bad).sum(axis=0)
    fn, tn = (present & ~low & bad).sum(axis=0), (present & ~low & ~bad).sum(axis=0)
    product = 1.0 * (tp + fp) * (tp + fn) * (tn + fp) * (tn + fn)
    mcc = ratio(1.0 * tp * tn - 1.0 * fp * fn, np.sqrt(product))
    return Classification(
        Score.where(
            product > 0, mcc, "all agents, or none, are attackers or are classified as such"
        ),
        Score.where(tp + fp > 0, ratio(tp, tp + fp), "no agent is classified as an attacker"),
        Score.where(tp + fn > 0, ratio(tp, tp + fn), "there are no attackers"),
        Score.where(fp + tn > 0, ratio(fp, fp + tn), "there are no honest agents"),
    )


def rounds_to_detection(
    trust: TrustByRound, attackers: Sequence[int], start: int = 0, alarms: float = 0.01
) -> Score:
    """Return the number of rounds from the start of an attack until its attackers are detected.

    They are detected when some threshold has all of them and at most a share `alarms` of the honest
    agents below it.

        rounds = min {r >= 0: share of the honest k with trust[start + r, k] <= max over attackers
                of trust[start + r]
                      is at most alarms}

    Args:
        trust: Trust of shape (T, N, ...), NaN where an agent is absent.
        attackers: Indices of the attackers.
        start: First round of the attack.
        alarms: Largest share of honest agents that can be classified as attackers.

    Raises:
        ValueError: `start` is not a round of the game.
    """
    if not 0 <= start < len(trust):
        raise ValueError(
            f"start is {start}; it must be a round of the game, from 0 to {len(trust) - 1}"
        )
    bad = _mask(trust[0], attackers)
    of_attackers, of_honest = trust[start:, bad], trust[start:, ~bad]
    highest = np.where(np.isnan(of_attackers), -np.inf, of_attackers).max(axis=1, initial=-np.inf)
    wrong = ratio((of_honest <= highest[:, None]).sum(axis=1), (~np.isnan(of_honest)).sum(axis=1))
    detected = np.isfinite(highest) & (wrong <= alarms)
    return Score.where(
        detected.any(axis=0), detected.argmax(axis=0), "the attackers were never detected"
    )


def false_alarms(
    trust: TrustByRound,
    honest: Sequence[int],
    threshold: float = 0.5,
    *,
    weights: RoundWeights | None = None,
) -> Score:
    """Return how often the trust of honest agents is below the threshold, for example because of a
    perturbation.

        share = mean over rounds t and honest agents k of [trust[t, k] < threshold]

    Args:
        trust: Trust of shape (T, N, ...), NaN where an agent is absent.
        honest: Indices of the honest agents.
        threshold: Threshold of trust.
        weights: Weights of the rounds, shape (T,), see `Scenario.round_weights`; None weights all
            alike.
    """
    of_honest = trust[:, list(honest)]
    share = mean_or_nan(
        np.where(np.isnan(of_honest), np.nan, of_honest < threshold), (0, 1), weights
    )
    return Score.where(~np.isnan(share), share, "no honest agent was ever present")


def _mask(trust: Floats, indices: Sequence[int]) -> Flags:
    """Return a mask over the first axis that is true at the given indices."""
    mask = np.zeros(len(trust), bool)
    mask[list(indices)] = True
    return mask
