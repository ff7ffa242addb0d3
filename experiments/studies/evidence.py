"""What `roletrust rate` says of later ratings: which order of ranks forecasts them, and whether its
intervals cover them.

A log is cut in half, by its ratings. Each model rates the first half, and every agent that is rated
in both is compared with the mean of its ratings in the second half: by Spearman's correlation, with
intervals over agents, for three orders (by the lower end of Wilson's interval, by trust, and by the
estimate of `rate`), and by the share of means in the interval of `rate`. A minute.
"""

from pathlib import Path
from statistics import NormalDist
from typing import NamedTuple

import numpy as np

from roletrust_env.logs import Log, rate, read, write_log
from roletrust_env.logs.calibration import first
from roletrust_env.metrics.confidence import Interval
from roletrust_env.metrics.resampling import correlation, interval, ranks
from roletrust_env.storage.markdown import markdown_table
from roletrust_env.trust.key_index import Floats
from studies.study import Recipe, Run, Study
from studies.suspects import read_otc

MONTH = 2_592_000.0
GROUPS = {"1 to 3": (1, 4), "4 to 15": (4, 16), "16 or more": (16, 10**9)}
"""Numbers of raters, at least and below."""


class Options(NamedTuple):
    """What is rated.

    Attributes:
        log: File of Bitcoin OTC, which is not in the repository; a synthetic log if it is missing.
        model: Trust models.
    """

    log: Path = Path("logs/bitcoin-otc/otc_network.csv.gz")
    model: tuple[str, ...] = ("leave-one-out", "mean", "role-trust", "all-time-mean")


RECIPES = {"evidence": Recipe(Options(), {"evidence.md": "real/evidence.md"})}


def lower_end(trust: Floats, raters: Floats) -> Floats:
    """Return the lower end of Wilson's 95% interval of trust as the mean of so many raters."""
    z = NormalDist().inv_cdf(0.975)
    half = z * np.sqrt(trust * (1 - trust) * raters + z * z / 4)
    ends: Floats = (trust * raters + z * z / 2 - half) / (raters + z * z)
    return ends


def later_ratings(log: Log, model: str, seed: int) -> Run:
    """Return how a model does on the second half of a log after the first."""
    half = len(log.values) // 2
    later = first(log, slice(half, None))
    table = rate(first(log, slice(half)), model=model, every=MONTH).ratees.set_index("name")
    counts = np.bincount(later.ratees, minlength=log.shape[1])
    means = np.bincount(later.ratees, later.values, log.shape[1]) / np.maximum(counts, 1)
    place = {name: at for at, name in enumerate(log.ratee_names) if counts[at]}
    table = table[table.index.isin(list(place))]
    wanted = means[[place[name] for name in table.index]]
    trust, raters = table.trust.to_numpy(), table.raters.to_numpy()
    orders = [lower_end(trust, raters), trust, table.estimate.to_numpy()]
    low, by_trust, by_estimate = (correlation(ranks(one), ranks(wanted)) for one in orders)
    agents = np.arange(len(table))
    found = {
        "low": interval(low, agents, seed),
        "trust": interval(by_trust, agents, seed),
        "estimate": interval(by_estimate, agents, seed),
        "trust - low": interval(lambda w: by_trust(w) - low(w), agents, seed),
        "estimate - trust": interval(lambda w: by_estimate(w) - by_trust(w), agents, seed),
    }
    covered = ((table.low <= wanted) & (wanted <= table.high)).to_numpy()
    parts = {name: (raters >= least) & (raters < most) for name, (least, most) in GROUPS.items()}
    return {
        "orders": found,
        "covered": {
            name: (int(part.sum()), float(covered[part].mean()))
            for name, part in {"all": np.ones(len(table), bool), **parts}.items()
        },
        "width": float((table.high - table.low).mean()),
    }


def main(study: Study[Options]) -> None:
    """Rate the first half of a log, and write the tables."""
    options, path = study.options, study.options.log
    if path.exists():
        log, name = read_otc(path), "Bitcoin OTC"
    else:
        study.out.mkdir(parents=True, exist_ok=True)
        path, name = study.out / "log.csv.gz", "the synthetic log"
        write_log(path)
        log = read(path, scale=(-10, 10), same_agents=True)
    found = {model: later_ratings(log, model, study.seed) for model in options.model}
    orders = [
        [model, *(_text(value) for value in run["orders"].values())] for model, run in found.items()
    ]
    shares = [
        [
            model,
            *(f"{share:.3f} of {many}" for many, share in run["covered"].values()),
            f"{run['width']:.2f}",
        ]
        for model, run in found.items()
    ]
    header = next(iter(found.values()))
    study.page(
        "evidence.md",
        f"Rank correlation with the means of later ratings, {name}:",
        markdown_table(["model", *header["orders"]], orders, names=1),
        "Share of these means in the intervals, by number of raters, and mean width:",
        markdown_table(["model", *header["covered"], "width"], shares, names=1),
    )


def _text(value: Interval) -> str:
    return "{:.3f} ({:.3f}, {:.3f})".format(*value)
