"""Whether `roletrust rate --suspects` finds rings of accounts, and whether it accuses honest clubs.

New accounts are planted in a log of real ratings. Each rates the same five agents, which have 2 to 20 ratings, and as
cover some of those with at least 30 ratings, as one of their raters did. The members of a ring give the five the best
rating, those of an honest club what one of their raters gave. They are found if they are among the groups of raters
that rate alike, and accused if they also move ranks more, and are further from what others say, than in each of 19
shuffled logs. The rate of groups in shuffled logs alone is measured, too. A quarter of an hour on one core.
"""

from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from roletrust_baselines.logs.rounds import log_rounds
from roletrust_baselines.logs.suspects import SHUFFLES, alike, effects, shuffled
from roletrust_env.data.columns import Columns
from roletrust_env.data.log import RatingLog, read_ratings
from roletrust_env.storage.markdown import markdown_table
from roletrust_env.trust import make_trust_model
from roletrust_env.trust.key_index import Floats, Ints
from studies.study import Recipe, Run, Study

FEW, MANY = (2, 20), 30
"""Numbers of ratings of targets, at least and at most, and of the agents that are cover, at least."""

_QUARTER = 90 * 86_400.0  # seconds
_LOGS = 10  # shuffled logs of a run


class Options(NamedTuple):
    """What is planted, and where.

    Attributes:
        log: File of Bitcoin OTC, which is not in the repository.
        model: Trust model.
        size: Numbers of accounts.
        cover: Number of ratings of each account as cover.
        targets: Number of agents that all rate.
        runs: Number of logs for each kind and size.
        shuffles: Number of shuffled logs in which groups are counted.
    """

    log: Path = Path("logs/bitcoin-otc/otc_network.csv.gz")
    model: str = "leave-one-out"
    size: tuple[int, ...] = (5, 10, 20, 50)
    cover: int = 5
    targets: int = 5
    runs: int = 5
    shuffles: int = 100


RECIPES = {"suspects": Recipe(Options(), {"suspects.md": "real/suspects.md"})}


@lru_cache(1)
def read(path: Path) -> RatingLog:
    """Return the log of Bitcoin OTC."""
    return read_ratings(path, Columns("1", "2", "3", "4"), scale=(-10, 10), same_agents=True, repeats=True)


def planted(
    log: RatingLog, size: int, targets: int, cover: int, rng: np.random.Generator, *, honest: bool
) -> tuple[RatingLog, Ints]:
    """Return a log with new accounts that rate the same targets in its second half, and their places.

    Args:
        log: Log in which members rate members.
        size: Number of accounts.
        targets: Number of agents that all rate.
        cover: Number of other agents that each rates.
        rng: Random generator.
        honest: Whether they give the targets what other raters gave, and not the best rating.
    """
    accounts, count = len(log.rater_names) + np.arange(size), np.bincount(log.ratees)
    order, starts = np.argsort(log.ratees, kind="stable"), np.cumsum(count) - count
    few, popular = np.flatnonzero((count >= FEW[0]) & (count <= FEW[1])), np.flatnonzero(count >= MANY)
    chosen = rng.choice(few, targets, replace=False)
    ratees = np.concatenate([np.r_[chosen, rng.choice(popular, cover, replace=False)] for _ in accounts])
    values: Floats = log.values[order[starts[ratees] + rng.integers(0, count[ratees])]]
    if not honest:
        values = np.where(np.isin(ratees, chosen), 1.0, values)
    times = log.times if log.times is not None else np.zeros(0)
    when = np.concatenate([times, rng.uniform(times[len(times) // 2], times[-1], len(ratees))])
    by_time = np.argsort(when, kind="stable")
    raters = np.repeat(accounts, targets + cover)
    columns = ((log.raters, raters), (log.ratees, ratees), (log.values, values))
    who, whom, what = (np.concatenate(parts)[by_time] for parts in columns)
    names = [*log.rater_names, *(f"planted {n}" for n in range(size))]
    return log._replace(
        raters=who, ratees=whom, values=what, times=when[by_time], rater_names=names, ratee_names=names
    ), accounts


def plant(options: Options, size: int, honest: bool, seed: int) -> Run:
    """Return whether the accounts of one log are found, and whether they are accused."""
    rng = np.random.default_rng(seed)
    log, accounts = planted(read(options.log), size, options.targets, options.cover, rng, honest=honest)
    groups = [set(raters.tolist()) for raters, _ in alike(log)]
    best = max(groups, key=lambda group: len(group.intersection(accounts.tolist())), default=set())
    share = len(best.intersection(accounts.tolist())) / size
    model, numbers = make_trust_model(options.model), log_rounds(log, _QUARTER)
    logs = [log, *(shuffled(log, rng) for _ in range(SHUFFLES))] if share else []
    measured = np.array([effects(model, one, numbers, [accounts])[0] for one in logs])
    return {"found": share, "accused": bool(share) and bool((measured[0] > measured[1:]).all())}


def count_groups(options: Options, seed: int) -> Run:
    """Return the number of groups in shuffled logs."""
    rng = np.random.default_rng(seed)
    return {"groups": sum(len(alike(shuffled(read(options.log), rng))) for _ in range(_LOGS))}


def main(arguments: Sequence[str] | None = None) -> None:
    """Plant accounts in a log, and write the table."""
    with Study(__name__, RECIPES, arguments) as study:
        options = study.options
        kinds = {"ring": False, "honest club": True}
        settings = {**options._asdict(), "seed": study.seed, "log": str(options.log)}
        jobs = {
            f"{kind} {size} {run}": (options, size, honest, study.seed + run)
            for kind, honest in kinds.items()
            for size in options.size
            for run in range(options.runs)
        }
        found = study.play(plant, jobs, settings)
        chance = study.play(
            count_groups,
            {f"shuffled {n}": (options, study.seed + n) for n in range(options.shuffles // _LOGS)},
            settings,
        )
        rows = []
        for kind in kinds:
            for size in options.size:
                runs = [found[key] for run in range(options.runs) if (key := f"{kind} {size} {run}") in found]
                share = np.mean([run["found"] for run in runs])
                accused = sum(run["accused"] for run in runs)
                rows.append([kind, str(size), f"{share:.2f}", f"{accused} of {len(runs)}"])
        groups = sum(run["groups"] for run in chance.values())
        study.page(
            "suspects.md",
            markdown_table(["planted", "accounts", "share found in one group", "accused"], rows, names=1),
            f"In {len(chance) * _LOGS} shuffled logs there were {groups} groups.",
        )


if __name__ == "__main__":
    main()
