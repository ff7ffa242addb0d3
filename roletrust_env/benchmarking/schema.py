"""Data types that the suites and results of all types share."""

from collections.abc import Callable, Hashable, Mapping, Sequence
from typing import Annotated, Any, ClassVar, NamedTuple, Protocol, Self

import numpy as np
import numpy.typing as npt
from pydantic import Field, FiniteFloat, model_validator

from roletrust_env.errors import printable
from roletrust_env.evaluation.attackers import MAX_RECORD
from roletrust_env.parameters import PositiveAmount
from roletrust_env.world.group import FrozenModel

Label = Annotated[str, Field(min_length=1, pattern=r"^[^|\x00-\x1f\x7f]+$")]
"""Name in a suite. A vertical bar is not allowed, since it separates the names in the key of a
cell."""

FORBIDDEN = r"[|/\\\x00-\x1f\x7f]"
"""Characters that a name in a file of others must not have: path separators and control characters,
too."""

Name = Annotated[str, Field(min_length=1, max_length=300, pattern=rf"^[^{FORBIDDEN[1:-1]}]+$")]
"""Name in a file of others, such as a submission."""


class AnyCell(Hashable, Protocol):
    """Smallest unit of a suite, a named tuple. Cells are independent of each other."""

    @property
    def key(self) -> str:
        """Unique key of the cell in its suite."""

    def _asdict(self) -> dict[str, Any]: ...


class SuiteSchema(FrozenModel):
    """Suite of any type: its fields, its cells, and what their results depend on.

    Pools and the store use no other knowledge of a suite.
    """

    cell_type: ClassVar[Callable[..., Any]]
    """Constructor of a cell, with the fields of the cell as keyword arguments."""
    chosen_scores: ClassVar[Mapping[str, tuple[float, float]]] = {}
    """Scores in the games for choosing the worst case by name, with their ranges, see
    `AttackResult`."""
    measured_scores: ClassVar[Mapping[str, tuple[float, float]]]
    """Scores in the games for measuring, with their ranges."""
    kind: str
    """Type of the suite."""
    name: str = "custom"
    """Name of the suite."""
    description: str = ""
    """Purpose of the suite in one line."""
    games: Annotated[int, Field(ge=2, le=100_000)] = 64
    """Number of games that are measured. Equal seeds give equal games."""
    seeds: Annotated[tuple[Annotated[int, Field(ge=0)], ...], Field(min_length=1)] = (0,)
    """Random seeds. Each seed searches, chooses and measures independently."""
    limit_s: PositiveAmount = 600.0
    """Time limit of a cell in seconds."""

    @model_validator(mode="after")
    def _check_seeds(self) -> Self:
        check_unique(seeds=self.seeds)
        return self

    def cells(self) -> list[Any]:
        """Return all cells."""
        raise NotImplementedError

    def factories(self) -> dict[str, Callable[..., Any]]:
        """Return the factories of everything that the suite names and users may replace, by type
        and name.
        """
        raise NotImplementedError

    def rules(self, cell: Any) -> object:
        """Return all fields that the result of a cell depends on."""
        raise NotImplementedError


def check_unique(**fields: tuple[object, ...]) -> None:
    """Check that no value occurs twice in a field.

    Raises:
        ValueError: A value occurs twice.
    """
    for name, values in fields.items():
        if len(set(values)) < len(values):
            raise ValueError(f"{name} must not contain a value twice: {values}")


Number = Annotated[float, Field(strict=True, ge=-1e9, le=1e9)]
"""Number of a result. With a larger one, rounding would decide."""

Numbers = list[Number | None]
"""Numbers of a result; None is undefined."""


def plain_numbers(values: npt.NDArray[np.float64]) -> Numbers:
    """Return numbers as plain data. NaN becomes None."""
    return [None if np.isnan(x) else float(x) for x in values]


Amount = Annotated[int, Field(strict=True, ge=0, le=10**15)]
"""Number of rounds that were played."""


class AttackResult(NamedTuple):
    """Result of one attack.

    Attributes:
        attack: Name of the scripted attack, or of the method that found the attack.
        words: Short description of the attack.
        rounds: Number of game rounds that were played to find the attack.
        chosen: Scores by name in the games for choosing the worst case. Empty if nothing is chosen.
        measured: Scores by name in the games for measuring. Empty for an attack that was not
            measured, since another one of its cell is worse.
        by_round: Mean regret in each round over the games for measuring. None is undefined.
        record: Record of the attacker, see `roletrust_env.evaluation.attackers`. Empty for
            attackers that cannot be recorded.
        progress: Course of the search: the rounds played, and the lowest mean skill so far. Empty
            for attacks that need no search.
    """

    attack: str
    words: str
    rounds: Amount
    chosen: dict[str, Numbers]
    measured: dict[str, Numbers]
    by_round: Sequence[Number | None] = ()
    record: Annotated[str, Field(max_length=MAX_RECORD)] = ""
    progress: tuple[tuple[Amount, Number], ...] = ()


class CellResult(NamedTuple):
    """Result of a cell.

    Attributes:
        rows: Results of the attacks.
        seconds: Wall-clock time in seconds.
        unsuitable: Reason why the method does not apply. Empty if it does.
        failed: Error message. Empty if nothing failed.
        env_steps: Number of game rounds in total, rounds x games.
    """

    rows: tuple[AttackResult, ...]
    seconds: Annotated[FiniteFloat, Field(ge=0)]
    unsuitable: str = ""
    failed: str = ""
    env_steps: Amount = 0


def reason(error: BaseException) -> str:
    """Return the message of an exception in one line. A type other than `ValueError` is part of
    it.
    """
    line = printable(" ".join(str(error).split())) or "no message"
    return line if isinstance(error, ValueError) else f"{type(error).__name__}: {line}"
