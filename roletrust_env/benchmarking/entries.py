"""Entries of the leaderboard: the results of a trust model in a suite as one small JSON file.

The package carries the published entries. Files of others are untrusted: they are parsed strictly,
and nothing that they name is made before it is known to be installed.
"""

import hashlib
import json
import re
from collections.abc import Mapping, Sequence
from contextlib import closing
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple, Self

import numpy as np
from pydantic import Field

from roletrust_env.benchmarking.pool import Pool
from roletrust_env.benchmarking.schema import (
    Amount,
    AnyCell,
    AttackResult,
    CellResult,
    Name,
    Number,
)
from roletrust_env.benchmarking.sources import Sha256, Source, Word, model_source
from roletrust_env.benchmarking.store import ResultStore, StoredCell
from roletrust_env.benchmarking.suite import Cell, Method, Rule, Search, Suite
from roletrust_env.evaluation.attackers import MAX_RECORD
from roletrust_env.evaluation.resources import processor
from roletrust_env.metrics.confidence import student_quantile
from roletrust_env.metrics.score import mean_or_nan
from roletrust_env.storage.provenance import software
from roletrust_env.storage.untrusted import UntrustedModel, parse_json, read_untrusted

_FOLDER = Path(__file__).parent / "published"
_LIMIT = 20_000_000
"""Largest size of a file in bytes."""

_DIGITS = 6
_ROUNDING = 2e-6
_LEVEL = 0.999
"""Level of the test of a replayed score on another processor, where games may differ."""

Rounded = Annotated[tuple[Number | None, ...], Field(max_length=10_000)]


class EntryAttack(UntrustedModel):
    """Result of an attack, see `AttackResult`."""

    attack: Name
    words: Annotated[str, Field(max_length=20_000)] = ""
    rounds: Amount = 0
    chosen: dict[Name, Rounded]
    measured: dict[Name, Rounded] = Field(default_factory=dict)
    by_round: Rounded = ()
    record: Annotated[str, Field(max_length=MAX_RECORD)] = ""
    progress: tuple[tuple[Amount, Number], ...] = ()


class EntryCell(UntrustedModel):
    """Result of a cell, see `Cell`."""

    rule: Rule
    setting: Name
    method: Method | Literal["honest"]
    attacks: Annotated[tuple[EntryAttack, ...], Field(min_length=1)]


class Package(UntrustedModel):
    """Name and version of this package."""

    name: Word
    version: Word


class Software(UntrustedModel):
    """Software that determines the numbers, see `roletrust_env.storage.provenance.software`."""

    package: Package
    python: Word
    packages: dict[Word, Word]


class Entry(UntrustedModel):
    """Results of a trust model in a suite."""

    format: Literal[5] = 5
    suite: Name
    """Name of the suite."""
    version: Word
    """Version of the suite."""
    suite_sha256: Sha256
    """Hash of the suite, see `suite_hash`."""
    search: Search
    """Budget of its searches."""
    software: Software
    processor: Word
    """Processor that played the cells."""
    engine: Literal["rules"] = "rules"
    """Engine of the games: the rules on NumPy, which every trust model can play."""
    dtype: Literal["float64"] = "float64"
    """Type of the numbers in the games."""
    seed: Amount
    """Random seed of the worlds and of the games."""
    model: Name
    """Spec of the trust model."""
    source: Source
    """Source of the trust model."""
    cells: tuple[EntryCell, ...]

    @classmethod
    def of(cls, store: ResultStore, model: str) -> Self:
        """Return the entry of a trust model of a run.

        Raises:
            ValueError: The run does not have the model, is for learners, or has failed or missing
                cells of the model: a model could otherwise avoid an attack by failing under it.
        """
        suite = store.suite
        if not isinstance(suite, Suite):
            raise ValueError(f"{store.path} is of a suite for {suite.kind}; give one of models")
        if model not in suite.model_names:
            names = ", ".join(suite.model_names)
            raise ValueError(f"{store.path} does not have a model {model!r}; it has {names}")
        stored = [(cell, result) for cell, result in store.all() if cell.model == model]
        done = {cell.key for cell, result in stored if not result.failed}
        wanted = [cell for cell in suite.cells() if cell.model == model]
        if missing := [cell.key for cell in wanted if cell.key not in done]:
            raise ValueError(
                f"{len(missing)} of {len(wanted)} cells of {model} failed or are missing, such as "
                f"{missing[0]}"
            )
        cells = tuple(
            EntryCell(
                rule=cell.rule,
                setting=cell.setting,
                method=cell.method,
                attacks=tuple(_attack(row) for row in result.rows),
            )
            for cell, result in stored
            if result.rows
        )
        return cls(
            suite=suite.name,
            version=suite.version,
            suite_sha256=suite_hash(suite),
            search=suite.search,
            software=Software.model_validate(store.software),
            processor=processor(),
            seed=suite.worlds.seed,
            model=model,
            source=model_source(model),
            cells=cells,
        )

    @property
    def file_name(self) -> str:
        """File name of a published entry."""
        return re.sub(r"[^A-Za-z0-9_.-]+", "-", self.model) + ".json"

    @property
    def text(self) -> str:
        """Content of the file."""
        return json.dumps(self.model_dump(mode="json"), separators=(",", ":")) + "\n"

    def stored(self) -> list[StoredCell]:
        """Return the cells with their results."""
        return [
            StoredCell(
                Cell(self.model, cell.rule, cell.setting, cell.method),
                CellResult(tuple(_result(attack) for attack in cell.attacks), 0.0),
            )
            for cell in self.cells
        ]


def _attack(row: AttackResult) -> EntryAttack:
    rounded: dict[str, Any] = {
        "chosen": {name: _rounded(values) for name, values in row.chosen.items()},
        "measured": {name: _rounded(values) for name, values in row.measured.items()},
        "by_round": _rounded(row.by_round),
    }
    return EntryAttack.model_validate({**row._asdict(), **rounded})


def _result(attack: EntryAttack) -> AttackResult:
    lists = {
        "chosen": {name: list(values) for name, values in attack.chosen.items()},
        "measured": {name: list(values) for name, values in attack.measured.items()},
    }
    return AttackResult(**{**dict(attack), **lists})


def _rounded(values: Sequence[float | None]) -> tuple[float | None, ...]:
    return tuple(None if x is None else round(x, _DIGITS) for x in values)


def suite_hash(suite: Suite) -> str:
    """Return the hash of everything in a suite that its games and scripts depend on: not its trust
    models, its ways to attack, its replayed attacks and the budget of its searches.
    """
    fields = suite.model_dump(
        mode="json",
        exclude={
            *("models", "own", "methods", "replayed", "search"),
            *("name", "description", "limit_s"),
        },
    )
    return hashlib.sha256(json.dumps(fields, sort_keys=True).encode()).hexdigest()


def published(suite: Suite) -> tuple[Entry, ...]:
    """Return the published entries of a suite, those that the package carries."""
    digest = suite_hash(suite)
    return tuple(entry for entry in _carried() if entry.suite_sha256 == digest)


@cache
def _carried() -> tuple[Entry, ...]:
    return tuple(read_entry(path) for path in sorted(_FOLDER.glob("*.json")))


def published_cells(suite: Suite) -> tuple[Suite, list[StoredCell]]:
    """Return a suite with further trust models, those of its published entries that have all of its
    cells, and these cells.
    """
    fields: dict[str, tuple[str, ...]] = {"models": suite.models, "own": suite.own}
    cells = list[StoredCell]()
    for entry in published(suite):
        rules = {cell.rule for cell in entry.cells}
        alone = {"models": (entry.model,), "own": (entry.model,) * ("own" in rules)}
        wanted = {
            cell.key for cell in suite.model_copy(update=alone).cells() if cell.model == entry.model
        }
        fitting = [
            stored
            for stored in entry.stored()
            if stored.cell.key in wanted and _faced_all(suite, *stored)
        ]
        searched = "search" in suite.methods and entry.search != suite.search
        if entry.model in suite.models or searched or len(fitting) < len(wanted):
            continue
        cells += fitting
        fields = {name: (*names, *alone[name]) for name, names in fields.items()}
    return suite.model_copy(update=fields), cells


def read_entry(path: Path) -> Entry:
    """Return the entry in a file.

    Raises:
        ValueError: The file does not exist, or its content is not allowed.
        OSError: The file cannot be read.
    """
    return read_untrusted(Entry, path, _LIMIT, what="entry", command="roletrust submit")


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


def check_entry(entry: Entry, suite: Suite) -> list[Check]:
    """Return the checks that need no game: the suite, the source, the cells and their numbers.

    Args:
        entry: Entry to check.
        suite: Suite that it says to be of, with its trust model.
    """
    same = (entry.suite_sha256, entry.seed) == (suite_hash(suite), suite.worlds.seed)
    checks = [Check("suite", same, f"{entry.suite} {entry.version}, hash {entry.suite_sha256:.8}")]
    here = model_source(entry.model)
    message = f"{here.made_by}, hash {here.sha256:.8}"
    checks.append(Check("source", here.sha256 == entry.source.sha256, message))
    where = "as here" if _as_here(entry) else "others than here: scores may differ by noise"
    checks.append(Check("software and processor", True, where))
    stored = entry.stored()
    wanted = {cell.key for cell in suite.cells() if cell.model == entry.model}
    missing = sorted(
        wanted - {cell.key for cell, result in stored if _faced_all(suite, cell, result)}
    )
    keys = [cell.key for cell, _ in stored]
    twice = sorted({key for key in keys if keys.count(key) > 1})
    words = f"missing: {missing[0]}" if missing else f"{len(stored)} cells"
    words = f"twice: {twice[0]}" if twice else words
    checks.append(Check("completeness", not missing and not twice, words))
    wrong = [cell.key for cell, result in stored if not _consistent(suite, result)]
    words = f"wrong: {wrong[0]}" if wrong else "scores in their ranges, the worst attack measured"
    checks.append(Check("consistency", not wrong, words))
    return checks


def _faced_all(suite: Suite, cell: Cell, result: CellResult) -> bool:
    """Return whether the model faced all replayed attacks of the suite in a cell."""
    if cell.method != "replayed":
        return True
    records = {row.attack: _given_fields(row.record) for row in result.rows if row.record}
    return all(
        records.get(attack.name) == _given_fields(attack.record)
        for attack in suite.replayed_in(cell.setting)
    )


def _given_fields(record: str) -> dict[str, Any]:
    """Return the fields of an attack's record without those at their default, None."""
    fields = parse_json(record.encode())
    given = fields.items() if isinstance(fields, dict) else ()
    return {name: value for name, value in given if value is not None}


def _consistent(suite: Suite, result: CellResult) -> bool:
    """Return whether each attack has its scores in all worlds within their ranges, and exactly the
    worst one is measured.
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
                ranges[name][0] - _ROUNDING <= value <= ranges[name][1] + _ROUNDING
                for name, values in scores.items()
                for value in values
                if value is not None
            )
        )
        for scores, ranges, number in parts
    )
    if not fits or any(not row.chosen for row in result.rows):
        return False
    means = [_mean(row.chosen["skill"]) for row in result.rows]
    measured = [k for k, row in enumerate(result.rows) if row.measured]
    return len(measured) == 1 and means[measured[0]] <= min(means) + _ROUNDING


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
    for name, row in claims.items():
        pairs = [(row.chosen, again[name].chosen)]
        if row.measured and again[name].measured:
            pairs.append((row.measured, again[name].measured))
        for theirs, ours in pairs:
            for score, values in theirs.items():
                gap = np.array(values, float) - np.array(ours[score], float)
                if not np.isnan(gap).all():
                    largest = max(largest, float(np.nanmax(abs(gap))))
                if _significant(gap) or (exact and largest > _ROUNDING):
                    means = f"{_mean(values):.4f}, here {_mean(ours[score]):.4f}"
                    return Check(cell.key, False, f"{name}, {score}: {means}")
    equal = largest <= _ROUNDING
    return Check(cell.key, True, "equal" if equal else "differs by no more than noise")


def _significant(gap: Any) -> bool:
    """Return whether the mean of differences in worlds is significant; a constant one is."""
    known = gap[~np.isnan(gap)]
    if not len(known) or abs(known).max() <= _ROUNDING:
        return False
    error = known.std(ddof=1) / np.sqrt(len(known)) if len(known) > 1 else 0.0
    limit = float(student_quantile(np.array(len(known) - 1.0), _LEVEL)) * error
    return abs(float(known.mean())) > limit + _ROUNDING


def _mean(values: Sequence[float | None]) -> float:
    return float(mean_or_nan(np.array(values, np.float64), axis=0))
