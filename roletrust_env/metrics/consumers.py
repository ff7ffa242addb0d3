"""What consumers get who go by trust."""

from collections.abc import Sequence

import numpy as np

from roletrust_env.metrics.score import Flags, Floats, Score, ratio


def utility(trust: Floats, quality: Floats) -> Score:
    """The quality that a consumer gets who always goes to the most trusted provider, over the best that there was.

        utility = sum over rounds t of quality[t, argmax trust[t - 1]] / sum over rounds t of max quality[t]

    Trust is what was published when the service was chosen: after the round before. Of equals each is as likely. Where
    providers treat raters differently, every rater is such a consumer, and both sums are over all of them, too.

    Args:
        trust: of the providers, (T, P, ...), NaN where one is absent.
        quality: as delivered, (T, P, ...), or to each rater, (T, S, P, ...).
    """
    known = np.where(np.isnan(trust[:-1]), -np.inf, trust[:-1])
    chosen = (known == known.max(axis=1, keepdims=True)) & np.isfinite(known)
    served = np.asarray(quality[1:], np.float64)
    served = served if served.ndim > chosen.ndim else served[:, None]
    got = ratio((chosen[:, None] * served).sum(axis=2), chosen.sum(axis=1)[:, None]).sum(axis=1)
    best = served.max(axis=2).sum(axis=1).sum(axis=0)
    return Score.where(best > 0, ratio(np.nansum(got, axis=0), best), "no provider ever served well")


def robustness(served: Flags, buyers: Sequence[int], sellers: Sequence[int]) -> Score:
    """Robustness after Zhang, Jiang, Zhang and Ng (2012), in [-1, 1]: 1 is robust, 0 vulnerable, below 0 defeated.

        RE = (services that honest buyers had of honest sellers - of dishonest ones) / services that they had

    Args:
        served: who was served by whom, (T, S, P, ...), boolean.
        buyers: places of the honest raters.
        sellers: places of the honest providers.
    """
    theirs = np.asarray(served)[:, list(buyers)].sum(axis=(0, 1))  # (P, ...)
    honest, everything = theirs[list(sellers)].sum(axis=0), theirs.sum(axis=0)
    share = ratio(2.0 * honest - everything, everything)
    return Score.where(everything > 0, share, "no honest rater was ever served")
