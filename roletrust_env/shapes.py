"""Shapes in types: the axes and the dtype of an array, as metadata of its annotation.

The library never checks them: at run time and for a type checker, these types are `Array`.
`tests/shapes.py` checks the arguments and the results of public functions by them.
"""

from dataclasses import dataclass
from typing import Annotated, Literal, TypeAlias

from roletrust_env.arrays import Array

DtypeKind: TypeAlias = Literal["float", "bool", "whole", "number", "any"]
"""Kind of dtype; a number is a float or whole."""


@dataclass(frozen=True)
class Shape:
    """Metadata of the annotation of an array: its axes, and the kind of its dtype.

    Attributes:
        axes: Axes, separated by spaces. A name is a size that is the same in all arguments and
            results of a call: S raters, P providers, N agents, T rounds, E ratings on edges. A
            number is a size, and `...` at the end is the batch.
        kind: Kind of dtype.

    Example:
        >>> Motion = Annotated[Array, Shape("N 2 ...")]
    """

    axes: str
    kind: DtypeKind = "float"


# In the states of models, `roletrust_env.trees` reads "rater", "provider", "pair" and "age".

PerRater: TypeAlias = Annotated[Array, Shape("S ..."), "rater"]
"""Array with an entry for each rater, shape (S, ...)."""

PerProvider: TypeAlias = Annotated[Array, Shape("P ..."), "provider"]
"""Array with an entry for each provider, shape (P, ...)."""

PerPair: TypeAlias = Annotated[Array, Shape("S P ..."), "pair"]
"""Array with an entry for each pair, shape (S, P, ...). In the state of a trust model it is the
memory of each pair, 0 where there is none; on edges it has shape (K,) for K known pairs."""

PairAge: TypeAlias = Annotated[Array, Shape("S P ..."), "age"]
"""Number of rounds since the last rating of each pair, 0 where there is none; otherwise as
`PerPair`."""

PerAdviser: TypeAlias = Annotated[Array, Shape("S S ...")]
"""Array with an entry for each judge and each rater that advises it, shape (S, S, ...)."""

PerAgent: TypeAlias = Annotated[Array, Shape("N ...")]
"""Array with an entry for each agent, shape (N, ...)."""

PerGame: TypeAlias = Annotated[Array, Shape("...")]
"""Array with an entry for each game of a batch, shape (...)."""

RaterFlags: TypeAlias = Annotated[Array, Shape("S ...", "bool")]
"""Boolean array with an entry for each rater, shape (S, ...)."""

ProviderFlags: TypeAlias = Annotated[Array, Shape("P ...", "bool")]
"""Boolean array with an entry for each provider, shape (P, ...)."""

PairFlags: TypeAlias = Annotated[Array, Shape("S P ...", "bool")]
"""Boolean array with an entry for each pair, shape (S, P, ...)."""

AgentFlags: TypeAlias = Annotated[Array, Shape("N ...", "bool")]
"""Boolean array with an entry for each agent, shape (N, ...)."""

GameFlags: TypeAlias = Annotated[Array, Shape("...", "bool")]
"""Boolean array with an entry for each game of a batch, shape (...)."""
