"""A submission: what a run found of some trust models, as one file that anybody can measure again."""

import hashlib
import json
import platform
from collections.abc import Sequence
from typing import Annotated, Any, Literal, Self

from pydantic import Field, ValidationError, model_validator

from roletrust_env.benchmark.cells import Cell, attacks, cells, models
from roletrust_env.benchmark.leaderboard import leaderboard_rows, numbers
from roletrust_env.benchmark.schema import AttackResult, CellResult
from roletrust_env.benchmark.sources import Sha256, Source, Word, source_of
from roletrust_env.benchmark.store import Store, StoredCell
from roletrust_env.benchmark.suite import Stage, Suite
from roletrust_env.errors import explain, suggest
from roletrust_env.evaluation.resources import processor
from roletrust_env.evaluation.specs import check_installed, named_factory
from roletrust_env.game.policy_registry import registry as attackers
from roletrust_env.metrics.confidence import over_games
from roletrust_env.storage.provenance import software
from roletrust_env.storage.untrusted import UntrustedModel
from roletrust_env.trust.model import registry as trust_models

STAGE = "paper-3x3"
"""The scenario of which all fields are set anew, so that a suite is whole without any other file."""

Name = Annotated[str, Field(min_length=1, max_length=300, pattern=r"^[^|/\\\x00-\x1f\x7f]+$")]
"""In a suite; neither a path nor what a terminal would obey."""
Number = Annotated[float, Field(ge=-1e9, le=1e9)]
Count = Annotated[int, Field(ge=0, le=10**15)]


class Score(UntrustedModel):
    """A mean over games."""

    mean: Number | None
    """None where it is undefined."""
    half_95: Annotated[Number, Field(ge=0)] | None
    """Half the 95% interval."""

    @classmethod
    def of(cls, values: Sequence[float | None]) -> Self:
        """Of a value for each game."""
        mean, half, _ = over_games(numbers(values))
        return cls.told(float(mean), float(half))

    @property
    def words(self) -> str:
        """It for people."""
        if self.mean is None:
            return "nothing"
        return f"{self.mean:.4f}" + ("" if self.half_95 is None else f"±{self.half_95:.4f}")

    @classmethod
    def told(cls, mean: float, half: float) -> Self:
        """Of numbers that are NaN where they are undefined."""
        return cls(mean=None if mean != mean else mean, half_95=None if half != half else half)


class Measures(UntrustedModel):
    """What an attack came to, see `play.MEASURED`."""

    utility: Score
    blind: Score
    damage: Score
    false_alarms: Score
    auc: Score


class Claim(UntrustedModel):
    """One attack."""

    attack: Name
    rounds: Count
    """Game rounds that were played to find it."""
    chosen: Number
    """Mean utility in the games in which the worst case is chosen."""
    measured: Measures
    """In the other games."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.measured.utility.mean is None or self.measured.blind.mean is None:
            raise ValueError(f"utility of {self.attack!r} is undefined, and nothing can be ranked by it")
        return self


class CellClaim(UntrustedModel):
    """What became of a cell; see `Cell`."""

    model: Name
    scenario: Name
    track: Name
    share: Annotated[float, Field(ge=0, lt=1)]
    rung: Name
    seed: Count
    attacks: tuple[Claim, ...]
    """None where the rung does not apply."""

    @property
    def cell(self) -> Cell:
        """The cell."""
        return Cell(*(getattr(self, name) for name in Cell._fields))

    def means(self) -> StoredCell:
        """It as if its means were what one game came to, by which a leaderboard has the same means."""
        rows = []
        for one in self.attacks:
            measured = {name: [score.mean] for name, score in one.measured}
            rows.append(AttackResult(one.attack, "", one.rounds, {"utility": [one.chosen]}, measured))
        return StoredCell(self.cell, CellResult(tuple(rows), 0.0))


class Standing(UntrustedModel):
    """The scores of a trust model, see `board.Standing`."""

    clean: Score
    worst: Score
    open_worst: Score
    damage: Score
    false_alarms: Score
    detection: Score


class Package(UntrustedModel):
    """This one."""

    name: Word
    version: Word


class Software(UntrustedModel):
    """What decides which numbers come out, see `files.software`."""

    package: Package
    python: Word
    packages: dict[Word, Word]


class Submission(UntrustedModel):
    """All of it."""

    format: Literal[1] = 1
    software: Software
    processor: Word
    """That all cells were played on; empty if they were played on several machines."""
    suite: dict[str, Any]
    """That was played: with all fields of its scenarios, and with these trust models only."""
    suite_sha256: Sha256
    """Of the suite without its models, see `fingerprint`."""
    models: dict[Name, Source]
    attacks: dict[Name, Source]
    standings: dict[Name, Standing]
    cells: tuple[CellClaim, ...]


def submitted(store: Store, names: Sequence[str] = (), *, allow_code: bool = False) -> Submission:
    """What a run found of some trust models.

    Args:
        store: the run's file.
        names: of the models, which may then be anybody's; by default all of the run.
        allow_code: whether the file may name what is not installed.

    Raises:
        ValueError: the run is not whole, has not these models, is not one for robustness or was played with other
            software, or its file names what is not installed.
    """
    if not isinstance(store.suite, Suite):
        raise ValueError(f"{store.path} is of a suite for {store.suite.kind}; only one for robustness is submitted")
    if store.software != software():
        raise ValueError(f"{store.path} was made with other versions of the software; submit it with those")
    known = models(store.suite)
    if unknown := [name for name in names if name not in known]:
        raise ValueError(f"{store.path} has no trust model {unknown[0]!r}{suggest(unknown[0], known)}")
    suite = as_played(store.suite, tuple(dict.fromkeys(names)) or tuple(known))
    if not allow_code:
        check_installed(trust_models, [name for name in suite.models if name not in names])
        check_installed(attackers, suite.attacks)
    store.check_sources(suite)
    found = {cell.key: StoredCell(cell, done) for cell, done in store.all() if cell.model in suite.models}
    every = cells(suite)
    if bad := [cell.key for cell in every if cell.key not in found or found[cell.key].done.failed]:
        raise ValueError(
            f"{store.path}: {len(bad)} of {len(every)} cells failed or are not played, such as {bad[0]}; what is "
            "submitted is whole"
        )
    kept = [found[cell.key] for cell in every]
    try:
        return Submission(
            software=Software.model_validate(store.software),
            processor=processor() if store.hosts() == {platform.node()} else "",
            suite=suite.model_dump(mode="json"),
            suite_sha256=fingerprint(suite),
            **sources(suite),
            standings=scores(suite, kept),
            cells=tuple(claimed(cell, done) for cell, done in kept),
        )
    except ValidationError as error:
        raise ValueError(f"{store.path}: {explain(error)}") from None


def as_played(suite: Suite, names: Sequence[str]) -> Suite:
    """A suite with some models, its attacks by name, and its scenarios whole, as no file or version changes them."""
    stages = {
        name: Stage(preset=STAGE, set=stage.scenario().model_dump(mode="json"))
        for name, stage in suite.scenarios.items()
    }
    return suite.model_copy(update={"models": tuple(names), "attacks": tuple(attacks(suite)), "scenarios": stages})


def fingerprint(suite: Suite) -> str:
    """What two suites have in common by which the same is done to models: SHA-256 of it all but the models."""
    data = suite.model_dump(mode="json", exclude={"models"})
    return hashlib.sha256(json.dumps(data, sort_keys=True, allow_nan=False).encode()).hexdigest()


def sources(suite: Suite) -> dict[str, Any]:
    """The sources of the models and of the attacks of a suite, by name."""
    return {
        "models": {name: source_of(named_factory(trust_models, name)) for name in suite.models},
        "attacks": {name: source_of(named_factory(attackers, name)) for name in suite.attacks},
    }


def scores(suite: Suite, kept: Sequence[StoredCell]) -> dict[str, Standing]:
    """What the leaderboard says of each model, of all cells of a suite in any order."""
    found = {one.cell.key: one for one in kept}
    in_order = [found[cell.key] for cell in cells(suite)]  # sums depend on it in their last bits
    rows = leaderboard_rows(suite, in_order, models(suite), len(kept) // len(suite.models))
    return {
        row.model: Standing(**{name: Score.told(*getattr(row, name)[:2]) for name in Standing.model_fields})
        for row in rows
    }


def claimed(cell: Cell, done: CellResult) -> CellClaim:
    """What is claimed of a cell."""
    rows = tuple(
        Claim(
            attack=row.attack,
            rounds=row.rounds,
            chosen=float(over_games(numbers(row.chosen["utility"])).mean),
            measured=Measures(**{name: Score.of(values) for name, values in row.measured.items()}),
        )
        for row in done.rows
    )
    return CellClaim(**cell._asdict(), attacks=rows)
