"""What consumers get who go by trust."""

from collections.abc import Sequence

import numpy as np

from roletrust_env.game.consumer import Bought, buy
from roletrust_env.metrics.score import Flags, Floats, Score, ratio


def utility(trust: Floats, offered: Floats) -> Score:
    """The quality that a consumer gets who always goes to the most trusted provider, over the best that there was.

        utility = sum over rounds t of offered[t, argmax trust[t - 1]] / sum over rounds t of max offered[t]

    Trust is what was published when the service was chosen: after the round before. Of equals each is as likely. Where
    providers treat raters differently, every rater is such a consumer, and both sums are over all of them, too.

    Args:
        trust: of the providers, (T, P, ...), NaN where one is absent.
        offered: the quality of each for whoever came, (T, P, ...), NaN where one did not serve, see `Game.offered`; or
            for each rater, (T, S, P, ...).
    """
    bought = _bought(trust, offered)
    return share_of_best(bought.got, bought.best)


def blind_utility(trust: Floats, offered: Floats) -> Score:
    """The same of a consumer that goes to any provider, each as likely: what trust has to beat.

        utility = sum over rounds t of mean offered[t] / sum over rounds t of max offered[t]

    Args:
        trust: as for `utility`; it says who could have been chosen.
        offered: as for `utility`.
    """
    bought = _bought(trust, offered)
    return share_of_best(bought.blind, bought.best)


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


def _bought(trust: Floats, offered: Floats) -> Bought:
    return buy(np.asarray(trust, np.float64)[:-1], np.asarray(offered, np.float64)[1:], axis=1)


def share_of_best(got: Floats, best: Floats) -> Score:
    """What consumers got over the best that there was, see `utility`.

        share = sum over rounds t of got[t] / sum over rounds t of best[t]

    Args:
        got: the quality that they got, (T, ...).
        best: the best that there was, (T, ...).
    """
    most = best.sum(axis=0)
    return Score.where(most > 0, ratio(got.sum(axis=0), most), "no provider ever served well")
