"""The terms of a benchmark: what suites of all kinds say, and what becomes of a cell of any of them."""

from collections.abc import Sequence
from typing import Annotated, NamedTuple, Self

from pydantic import Field, PositiveFloat, model_validator

from roletrust_env.world.base_model import FrozenModel

Text = Annotated[str, Field(min_length=1, pattern=r"^[^|]+$")]
"""A name in a suite. The bar keeps the names in a cell's key apart."""


class SuiteSchema(FrozenModel):
    """What suites of all kinds say."""

    name: str = "custom"
    """What it is called."""
    description: str = ""
    """One line on what it is for."""
    games: Annotated[int, Field(ge=2, le=100_000)] = 64
    """Games that are measured, the same ones for all with the same seed."""
    seeds: tuple[Annotated[int, Field(ge=0)], ...] = (0,)
    """Of all luck; each searches, chooses and measures anew."""
    limit_s: PositiveFloat = 600.0
    """Seconds after which a cell is given up."""

    @model_validator(mode="after")
    def _check_seeds(self) -> Self:
        if not self.seeds:
            raise ValueError("seeds must have one at least")
        check_unique(seeds=self.seeds)
        return self


def check_unique(**given: tuple[object, ...]) -> None:
    """See that nothing stands twice.

    Raises:
        ValueError: something does.
    """
    for what, things in given.items():
        if len(set(things)) < len(things):
            raise ValueError(f"{what} has something twice: {things}")


class AttackResult(NamedTuple):
    """What one attack came to.

    Attributes:
        attack: its name: that of a script, or of the rung that found it.
        words: what it is, in a few words.
        rounds: game rounds that were played to find it.
        chosen: its scores in the games in which the worst case is chosen, if one is, by their names.
        measured: the same in the games in which it is measured.
        by_round: utility there in each round from the second on, the mean over the games; None where undefined.
    """

    attack: str
    words: str
    rounds: int
    chosen: dict[str, list[float | None]]
    measured: dict[str, list[float | None]]
    by_round: Sequence[float | None] = ()


class CellResult(NamedTuple):
    """What became of a cell.

    Attributes:
        rows: an attack each.
        seconds: that it took, by the clock on the wall.
        unsuitable: why the rung does not apply; empty if it does.
        failed: what went wrong; empty if nothing did.
        env_steps: rounds x games that were played in all.
    """

    rows: tuple[AttackResult, ...]
    seconds: float
    unsuitable: str = ""
    failed: str = ""
    env_steps: int = 0


def reason(error: BaseException) -> str:
    """What somebody's class raised, in one line."""
    line = " ".join(str(error).split()) or "without a word"
    return line if isinstance(error, ValueError) else f"{type(error).__name__}: {line}"
