"""Votes of judges on items, such as answers to questions, from a table; and the truth of some
items.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from roletrust_env.data.dialect import Dialect
from roletrust_env.data.names import JOINED, NameColumns
from roletrust_env.data.tables import Table
from roletrust_env.data.values import is_missing, named
from roletrust_env.metrics.score import ratio
from roletrust_env.randomness import generator
from roletrust_env.storage.files import write_csv
from roletrust_env.trust.grid_run import MEMORY
from roletrust_env.trust.key_index import Floats, Ints

_MAY_MISS = ("vote", "truth", "kind")
_GOLD = {"item": "item", "truth": "truth"}


class Codes(NamedTuple):
    """A column of names.

    Attributes:
        names: Names, in the order in which they first occur.
        places: Place among them in each row, shape (n,); -1 where it is missing.
    """

    names: list[str]
    places: Ints


class Votes(NamedTuple):
    """What judges say about items. An item has the same possible answers as all others.

    A judge that votes on an item several times, such as with the answers in another order, has one
    opinion about it: the share of each answer among its votes.

    Attributes:
        judges: Place of the judge of each opinion, shape (E,).
        items: Place of its item, shape (E,); a judge has one opinion about an item.
        shares: Share of each answer in it, shape (E, A), rows sum to 1.
        truth: Place of the true answer of each item, shape (I,); -1 where it is unknown.
        kinds: Place of the kind of each item, shape (I,); -1 where it is unknown.
        judge_names: Names of the judges.
        item_names: Names of the items.
        answer_names: Names of the answers.
        kind_names: Names of the kinds; a single empty one without.
    """

    judges: Ints
    items: Ints
    shares: Floats
    truth: Ints
    kinds: Ints
    judge_names: list[str]
    item_names: list[str]
    answer_names: list[str]
    kind_names: list[str]

    @property
    def shape(self) -> tuple[int, int, int]:
        """The number of judges, of items and of answers."""
        return len(self.judge_names), len(self.item_names), len(self.answer_names)

    @property
    def accuracy(self) -> Floats:
        """The share of each judge's opinions that is true, shape (J,); NaN for a judge without a
        known item.
        """
        return ratio(*self.graded(self.truth >= 0))

    def graded(self, chosen: npt.NDArray[np.bool_]) -> tuple[Floats, Floats]:
        """Return the sum of each judge's true shares on chosen items, and their number, shape (J,)
        each.

        Args:
            chosen: Whether each item is chosen, shape (I,); their truth is known.
        """
        kept = chosen[self.items]
        true = self.shares[kept, self.truth[self.items[kept]]]
        both = (
            np.bincount(self.judges[kept], w, self.shape[0]) for w in (true, np.ones(len(true)))
        )
        total, count = (one.astype(np.float64) for one in both)
        return total, count

    def answers_to(self, items: Ints) -> Ints:
        """Return the places of the answers to items among all answers to all items, shape (n,
        A).
        """
        many = len(self.answer_names)
        return items[:, None] * many + np.arange(many)

    def tally(self, weights: Floats) -> Floats:
        """Return the weight of the votes for each answer to each item, shape (I, A), by the weights
        of judges (J,).
        """
        cast, (_, *shape) = weights[self.judges, None] * self.shares, self.shape
        total = np.bincount(
            self.answers_to(self.items).ravel(), cast.ravel(), math.prod(shape)
        ).astype(np.float64)
        return total.reshape(shape)

    def only(self, chosen: npt.NDArray[np.bool_]) -> "Votes":
        """Return the votes on chosen items, shape (I,), and these items; all judges stay."""
        kept, place = chosen[self.items], np.cumsum(chosen) - 1
        return self._replace(
            judges=self.judges[kept],
            items=place[self.items[kept]],
            shares=self.shares[kept],
            truth=self.truth[chosen],
            kinds=self.kinds[chosen],
            item_names=[
                name for name, there in zip(self.item_names, chosen.tolist(), strict=True) if there
            ],
        )


def read_votes(
    path: Path,
    judge: Sequence[str] = ("judge",),
    item: str = "item",
    vote: str = "vote",
    truth: str | Path | None = None,
    kind: str | None = None,
    *,
    dialect: Dialect = Dialect(),  # noqa: B008 - immutable
    tell: Callable[[str], None] = lambda line: None,
) -> Votes:
    """Read votes: a table with a row for each vote, of any form that `read_ratings` reads.

    Columns are names, or numbers from 1; those with the names of their roles are also found by
    common ones, such as `annotator` for the judge. A row without a vote (blank, `NA`, `None`) is an
    abstention, and left out.

    Args:
        path: Path of the file.
        judge: Columns that name a judge, such as a model and its prompt.
        item: Column of the item.
        vote: Column of the vote, which may be any text or whole number.
        truth: Column of the true answer; or a file with the columns `item` and `truth`. None if no
            truth is known.
        kind: Column of the kind of the item, such as its subset; None without.
        dialect: Parts of the dialect that are known.
        tell: Function that is called with a line for the user.

    Raises:
        ValueError: The file is no such table, has no votes or too many answers, an item has two
            truths, or no truth is among the answers. Or pyarrow is missing.
        OSError: The file cannot be read.
    """
    judges_by = {f"judge {n + 1}" if n else "judge": name for n, name in enumerate(judge)}
    wanted = judges_by | {"item": item, "vote": vote} | ({"kind": kind} if kind else {})
    wanted |= {"truth": truth} if isinstance(truth, str) else {}
    table = read_codes(path, wanted, dialect, tell)
    voted = table["vote"].places >= 0
    if not voted.any():
        raise ValueError(
            f"{path} has no votes: all {len(voted):,} rows are abstentions; --vote names their "
            "column"
        )
    items, answers = table["item"], table["vote"]
    if max(int(voted.sum()), len(items.names)) * len(answers.names) * 8 > MEMORY:
        raise ValueError(
            f"{path} has {len(answers.names):,} different answers, too many for {voted.sum():,} "
            "votes;"
            " --vote names the column of the vote"
        )
    judges = _together([table[role] for role in judges_by])
    size = len(items.names)
    kinds, true = Codes([""], np.zeros(size, np.int64)), np.full(size, -1)
    if kind:
        kinds = Codes(table["kind"].names, _of_items(path, items, table["kind"], "kind"))
    if truth is not None:
        where, gold = (
            (path, table) if isinstance(truth, str) else (truth, _read_gold(truth, dialect))
        )
        among = {name: place for place, name in enumerate(answers.names)}
        answer = np.array([*(among.get(name, -1) for name in gold["truth"].names), -1])
        said = _of_items(where, gold["item"], gold["truth"], "truth")
        known = dict(zip(gold["item"].names, answer[said].tolist(), strict=True))
        true = np.array([known.get(name, -1) for name in items.names])
        if (true < 0).all():
            among_them = ", ".join(answers.names[:8])
            raise ValueError(
                f"{truth} has the truth of no item in {path}; the answers are {among_them}"
            )
        if lost := int((said >= 0).sum() - (true >= 0).sum()):
            tell(
                "Truths left out, as nobody voted on the item or nobody gave the true answer: "
                f"{lost:,}."
            )
    pairs, which = np.unique_inverse(judges.places[voted] * size + items.places[voted])
    counts = np.zeros((len(pairs), len(answers.names)))
    np.add.at(counts, (which, answers.places[voted]), 1.0)
    who, whom = np.divmod(pairs, size)
    names = judges.names, items.names, answers.names, kinds.names
    return Votes(who, whom, counts / counts.sum(axis=1, keepdims=True), true, kinds.places, *names)


def _read_gold(path: Path, dialect: Dialect) -> dict[str, Codes]:
    """Return the columns of a file of truths.

    Raises:
        ValueError: The file is no such table. The options that name the columns of votes are no
            help here.
        OSError: The file cannot be read.
    """
    try:
        return read_codes(path, _GOLD, dialect)
    except ValueError as error:
        fault = str(error).partition("; name ")[0]
        raise ValueError(f"{fault}; a file of truths has the columns item and truth") from None


def read_codes(
    path: Path,
    wanted: Mapping[str, str],
    dialect: Dialect,
    tell: Callable[[str], None] = lambda line: None,
) -> dict[str, Codes]:
    """Return the names in the wanted columns of a table; a vote and a truth may be missing.

    Raises:
        ValueError: The file is no such table, or has no rows. Or pyarrow is missing.
        OSError: The file cannot be read.
    """
    import pyarrow as arrow

    table, read = Table(path, wanted, dialect), 0
    there = {role: list[Any]() for role in wanted}
    columns = {role: NameColumns() for role in wanted}
    for block in table.blocks():
        for (role, name), column in zip(wanted.items(), block, strict=True):
            rows = (
                np.flatnonzero(~is_missing(column, value=True))
                if role in _MAY_MISS
                else np.arange(len(column))
            )
            row = _row(table, read + rows)
            if len(rows):
                columns[role].add(named(column.take(arrow.array(rows)), f"column {name!r}", row))
            there[role].append(read + rows)
        read += len(block[0])
    if not read:
        raise ValueError(f"{path} has no rows")
    found, all_joined = {}, 0
    for role, column in columns.items():
        every, names = np.full(read, -1, np.int64), list[str]()
        if (rows := np.concatenate(there[role])).size:
            all_names, (every[rows],), joined, _ = column.places(1)
            names, all_joined = list(all_names), all_joined + joined
        found[role] = Codes(names, every)
    absent = int((found["vote"].places < 0).sum()) if "vote" in found else 0
    counts = {"abstentions": absent, JOINED: all_joined}
    tell(
        f"Read as {', '.join([*table.found, *(f'{what}: {n:,}' for what, n in counts.items() if n)])}."  # noqa: E501
    )
    return found


def _row(table: Table, rows: Ints) -> Callable[[int], str]:
    return lambda at: table.row(int(rows[at]))


def _together(columns: list[Codes]) -> Codes:
    """Return one column for several: their names, joined by a slash."""
    if len(columns) == 1:
        return columns[0]
    _, first, each = np.unique(
        np.stack([one.places for one in columns]), axis=1, return_index=True, return_inverse=True
    )
    names = ["/".join(one.names[one.places[at]] for one in columns) for at in first.tolist()]
    return Codes(names, each.reshape(-1))


def _of_items(path: Path, items: Codes, what: Codes, role: str) -> Ints:
    """Return what is said of each item, shape (I,), or -1.

    Raises:
        ValueError: Two rows say different things of one item.
    """
    told = what.places >= 0
    pairs = np.unique(np.stack([items.places[told], what.places[told]]), axis=1)
    if (twice := np.flatnonzero(np.diff(pairs[0]) == 0)).size:
        at = int(twice[0])
        name, (one, other) = (
            items.names[pairs[0, at]],
            (what.names[pairs[1, at + n]] for n in (0, 1)),
        )
        raise ValueError(
            f"{path}: the {role} of {name!r} is {one!r} and {other!r}; an item has one"
        )
    of = np.full(len(items.names), -1, np.int64)
    of[pairs[0]] = pairs[1]
    return of


def write_votes(path: Path, seed: int = 0, items: int = 200, judges: int = 30) -> None:
    """Write a small synthetic file of votes, with the columns item, judge, vote and truth.

    A third of the items is made to mislead: there most judges are mostly wrong.

    Args:
        path: Path of the file, ending in `.csv`.
        seed: Random seed.
        items: Number of items.
        judges: Number of judges.
    """
    rng = generator(seed)
    truth, hard, skill = (
        rng.integers(0, 2, items),
        rng.random(items) < 1 / 3,
        rng.uniform(0.55, 0.95, judges),
    )
    able = rng.random(judges) < 0.25
    chance = np.where(hard[:, None] & ~able, 1 - skill, skill)
    votes = np.where(rng.random((items, judges)) < chance, truth[:, None], 1 - truth[:, None])
    lines = [
        (
            f"item {n}",
            "hard" if hard[n] else "easy",
            f"judge {k}",
            ("no", "yes")[votes[n, k]],
            ("no", "yes")[true],
        )
        for n, true in enumerate(truth.tolist())
        for k in range(judges)
    ]
    write_csv(path, ("item", "kind", "judge", "vote", "truth"), lines)
