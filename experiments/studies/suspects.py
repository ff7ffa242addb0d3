"""Whether `roletrust rate --suspects` finds rings of accounts, and whether it accuses honest clubs.

New accounts are planted in a log of real ratings. Each rates five of some targets, which have 2 to
20 ratings, and as cover some of the agents with at least 30 ratings, as one of their raters did.
The members of a ring give targets the best rating. Those of an honest club give what one of their
raters gave. Accounts are found if they are in one group of raters that rate alike. The group is
accused if its ratings are further from those of others than in each of 19 shuffled logs. The
false-positive rate is the share of other shuffled logs in which there is any group. In the log
itself, accused raters are compared with labels of fraud. Five minutes on one core.
"""

import csv
from collections import Counter
from functools import lru_cache
from itertools import product
from pathlib import Path
from typing import NamedTuple

import numpy as np

from roletrust_env.logs.log import Log, read
from roletrust_env.logs.sources import Reading
from roletrust_env.logs.suspects import find_suspects
from roletrust_env.storage.markdown import markdown_table
from roletrust_env.trust.key_index import Floats, Ints
from studies.study import Recipe, Run, Study

FEW, MANY = (2, 20), 30
"""Numbers of ratings of targets, at least and at most, and of the agents that are cover, at
least."""

_SHUFFLES = 19  # of a log with planted accounts: the smallest p is 0.05
_SIGNIFICANT = 0.05  # largest p of a group that is accused
_LOGS = 100  # shuffled logs of a run that counts false positives


class Options(NamedTuple):
    """What is planted, and where.

    Attributes:
        log: File of Bitcoin OTC, which is not in the repository.
        labels: File of users and their labels, 1 for benign and -1 for fraud. Optional.
        size: Numbers of accounts.
        cover: Number of ratings of each account as cover.
        targets: Numbers of agents, of which each account rates `rated`.
        rated: Number of targets that an account rates.
        runs: Number of logs for each kind and size.
        shuffles: Number of shuffled logs in which groups are counted, a multiple of 100.
    """

    log: Path = Path("logs/bitcoin-otc/otc_network.csv.gz")
    labels: Path = Path("logs/bitcoin-otc/otc_gt.csv")
    size: tuple[int, ...] = (5, 10, 20, 50)
    cover: int = 5
    targets: tuple[int, ...] = (5, 20)
    rated: int = 5
    runs: int = 10
    shuffles: int = 1000


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
    """Return a log without times to which new accounts are added, and their positions.

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
    raters = np.repeat(accounts, rated + cover)
    columns = ((log.raters, raters), (log.ratees, ratees), (log.values, values))
    who, whom, what = (np.concatenate(parts) for parts in columns)
    names = [*log.rater_names, *(f"planted {n}" for n in range(size))]
    return log._replace(
        raters=who,
        ratees=whom,
        values=what,
        times=None,
        rater_names=names,
        ratee_names=names,
    ), accounts


def plant(options: Options, size: int, targets: int, honest: bool, seed: int) -> Run:
    """Return the share of the accounts of one log in one group, its distance from others, and
    whether it is accused.
    """
    rng = np.random.default_rng(seed)
    log, accounts = planted(
        read_otc(options.log), size, targets, options.rated, options.cover, rng, honest=honest
    )
    best: Run = {"found": 0.0, "apart": None, "accused": False}
    for group in find_suspects(log, shuffles=_SHUFFLES, seed=seed).groups:
        share = float(np.isin(accounts, group.raters).mean())
        if share > best["found"]:
            accused = group.p <= _SIGNIFICANT
            best = {"found": share, "apart": group.apart, "accused": accused}
    return best


def count_groups(options: Options, seed: int) -> Run:
    """Return the share of shuffled logs with any group, and the mean number of groups."""
    suspects = find_suspects(read_otc(options.log), shuffles=_LOGS, seed=seed)
    return {"any": suspects.false_positive_rate, "groups": suspects.false_groups}


def count_labels(options: Options, seed: int) -> Run:
    """Return the numbers of labelled raters of the log and of those that are accused."""
    log = read_otc(options.log)
    with options.labels.open(newline="") as file:
        labels = {user: int(label) for user, label in csv.reader(file)}
    groups = find_suspects(log, seed=seed).groups
    accused = [at for group in groups if group.p <= _SIGNIFICANT for at in group.raters]
    run: Run = {"accused": len(accused)}
    for name, raters in (("all", np.unique(log.raters)), ("suspect", accused)):
        counts = Counter(labels.get(str(log.rater_names[at])) for at in raters)
        run |= {f"{name}_fraud": counts[-1], f"{name}_benign": counts[1]}
    return run


def main(study: Study[Options]) -> None:
    """Plant accounts in a log, and write the table."""
    options = study.options
    kinds = {"ring": False, "honest club": True}
    files = {"log": str(options.log), "labels": str(options.labels)}
    settings = {**options._asdict(), "seed": study.seed, **files}
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
    labels = ""
    if options.labels.exists():
        run = study.play(count_labels, {"labels": (options, study.seed)}, settings)["labels"]
        labels = (
            f"In the log itself, {run['accused']} raters are accused. They include "
            f"{run['suspect_fraud']} of {run['all_fraud']} raters that are labelled as fraud, and "
            f"{run['suspect_benign']} of {run['all_benign']} that are labelled as benign."
        )
    rows = []
    for kind, targets, size in product(kinds, options.targets, options.size):
        keys = (f"{kind} {targets} {size} {run}" for run in range(options.runs))
        runs = [runs_by_key[key] for key in keys if key in runs_by_key]
        apart = [run["apart"] for run in runs if run["apart"] is not None]
        rows.append(
            [
                kind,
                f"{options.rated} of {targets}",
                f"{size}",
                f"{np.mean([run['found'] for run in runs]):.2f}",
                f"{np.mean(apart):.2f}" if apart else "-",
                f"{sum(run['accused'] for run in runs)} of {len(runs)}",
            ]
        )
    rate, groups = (np.mean([run[name] for run in chance.values()]) for name in ("any", "groups"))
    header = ["planted", "targets", "accounts", "share found in one group", "apart", "accused"]
    study.page(
        "suspects.md",
        markdown_table(header, rows, names=1),
        f"False-positive rate: {rate:.1%} of {len(chance) * _LOGS:,} shuffled logs had a group, "
        f"with {groups:.3f} groups per log on average.",
        labels,
    )
