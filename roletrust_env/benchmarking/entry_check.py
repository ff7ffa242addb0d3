"""Checks of an entry of the leaderboard: its hashes and numbers, and its games, played again."""

import random
import secrets
from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from roletrust_env.benchmarking.entries import ROUNDING, Entry, faced_all, read_entry, suite_hash
from roletrust_env.benchmarking.pool import LocalPool, Pool
from roletrust_env.benchmarking.schema import AnyCell, CellResult
from roletrust_env.benchmarking.sources import model_source
from roletrust_env.benchmarking.suite import Cell, Suite, with_models, with_search
from roletrust_env.benchmarking.suite_files import load_suite
from roletrust_env.evaluation.agreed import check_recorded
from roletrust_env.evaluation.resources import processor
from roletrust_env.evaluation.specs import check_installed
from roletrust_env.metrics.confidence import student_quantile
from roletrust_env.metrics.score import mean_or_nan
from roletrust_env.parameters import whole_number
from roletrust_env.storage.markdown import ShownAsMarkdown, markdown_table, plain
from roletrust_env.storage.provenance import software
from roletrust_env.trust.model import registry as trust_models

_LEVEL = 0.999
"""Level of the test of a replayed score on another processor, where games may differ."""


class Check(NamedTuple):
    """Result of a check of an entry.

    Attributes:
        subject: Part of the entry.
        ok: Whether the part is correct.
        message: Explanation.
    """

    subject: str
    ok: bool
    message: str


@dataclass(frozen=True, repr=False)
class CheckedEntry(ShownAsMarkdown):
    """Result of `check_entry`.

    Attributes:
        entry: Entry that was checked.
        checks: What was checked.
        seed: Random seed of the choice of cells and of the other worlds.
        played: Number of cells that were played again.
    """

    entry: Entry
    checks: Sequence[Check]
    seed: int
    played: int

    @property
    def ok(self) -> bool:
        """Whether all checks are passed."""
        return all(check.ok for check in self.checks)

    def _repr_markdown_(self) -> str:
        rows = [
            ("ok" if check.ok else "not ok", plain(check.subject), plain(check.message))
            for check in self.checks
        ]
        return markdown_table(("", "what", "result"), rows, 3)


def check_entry(
    entry: Entry | str | Path,
    suite: str | Path | Suite = "standard",
    *,
    cells: int | None = None,
    seed: int | None = None,
    workers: int | None = None,
    allow_code: bool = False,
) -> CheckedEntry:
    """Check an entry of the leaderboard: its hashes, its numbers, and its games.

    All scripts and the recorded attacks are played again. On the same software and processor the
    scores must be equal; elsewhere their difference must not be significant. Then all but the
    searches is played in other worlds, where the skill must not be significantly lower: a model
    could recognise the games of its entry. Trust models of other packages run in processes of their
    own, which get ratings and nothing else of a game. What is wrong without a game is not played.

    Args:
        entry: Entry, or its file.
        suite: Suite of the entry: its name, its file, or itself.
        cells: Number of cells to play again, drawn at random; None plays all, and 0 plays nothing,
            not even in other worlds.
        seed: Random seed of this choice and of the other worlds; None draws one.
        workers: Number of processes; None is one for each core.
        allow_code: Import what the file names and what is not installed, which runs its code.

    Raises:
        ValueError: A file cannot be read, the suite is for learners, or the file names what is not
            installed.

    Example:
        >>> from roletrust_env.benchmarking.entries import published
        >>> from roletrust_env.benchmarking.entry_check import check_entry
        >>> from roletrust_env.benchmarking.suite_files import load_suite
        >>> suite = load_suite("standard")
        >>> checked = check_entry(published(suite)[0], suite, cells=0, seed=1)
        >>> checked.ok, checked.checks[0].subject
        (True, 'suite')
    """
    for name, number, least in (("cells", cells, 0), ("seed", seed, 0), ("workers", workers, 1)):
        if number is not None:
            whole_number(name, number, least)
    entry = entry if isinstance(entry, Entry) else read_entry(Path(entry))
    loaded = suite if isinstance(suite, Suite) else load_suite(suite)
    if not isinstance(loaded, Suite):
        raise ValueError(f"suite {loaded.name} is for {loaded.kind}; give one of trust models")
    if not allow_code:
        check_installed(trust_models, [entry.model])
        check_recorded(attack.record for cell in entry.cells for attack in cell.attacks)
        check_recorded(attack.record for attack in loaded.replayed)
    searched = any(cell.method == "search" for cell in entry.cells)
    asked = with_models(with_search(loaded) if searched else loaded, [entry.model])
    checks = check_numbers(entry, asked)
    seed = secrets.randbelow(2**31) if seed is None else seed
    drawn = [cell for cell, _ in entry.stored()]
    if cells is not None:
        drawn = random.Random(seed).sample(drawn, min(cells, len(drawn)))
    if not drawn or not all(check.ok for check in checks):
        return CheckedEntry(entry, checks, seed, 0)
    pool = LocalPool(workers, records=records_of(entry), isolated=True)
    checks += replay_entry(entry, asked, drawn, pool)
    worlds = asked.worlds.model_copy(update={"seed": 1 + seed})
    fresh = asked.model_copy(update={"worlds": worlds})
    checks.append(check_fresh_worlds(entry, fresh, LocalPool(workers, isolated=True)))
    return CheckedEntry(entry, checks, seed, len(drawn))


def check_numbers(entry: Entry, suite: Suite) -> list[Check]:
    """Return the checks that need no game: the suite, the source, the cells and their numbers.

    Args:
        entry: Entry to check.
        suite: Suite that it says to be of, with its trust model.
    """
    claimed = entry.suite, entry.version, entry.suite_sha256, entry.seed
    same = claimed == (suite.name, suite.version, suite_hash(suite), suite.worlds.seed)
    message = f"{entry.suite} {entry.version}, hash {entry.suite_sha256:.8}"
    if not same:
        message += f"; checked with {suite.name} {suite.version}, hash {suite_hash(suite):.8}"
    checks = [Check("suite", same, message)]
    if any(cell.method == "search" for cell in entry.cells):
        checks.append(Check("budget of searches", entry.search == suite.search, f"{suite.search}"))
    here = model_source(entry.model)
    message = f"{here.made_by}, hash {here.sha256:.8}"
    same = (here.made_by, here.sha256) == (entry.source.made_by, entry.source.sha256)
    checks.append(Check("source", same, message))
    where = "as here" if _as_here(entry) else "others than here: scores may differ by noise"
    checks.append(Check("software and processor", True, where))
    stored = entry.stored()
    wanted = {cell.key for cell in suite.cells() if cell.model == entry.model}
    missing = sorted(
        wanted - {cell.key for cell, result in stored if faced_all(suite, cell, result)}
    )
    keys = [cell.key for cell, _ in stored]
    twice = sorted({key for key in keys if keys.count(key) > 1})
    unknown = sorted(set(keys) - wanted)
    faults = {"missing": missing, "twice": twice, "not in the suite": unknown}
    found = [f"{fault}: {cells[0]}" for fault, cells in faults.items() if cells]
    checks.append(Check("completeness", not found, (found or [f"{len(stored)} cells"])[0]))
    wrong = [cell.key for cell, result in stored if not _consistent(suite, result)]
    words = f"wrong: {wrong[0]}" if wrong else "scores in their ranges, the worst attack measured"
    checks.append(Check("consistency", not wrong, words))
    return checks


def _consistent(suite: Suite, result: CellResult) -> bool:
    """Return whether each attack is there once and has its scores in all worlds within their
    ranges, and exactly the worst one is measured.
    """
    worlds = suite.worlds
    parts = (
        *((row.chosen, suite.chosen_scores, worlds.selection) for row in result.rows),
        *((row.measured, suite.measured_scores, worlds.measured) for row in result.rows),
    )
    fits = all(
        not scores
        or (
            scores.keys() == ranges.keys()
            and all(len(values) == number for values in scores.values())
            and all(
                ranges[name][0] - ROUNDING <= value <= ranges[name][1] + ROUNDING
                for name, values in scores.items()
                for value in values
                if value is not None
            )
        )
        for scores, ranges, number in parts
    )
    names = [row.attack for row in result.rows]
    if not fits or len(set(names)) < len(names) or any(not row.chosen for row in result.rows):
        return False
    means = [_mean(row.chosen["skill"]) for row in result.rows]
    measured = [k for k, row in enumerate(result.rows) if row.measured]
    return len(measured) == 1 and means[measured[0]] <= min(means) + ROUNDING


def replay_entry(entry: Entry, suite: Suite, cells: Sequence[Cell], pool: Pool) -> list[Check]:
    """Play the recorded attacks of some cells again, and compare the scores.

    On the processor and software of the entry, they are equal. Elsewhere, rounding may change
    games; then the difference of each mean over worlds must not be significant.

    Args:
        entry: Entry to check.
        suite: Suite of the entry.
        cells: Cells to play, among those of the entry.
        pool: Processes that play the cells, with `records_of` the entry.
    """
    claimed = {cell.key: result for cell, result in entry.stored()}
    exact, checks = _as_here(entry), list[Check]()
    with closing(pool.play(suite, cells)) as playing:
        for cell, result in playing:
            checks.append(_compared(cell, claimed[cell.key], result, exact))
    return checks


def check_fresh_worlds(entry: Entry, suite: Suite, pool: Pool) -> Check:
    """Check that a trust model is as good in other worlds as in those of its entry.

    A model that recognises the games of its entry, such as by their first services, is better
    there. Welch's t-test compares the mean skills of the worlds over all cells without a search.

    Args:
        entry: Entry to check.
        suite: Suite of the entry with the seed of other worlds, which its author does not know.
        pool: Processes that play the cells.
    """
    from scipy.stats import ttest_ind  # type: ignore[import-untyped]

    wanted = [
        cell for cell in suite.cells() if cell.model == entry.model and cell.method != "search"
    ]
    with closing(pool.play(suite, wanted)) as playing:
        here = {cell.key: result for cell, result in playing}
    if failed := [f"{key}: {result.failed}" for key, result in here.items() if result.failed]:
        return Check("other worlds", False, f"failed: {failed[0]}")
    claimed = {cell.key: result for cell, result in entry.stored() if cell.key in here}
    ours, theirs = (_skill_in_worlds(results) for results in (here, claimed))
    test = ttest_ind(theirs, ours, equal_var=False, alternative="greater", nan_policy="omit")
    message = f"mean skill {theirs.mean():.4f}, here {ours.mean():.4f}"
    return Check("other worlds", bool(test.pvalue > 1 - _LEVEL), message)


def _skill_in_worlds(results: Mapping[str, CellResult]) -> Any:
    """Return the mean skill in each world under the measured attack, over cells."""
    measured = [
        np.array(row.measured["skill"], np.float64)
        for result in results.values()
        for row in result.rows
        if row.measured
    ]
    return mean_or_nan(np.array(measured), axis=0)


def records_of(entry: Entry) -> dict[AnyCell, dict[str, str]]:
    """Return the records of the searched attacks of an entry by name, by cell. All others are those
    of the suite, so that an entry cannot leave out one.
    """
    return {
        cell: {row.attack: row.record for row in result.rows}
        for cell, result in entry.stored()
        if cell.method == "search"
    }


def _as_here(entry: Entry) -> bool:
    """Return whether the entry was played with the software and the processor of this machine."""
    return entry.software.model_dump() == software() and entry.processor == processor()


def _compared(cell: Cell, claim: CellResult, here: CellResult, exact: bool) -> Check:
    if here.failed:
        return Check(cell.key, False, f"failed here: {here.failed}")
    claims, again = ({row.attack: row for row in each.rows} for each in (claim, here))
    if different := sorted(claims.keys() ^ again.keys()):
        return Check(cell.key, False, f"attacks differ: {', '.join(different)}")
    largest = 0.0
    worst = next((row.measured for row in here.rows if row.measured), {})
    for name, row in claims.items():
        # Where two attacks tie, the other one may be measured here.
        pairs = [(row.chosen, again[name].chosen), (row.measured, again[name].measured or worst)]
        for theirs, ours in pairs:
            for score, values in theirs.items():
                one, other = np.array(values, float), np.array(ours[score], float)
                if (np.isnan(one) != np.isnan(other)).any():
                    return Check(cell.key, False, f"{name}, {score}: undefined in other worlds")
                gap = one - other
                if not np.isnan(gap).all():
                    largest = max(largest, float(np.nanmax(abs(gap))))
                if _significant(gap) or (exact and largest > ROUNDING):
                    means = f"{_mean(values):.4f}, here {_mean(ours[score]):.4f}"
                    return Check(cell.key, False, f"{name}, {score}: {means}")
    equal = largest <= ROUNDING
    return Check(cell.key, True, "equal" if equal else "differs by no more than noise")


def _significant(gap: Any) -> bool:
    """Return whether the mean of differences in worlds is significant; a constant one is."""
    known = gap[~np.isnan(gap)]
    if not len(known) or abs(known).max() <= ROUNDING:
        return False
    error = known.std(ddof=1) / np.sqrt(len(known)) if len(known) > 1 else 0.0
    limit = float(student_quantile(np.array(len(known) - 1.0), _LEVEL)) * error
    return abs(float(known.mean())) > limit + ROUNDING


def _mean(values: Sequence[float | None]) -> float:
    return float(mean_or_nan(np.array(values, np.float64), axis=0))
