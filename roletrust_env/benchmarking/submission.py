"""Submissions: the results of trust models in one file, which others can verify, and attacks that
others can play.
"""

import hashlib
import json
import platform
import re
from collections.abc import Iterator, Sequence
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import FailFast, Field, ValidationError, model_validator

from roletrust_env.benchmarking.cells import find_attack
from roletrust_env.benchmarking.known_attacks import KnownAttack, KnownAttacks, merge_attacks
from roletrust_env.benchmarking.leaderboard import leaderboard_rows
from roletrust_env.benchmarking.schema import (
    FORBIDDEN,
    Amount,
    AttackResult,
    CellResult,
    Name,
    Number,
    check_unique,
)
from roletrust_env.benchmarking.sources import Sha256, Source, Word, model_source, source_of
from roletrust_env.benchmarking.store import ResultStore, StoredCell
from roletrust_env.benchmarking.suite import WITHOUT_SEARCH, Cell, Suite
from roletrust_env.benchmarking.worst_case import as_array, attack_scores, least_mean, worst_cases
from roletrust_env.errors import suggest, validation_message
from roletrust_env.evaluation.attackers import MAX_RECORD, Scripted, record_of
from roletrust_env.evaluation.resources import processor
from roletrust_env.evaluation.search import search_methods
from roletrust_env.evaluation.specs import check_installed, named_factory
from roletrust_env.game.policy import registry as attackers
from roletrust_env.metrics.confidence import over_games
from roletrust_env.storage.provenance import software
from roletrust_env.storage.untrusted import UntrustedModel
from roletrust_env.trust.model import registry as trust_models

BASE_PRESET = "paper-3x3"
"""Preset of the scenarios. A submission sets all their fields, so that its suite needs no other
file."""


class ClaimedScore(UntrustedModel):
    """Mean over games with its interval."""

    mean: Number | None
    """Mean. None is undefined."""
    half_95: Annotated[Number, Field(ge=0)] | None
    """Half the 95% interval. None is undefined."""

    @classmethod
    def of(cls, values: Sequence[float | None]) -> Self:
        """Return the score of games.

        Args:
            values: Value of each game. None is undefined.
        """
        mean, half, _ = over_games(as_array(values))
        return cls.from_estimate(float(mean), float(half))

    @property
    def text(self) -> str:
        """Score as text, such as `0.8125±0.0100`."""
        if self.mean is None:
            return "undefined"
        return f"{self.mean:.4f}" + ("" if self.half_95 is None else f"±{self.half_95:.4f}")

    @classmethod
    def from_estimate(cls, mean: float, half: float) -> Self:
        """Return the score of an estimate.

        Args:
            mean: Mean. NaN is undefined.
            half: Half the 95% interval. NaN is undefined.
        """
        return cls(mean=None if mean != mean else mean, half_95=None if half != half else half)


class ClaimedMetrics(UntrustedModel):
    """Scores of an attack, by the names of `MEASURED`."""

    utility: ClaimedScore
    published: ClaimedScore
    blind: ClaimedScore
    damage: ClaimedScore
    false_alarms: ClaimedScore
    auc: ClaimedScore


class Claim(UntrustedModel):
    """Claimed result of one attack."""

    attack: Name
    rounds: Amount
    """Number of game rounds that were played to find the attack."""
    chosen: Number
    """Mean utility in the games for choosing the worst case."""
    chosen_blind: Number
    """Mean utility of a blind choice in these games."""
    measured: ClaimedMetrics
    """Scores in the games for measuring."""
    treats: bool
    """Whether a provider served some honest rater better than another."""
    record: Annotated[str, Field(max_length=MAX_RECORD)] = ""
    """Record of the attacker that a search found, see `AttackResult`."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.measured.utility.mean is None or self.measured.blind.mean is None:
            raise ValueError(f"utility of {self.attack!r} is undefined, so it cannot be ranked")
        return self


class CellClaim(UntrustedModel):
    """Claimed result of a cell, see `Cell`."""

    model: Name
    scenario: Name
    track: Name
    share: Annotated[float, Field(ge=0, lt=1)]
    method: Name
    seed: Amount
    attacks: Annotated[tuple[Claim, ...], FailFast()]
    """Results of the attacks. Empty if the method does not apply."""

    @property
    def cell(self) -> Cell:
        """Cell of the claim."""
        return Cell(*(getattr(self, name) for name in Cell._fields))

    @model_validator(mode="after")
    def _check(self) -> Self:
        check_unique(attacks=tuple(attack.attack for attack in self.attacks))
        if self.method in WITHOUT_SEARCH and self.record:
            raise ValueError(
                f"{self.cell.key} has a record, but the method {self.method} does not search"
            )
        if self.method not in WITHOUT_SEARCH and any(
            attack.attack != self.method for attack in self.attacks
        ):
            raise ValueError(
                f"{self.cell.key} has other attacks than the one that the method {self.method} "
                "finds"
            )
        return self

    @property
    def record(self) -> str:
        """Record of the attacker that a search found. Empty if there is none."""
        return next((attack.record for attack in self.attacks if attack.record), "")

    def as_single_game(self) -> StoredCell:
        """Return the cell with its means as the scores of a single game. A leaderboard of it has
        the same means.
        """
        rows = []
        for attack in self.attacks:
            measured = {name: [score.mean] for name, score in attack.measured}
            chosen: dict[str, list[float | None]] = {
                "utility": [attack.chosen],
                "blind": [attack.chosen_blind],
            }
            rows.append(
                AttackResult(
                    attack.attack, "", attack.rounds, chosen, measured, treats=attack.treats
                )
            )
        return StoredCell(self.cell, CellResult(tuple(rows), 0.0))


class ModelScores(UntrustedModel):
    """Scores of a trust model, see `LeaderboardRow`."""

    clean: ClaimedScore
    worst: ClaimedScore
    alike: ClaimedScore
    published: ClaimedScore
    ensemble: ClaimedScore
    open_worst: ClaimedScore
    damage: ClaimedScore
    false_alarms: ClaimedScore
    detection: ClaimedScore


class Package(UntrustedModel):
    """Name and version of this package."""

    name: Word
    version: Word


class Software(UntrustedModel):
    """Software that determines the numbers, see `roletrust_env.storage.provenance.software`."""

    package: Package
    python: Word
    packages: dict[Word, Word]


class Submission(UntrustedModel):
    """Content of a submission file."""

    format: Literal[4] = 4
    software: Software
    processor: Word
    """Processor that played all cells. Empty if several machines played them."""
    suite: dict[str, Any]
    """Fields of the suite, with all fields of its scenarios and only the submitted trust models."""
    suite_sha256: Sha256
    """Hash of the suite without its models, see `suite_hash`."""
    models: dict[Name, Source]
    attacks: dict[Name, Source]
    methods: dict[Name, Source]
    """Sources of the search methods."""
    standings: dict[Name, ModelScores]
    cells: Annotated[tuple[CellClaim, ...], FailFast()]


def make_submission(
    store: ResultStore, names: Sequence[str] = (), *, allow_code: bool = False
) -> Submission:
    """Return a submission of trust models of a run.

    Args:
        store: File of the run.
        names: Names of the models, which need not be installed. Empty means all models of the run.
        allow_code: Allow the file to name models, attacks and search methods that are not
            installed.

    Raises:
        ValueError: The run is incomplete, does not contain a model, is not a robustness run, was
            played with other software, or names a model, an attack or a search method that is not
            installed.
    """
    if not isinstance(store.suite, Suite):
        raise ValueError(
            f"{store.path} has a suite for {store.suite.kind}; only robustness suites can be "
            "submitted"
        )
    if store.software != software():
        raise ValueError(
            f"{store.path} was written with other software versions; submit it with those versions"
        )
    known = store.suite.model_names
    if unknown := [name for name in names if name not in known]:
        raise ValueError(
            f"{store.path} has no trust model {unknown[0]!r}{suggest(unknown[0], known)}"
        )
    suite = self_contained(store.suite, tuple(dict.fromkeys(names)) or tuple(known))
    if not allow_code:
        check_installed(trust_models, [name for name in suite.models if name not in names])
        check_installed(attackers, suite.attacks)
        check_installed(search_methods, suite.searches)
    store.check_sources(suite)
    stored = {
        stored_cell.cell.key: stored_cell
        for stored_cell in store.all()
        if stored_cell.cell.model in suite.models
    }
    every = suite.cells()
    if bad := [
        cell.key for cell in every if cell.key not in stored or stored[cell.key].result.failed
    ]:
        raise ValueError(
            f"{store.path}: {len(bad)} of {len(every)} cells failed or have not been played, such "
            f"as {bad[0]}; only "
            "complete runs can be submitted"
        )
    ordered = [stored[cell.key] for cell in every]
    try:
        return Submission(
            software=Software.model_validate(store.software),
            processor=processor() if store.hosts() == {platform.node()} else "",
            suite=suite.model_dump(mode="json"),
            suite_sha256=suite_hash(suite),
            **suite_sources(suite),
            standings=model_scores(suite, ordered),
            cells=tuple(make_claim(cell, result) for cell, result in ordered),
        )
    except ValidationError as error:
        raise ValueError(f"{store.path}: {validation_message(error)}") from None


def self_contained(suite: Suite, names: Sequence[str]) -> Suite:
    """Return a suite that does not depend on other files or versions: its attacks by name, its
    scenarios in full.
    """
    stages = {
        name: stage.model_copy(
            update={"preset": BASE_PRESET, "set": stage.scenario().model_dump(mode="json")}
        )
        for name, stage in suite.scenarios.items()
    }
    return suite.model_copy(
        update={"models": tuple(names), "attacks": tuple(suite.attack_names), "scenarios": stages}
    )


def suite_hash(suite: Suite) -> str:
    """Return the SHA-256 hash of a suite without its models. Suites with equal hashes test models
    in the same way.
    """
    data = suite.model_dump(mode="json", exclude={"models"})
    return hashlib.sha256(json.dumps(data, sort_keys=True, allow_nan=False).encode()).hexdigest()


def suite_sources(suite: Suite) -> dict[str, Any]:
    """Return the sources of the models, attacks and search methods of a suite, by name."""
    return {
        "models": {name: model_source(name) for name in suite.models},
        "attacks": {name: source_of(named_factory(attackers, name)) for name in suite.attacks},
        "methods": {
            name: source_of(named_factory(search_methods, name)) for name in suite.searches
        },
    }


def model_scores(suite: Suite, stored: Sequence[StoredCell]) -> dict[str, ModelScores]:
    """Return the scores of each model on the leaderboard.

    Args:
        suite: Suite of the cells.
        stored: All cells of the suite with their results, in any order.
    """
    by_key = {stored_cell.cell.key: stored_cell for stored_cell in stored}
    in_order = [
        by_key[cell.key] for cell in suite.cells()
    ]  # the order changes the last bits of sums
    rows = leaderboard_rows(suite, in_order, suite.model_names, len(stored) // len(suite.models))
    return {
        row.model: ModelScores(
            **{
                name: ClaimedScore.from_estimate(*getattr(row, name)[:2])
                for name in ModelScores.model_fields
            }
        )
        for row in rows
    }


def make_claim(cell: Cell, result: CellResult) -> CellClaim:
    """Return the claim for a cell."""
    rows = tuple(
        Claim(
            attack=row.attack,
            rounds=row.rounds,
            chosen=_mean(row.chosen["utility"]),
            chosen_blind=_mean(row.chosen["blind"]),
            measured=ClaimedMetrics(
                **{name: ClaimedScore.of(values) for name, values in row.measured.items()}
            ),
            treats=row.treats,
            record=row.record,
        )
        for row in result.rows
    )
    return CellClaim(**cell._asdict(), attacks=rows)


def _mean(values: Sequence[float | None]) -> float:
    return float(over_games(as_array(values)).mean)


def make_entries(
    suite: Suite, stored: Sequence[StoredCell], models: Sequence[str] = (), finder: str = ""
) -> tuple[KnownAttacks, list[str]]:
    """Return the worst attack on each trust model in each condition, and the attacks that cannot be
    recorded.

    An attack that is the worst one on several trust models is listed once in a condition, with the
    name of the first.

    Args:
        suite: Suite of the run.
        stored: Cells of the run with their results.
        models: Names of trust models. Empty means all of the run.
        finder: Who found the attacks.

    Raises:
        ValueError: The run has no such model, or none of its worst attacks can be recorded.
    """
    known = suite.model_names
    if unknown := [name for name in models if name not in known]:
        raise ValueError(f"the run has no trust model {unknown[0]!r}{suggest(unknown[0], known)}")
    entries, lost = [], []
    for cell, name in _worst(suite, stored, models or known):
        entry = _entry(suite, stored, cell, name, finder)
        if entry is None:
            lost.append(f"{name} in {cell.key}")
        else:
            entries.append(entry)
    if not entries:
        what = f", such as {lost[0]}" if lost else ""
        raise ValueError(
            f"the run has no attack that can be recorded{what}; scripts of packages and coalitions "
            "can"
        )
    return KnownAttacks(attacks=merge_attacks(entries)), lost


def _worst(
    suite: Suite, stored: Sequence[StoredCell], models: Sequence[str]
) -> Iterator[tuple[Cell, str]]:
    """Yield the cell and the name of the worst attack on each model in each condition; of several
    seeds the worst.
    """
    seeds = sorted({cell.seed for cell, result in stored if result.rows})
    for (model, condition), case in worst_cases(attack_scores(suite, stored)).items():
        if model in models and suite.tracks[condition.track].roles:
            means = [least_mean(choice.chosen[k]) for k, choice in enumerate(case.choices)]
            k = int(np.argmin(means))
            yield Cell(model, *condition, case.choices[k].method, seeds[k]), case.choices[k].attack


def _entry(
    suite: Suite, stored: Sequence[StoredCell], cell: Cell, attack: str, finder: str
) -> KnownAttack | None:
    """Return an attack of a cell as a known attack, or None if it cannot be recorded."""
    if cell.method == "known":
        return next(
            known_attack
            for known_attack in suite.known
            if (known_attack.name, known_attack.condition) == (attack, cell[1:4])
        )
    record = _record(suite, stored, cell, attack)
    if not record:
        return None
    title = re.sub(FORBIDDEN, "-", f"{attack} against {cell.model}")[:300]
    return KnownAttack(
        name=title,
        scenario=cell.scenario,
        track=cell.track,
        share=cell.share,
        finder=finder,
        record=record,
    )


def _record(suite: Suite, stored: Sequence[StoredCell], cell: Cell, attack: str) -> str:
    """Return the record of an attack in a cell. A script at its defaults is made again, since it
    has none.
    """
    rows = next(stored_cell.result.rows for stored_cell in stored if stored_cell.cell == cell)
    record = next(row.record for row in rows if row.attack == attack)
    if record or cell.method != "scripted":
        return record
    known_attack = find_attack(suite, cell, attack)
    return record_of(Scripted(known_attack.batch.scripts(known_attack.row)))
