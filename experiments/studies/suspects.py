"""Whether `roletrust rate --suspects` finds rings of accounts, and whether it accuses honest clubs.

New accounts are planted in a log of real ratings. Each rates five of some targets, which have 2 to
20 ratings, and as cover some of the agents with at least 30 ratings, as one of their raters did.
The members of a ring give targets the best rating, those of an honest club what one of their raters
gave. They are found if they are among the groups of raters that rate alike, and accused if that
group also moves ranks more, and is further from what others say, than in each of 19 shuffled logs.
The rate of groups in other shuffled logs is measured, too. Ten minutes on one core.
"""

from functools import lru_cache
from itertools import product
from pathlib import Path
from typing import NamedTuple

import numpy as np

from roletrust_env.logs.log import Log, read
from roletrust_env.logs.log_rounds import log_rounds
from roletrust_env.logs.sources import Reading
from roletrust_env.logs.suspects import SHUFFLES, alike, find_suspects, shuffled, threshold
from roletrust_env.storage.markdown import markdown_table
from roletrust_env.trust import make_trust_model
from roletrust_env.trust.key_index import Floats, Ints
from studies.study import Recipe, Run, Study

FEW, MANY = (2, 20), 30
"""Numbers of ratings of targets, at least and at most, and of the agents that are cover, at
least."""

_QUARTER = 90 * 86_400.0  # seconds
_LOGS = 10  # shuffled logs of a run


class Options(NamedTuple):
    """What is planted, and where.

    Attributes:
        log: File of Bitcoin OTC, which is not in the repository.
        model: Trust model.
        size: Numbers of accounts.
        cover: Number of ratings of each account as cover.
        targets: Numbers of agents, of which each account rates `rated`.
        rated: Number of targets that an account rates.
        runs: Number of logs for each kind and size.
        shuffles: Number of shuffled logs in which groups are counted.
    """

    log: Path = Path("logs/bitcoin-otc/otc_network.csv.gz")
    model: str = "leave-one-out"
    size: tuple[int, ...] = (5, 10, 20, 50)
    cover: int = 5
    targets: tuple[int, ...] = (5, 20)
    rated: int = 5
    runs: int = 2
    shuffles: int = 100


RECIPES = {"suspects": Recipe(Options(), {"suspects.md": "real/suspects.md"})}


@lru_cache(1)
def read_otc(path: Path) -> Log:
    """Return the log of Bitcoin OTC."""
    columns = {"rater": "1", "ratee": "2", "rating": "3", "time": "4"}
    reading = Reading(header=False, repeats=True)
    return read(path, **columns, scale=(-10, 10), same_agents=True, reading=reading)


def planted(
    log: Log,
    size: int,
    targets: int,
    rated: int,
    cover: int,
    rng: np.random.Generator,
    *,
    honest: bool,
) -> tuple[Log, Ints]:
    """Return a log with new accounts that rate targets in its second half, and their places.

    Args:
        log: Log in which members rate members.
        size: Number of accounts.
        targets: Number of targets.
        rated: Number of those that each rates.
        cover: Number of other agents that each rates.
        rng: Random generator.
        honest: Whether they give the targets what other raters gave, and not the best rating.
    """
    accounts, count = len(log.rater_names) + np.arange(size), np.bincount(log.ratees)
    order, starts = np.argsort(log.ratees, kind="stable"), np.cumsum(count) - count
    few, popular = (
        np.flatnonzero((count >= FEW[0]) & (count <= FEW[1])),
        np.flatnonzero(count >= MANY),
    )
    chosen = rng.choice(few, targets, replace=False)
    parts = (
        (
            rng.choice(agents, many, replace=False)
            for agents, many in ((chosen, rated), (popular, cover))
        )
        for _ in accounts
    )
    ratees = np.concatenate([part for both in parts for part in both])
    values: Floats = log.values[order[starts[ratees] + rng.integers(0, count[ratees])]]
    if not honest:
        values = np.where(np.isin(ratees, chosen), 1.0, values)
    times = log.times if log.times is not None else np.zeros(0)
    when = np.concatenate([times, rng.uniform(times[len(times) // 2], times[-1], len(ratees))])
    by_time = np.argsort(when, kind="stable")
    raters = np.repeat(accounts, rated + cover)
    columns = ((log.raters, raters), (log.ratees, ratees), (log.values, values))
    who, whom, what = (np.concatenate(parts)[by_time] for parts in columns)
    names = [*log.rater_names, *(f"planted {n}" for n in range(size))]
    return log._replace(
        raters=who,
        ratees=whom,
        values=what,
        times=when[by_time],
        rater_names=names,
        ratee_names=names,
    ), accounts


def plant(options: Options, size: int, targets: int, honest: bool, seed: int) -> Run:
    """Return the share of the accounts of one log in one group, and whether it is accused."""
    rng = np.random.default_rng(seed)
    log, accounts = planted(
        read_otc(options.log), size, targets, options.rated, options.cover, rng, honest=honest
    )
    search = find_suspects(
        make_trust_model(options.model), log, log_rounds(log, _QUARTER), seed=seed
    )
    shares = [
        (np.isin(accounts, group.raters).sum() / size, group.p * (SHUFFLES + 1) <= 1)
        for group in search.groups
    ]
    share, accused = max(shares, default=(0.0, False))
    return {"found": float(share), "accused": bool(share and accused)}


def count_groups(options: Options, seed: int) -> Run:
    """Return the number of groups in shuffled logs."""
    rng = np.random.default_rng(seed)
    joined, _ = threshold([shuffled(read_otc(options.log), rng) for _ in range(SHUFFLES)])
    return {
        "groups": sum(
            len(alike(shuffled(read_otc(options.log), rng), joined)) for _ in range(_LOGS)
        )
    }


def main(study: Study[Options]) -> None:
    """Plant accounts in a log, and write the table."""
    options = study.options
    kinds = {"ring": False, "honest club": True}
    settings = {**options._asdict(), "seed": study.seed, "log": str(options.log)}
    jobs = {
        f"{kind} {targets} {size} {run}": (options, size, targets, honest, study.seed + run)
        for kind, honest in kinds.items()
        for targets in options.targets
        for size in options.size
        for run in range(options.runs)
    }
    runs_by_key = study.play(plant, jobs, settings)
    chance = study.play(
        count_groups,
        {f"shuffled {n}": (options, study.seed + n) for n in range(options.shuffles // _LOGS)},
        settings,
    )
    rows = []
    for kind, targets, size in product(kinds, options.targets, options.size):
        keys = (f"{kind} {targets} {size} {run}" for run in range(options.runs))
        runs = [runs_by_key[key] for key in keys if key in runs_by_key]
        share, accused = (
            np.mean([run["found"] for run in runs]),
            sum(run["accused"] for run in runs),
        )
        rows.append(
            [
                kind,
                f"{options.rated} of {targets}",
                f"{size}",
                f"{share:.2f}",
                f"{accused} of {len(runs)}",
            ]
        )
    groups = sum(run["groups"] for run in chance.values())
    study.page(
        "suspects.md",
        markdown_table(
            ["planted", "targets", "accounts", "share found in one group", "accused"], rows, names=1
        ),
        f"In {len(chance) * _LOGS} shuffled logs there were {groups} groups.",
    )
