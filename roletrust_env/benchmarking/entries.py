"""Entries of the leaderboard: the results of a trust model in a suite as one small JSON file.

The package carries the published entries. Files of others are untrusted: they are parsed strictly,
and nothing that they name is made before it is known to be installed.
"""

import hashlib
import json
import re
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import Field

from roletrust_env.benchmarking.schema import (
    Amount,
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
from roletrust_env.evaluation.specs import is_own_model, named_factory
from roletrust_env.storage.files import write_text
from roletrust_env.storage.untrusted import UntrustedModel, parse_json, read_untrusted
from roletrust_env.trust.model import registry as trust_models

_FOLDER = Path(__file__).parent / "published"
_LIMIT = 20_000_000
"""Largest size of a file in bytes."""

_DIGITS = 6
ROUNDING = 2e-6
"""Difference up to which a score is the same, since scores are rounded."""
Rounded = Annotated[tuple[Number | None, ...], Field(max_length=10_000)]


class EntryAttack(UntrustedModel):
    """Result of an attack, see `AttackResult`."""

    attack: Name
    words: Annotated[str, Field(max_length=20_000)] = ""
    rounds: Amount = 0
    chosen: dict[Name, Rounded]
    measured: dict[Name, Rounded] = Field(default_factory=dict)
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

    format: Literal[6] = 6
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
    paper: Word
    """Paper of the trust model; empty if it is of none."""
    source: Source
    """Source of the trust model."""
    unreliable: Word = ""
    """Why its scores do not count, after a closer look; such an entry is not ranked."""
    cells: tuple[EntryCell, ...]

    @classmethod
    def of(cls, store: ResultStore, model: str) -> Self:
        """Return the entry of a trust model of a run. Errors as for `pack_entry`."""
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
            paper=_paper(model),
            source=model_source(model),
            cells=cells,
        )

    def write(self, path: str | Path) -> None:
        """Write the file.

        Raises:
            OSError: It cannot be written.
        """
        write_text(
            Path(path), json.dumps(self.model_dump(mode="json"), separators=(",", ":")) + "\n"
        )

    @property
    def file_name(self) -> str:
        """File name of a published entry."""
        return re.sub(r"[^A-Za-z0-9_.-]+", "-", self.model) + ".json"

    def stored(self) -> list[StoredCell]:
        """Return the cells with their results."""
        return [
            StoredCell(
                Cell(self.model, cell.rule, cell.setting, cell.method),
                CellResult(tuple(_result(attack) for attack in cell.attacks), 0.0),
            )
            for cell in self.cells
        ]


def pack_entry(results: str | Path, model: str) -> Entry:
    """Return the entry of a trust model of a run.

    Args:
        results: File `results.sqlite` of a benchmark.
        model: Spec of a trust model of the run.

    Raises:
        ValueError: The file cannot be read, it does not have the model, is for learners, or has
            failed or missing cells of the model: a model could otherwise avoid an attack by failing
            under it.

    Example:
        >>> from pathlib import Path
        >>> from tempfile import mkdtemp
        >>> from roletrust_env.benchmarking import benchmark, load_suite
        >>> from roletrust_env.benchmarking.entries import pack_entry
        >>> suite = load_suite("quick")
        >>> small = suite.worlds.model_copy(update={"selection": 1, "measured": 2})
        >>> suite = suite.model_copy(update={"worlds": small, "games": 1, "selection_games": 1})
        >>> out = Path(mkdtemp())
        >>> _ = benchmark("mean", suite, workers=0, progress=False, out=out)
        >>> pack_entry(out / "results.sqlite", "mean").suite
        'quick'
    """
    with ResultStore(Path(results)) as store:
        return Entry.of(store, model)


def _attack(row: AttackResult) -> EntryAttack:
    rounded: dict[str, Any] = {
        "chosen": {name: _rounded(values) for name, values in row.chosen.items()},
        "measured": {name: _rounded(values) for name, values in row.measured.items()},
    }
    fields = {name: value for name, value in row._asdict().items() if name != "by_round"}
    return EntryAttack.model_validate({**fields, **rounded})


def _result(attack: EntryAttack) -> AttackResult:
    lists = {
        "chosen": {name: list(values) for name, values in attack.chosen.items()},
        "measured": {name: list(values) for name, values in attack.measured.items()},
    }
    return AttackResult(**{**dict(attack), "by_round": [], **lists})


def _rounded(values: Sequence[float | None]) -> tuple[float | None, ...]:
    return tuple(None if x is None else round(x, _DIGITS) for x in values)


def _paper(model: str) -> str:
    """Return the paper of a trust model of this project; a class of others is not imported here."""
    if not is_own_model(model):
        return ""
    source: str = getattr(named_factory(trust_models, model), "source", "")
    return source


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
            if stored.cell.key in wanted and faced_all(suite, *stored)
        ]
        searched = "search" in suite.methods and entry.search != suite.search
        known = entry.model in suite.models or entry.unreliable
        if known or searched or len(fitting) < len(wanted):
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
    return read_untrusted(Entry, path, _LIMIT, what="entry", command="roletrust entry pack")


def faced_all(suite: Suite, cell: Cell, result: CellResult) -> bool:
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
