"""Saved defences that are safe to share: weights in safetensors, all other data in JSON. Loading
executes no code.

A defence is a pair of files, `NAME.safetensors` and `NAME.json`, as an attacker is, see `saved`.
Names, shapes, dtypes, sizes and values are checked, and the JSON holds a digest of the weights.
Invalid files raise a `ValueError`.
"""

from collections.abc import Callable
from dataclasses import fields
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import Field, ValidationError, model_validator
from safetensors import numpy as safetensors

from roletrust_agents.learned.cards import Count, Name, Plain, Text
from roletrust_agents.learned.rater_network import (
    FEATURES,
    MAX_WEIGHT,
    SHAPES,
    SIZE,
    UNITS,
    Floats,
    RaterNetworkTrust,
    split,
)
from roletrust_agents.learned.saved import digest
from roletrust_agents.learned.weights import read_weights
from roletrust_env.errors import validation_message
from roletrust_env.parameters import checked_dataclass
from roletrust_env.storage.untrusted import (
    UntrustedModel,
    check_file,
    parse_json,
    parse_untrusted,
    read_limited,
)
from roletrust_env.trust.models.central.leave_one_out import LeaveOneOut

MAX_JSON, MAX_SAFETENSORS = 100_000, 8 * SIZE + 10_000
"""Largest sizes of the two files, in bytes."""

_MADE = (
    "a saved defence is a .json and a .safetensors file, which `python -m studies defend "
    "--defence network` writes"
)

_PARAMETERS = tuple(field.name for field in fields(LeaveOneOut) if field.name != "initial")
"""Parameters of a saved model. Trust before any rating is the scenario's."""


class DefenceCard(UntrustedModel):
    """All data of a saved defence except its weights."""

    format: Literal["roletrust-defence"] = "roletrust-defence"
    format_version: Literal[1] = 1
    package_version: Annotated[str, Field(max_length=100)]
    kind: Literal["rater-network"] = "rater-network"
    units: int = UNITS
    """Number of units of each layer."""
    features: Annotated[tuple[Text, ...], Field(max_length=100)] = FEATURES
    """Names of the features of a pair."""
    parameters: Annotated[dict[Name, float], Field(max_length=100, default_factory=dict)]
    """Parameters of the model besides its weights; those that are missing have their defaults."""
    conditions: Annotated[tuple[Text, ...], Field(max_length=100)]
    """Conditions of the training."""
    iteration: Annotated[Count, Field(ge=1)]
    """Iteration of the game in which it was trained, from 1."""
    seed: Count
    settings: Annotated[dict[Name, Plain], Field(max_length=100, default_factory=dict)]
    """Settings of the game."""
    weights_sha256: Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]

    @model_validator(mode="after")
    def _check(self) -> Self:
        if (self.units, self.features) != (UNITS, FEATURES):
            raise ValueError("the features and units are not those of this version of the package")
        if unknown := sorted(set(self.parameters) - set(_PARAMETERS)):
            raise ValueError(
                f"there is no parameter {unknown[0]!r}; the parameters are {', '.join(_PARAMETERS)}"
            )
        return self


def weights_bytes(vector: Floats) -> bytes:
    """Return weights, shape (n,), as the content of a safetensors file, in double precision."""
    return safetensors.save(
        {name: np.ascontiguousarray(part) for name, part in sorted(split(vector).items())}
    )


def save_defence(
    vector: Floats, card: DefenceCard, path: Path, write: Callable[[Path, bytes], object]
) -> None:
    """Write the pair of files.

    Args:
        vector: Weights, shape (n,).
        card: Card with their digest.
        path: Path without a suffix.
        write: Function that writes bytes to a path, such as `Path.write_bytes` or an atomic one.

    Raises:
        ValueError: The digest in the card belongs to other weights.
    """
    data = weights_bytes(vector)
    if digest(data) != card.weights_sha256:
        raise ValueError("the digest in the card belongs to other weights")
    write(path.with_name(path.name + ".safetensors"), data)
    write(path.with_name(path.name + ".json"), (card.model_dump_json(indent=1) + "\n").encode())


def load_defence(path: str | Path) -> tuple[DefenceCard, Floats]:
    """Read a saved defence. This executes no code of the files and imports nothing.

    Args:
        path: Path of either file, or without a suffix.

    Returns:
        The card and the weights, shape (n,).

    Raises:
        ValueError: A file is missing, too large or not valid.
    """
    path = Path(path)
    path = path.with_suffix("") if path.suffix in (".json", ".safetensors") else path
    if not path.name:
        raise ValueError(f"path is {str(path)!r}, which names no file; {_MADE}")
    files = [path.with_name(path.name + suffix) for suffix in (".json", ".safetensors")]
    for file in files:
        check_file(file, _MADE)
    text, data = (
        read_limited(file, limit)
        for file, limit in zip(files, (MAX_JSON, MAX_SAFETENSORS), strict=True)
    )
    try:
        return _parsed(text, data)
    except ValueError as error:
        raise ValueError(f"saved defence {path}: {error}") from None


def _parsed(text: bytes, data: bytes) -> tuple[DefenceCard, Floats]:
    parse_json(text)
    card = parse_untrusted(DefenceCard, text)
    if digest(data) != card.weights_sha256:
        raise ValueError("the digest of the weights differs from the one in the JSON file")
    weights: dict[str, Any] = read_weights(data)
    if set(weights) != set(SHAPES):
        raise ValueError(
            f"the weights are {sorted(weights)}; the architecture has {sorted(SHAPES)}"
        )
    for name, shape in SHAPES.items():
        if weights[name].shape != shape or weights[name].dtype != np.float64:
            actual = f"{weights[name].dtype} {weights[name].shape}"
            raise ValueError(f"weight {name!r} is {actual}; the architecture has float64 {shape}")
        if not (abs(weights[name]) <= MAX_WEIGHT).all():
            raise ValueError(
                f"weight {name!r} has entries outside [-{MAX_WEIGHT:g}, {MAX_WEIGHT:g}]"
            )
    return card, np.concatenate([weights[name].reshape(-1) for name in SHAPES])


@checked_dataclass
class SavedTrust(RaterNetworkTrust):
    """A trained `RaterNetworkTrust`, read from its files, with all of its parameters but `initial`.

    Attributes:
        path: Path of either file, or without a suffix.

    Raises:
        ValueError: A file is missing, too large or not valid.
    """

    path: str = Field(kw_only=True)
    weights: tuple[float, ...] = Field(default=(), init=False)

    def __post_init__(self) -> None:
        """Read the weights and the parameters."""
        card, vector = load_defence(self.path)
        try:
            made = RaterNetworkTrust(
                initial=self.initial, weights=tuple(vector.tolist()), **card.parameters
            )
        except ValidationError as error:
            raise ValueError(f"saved defence {self.path}: {validation_message(error)}") from None
        for name in (*card.parameters, "weights"):
            object.__setattr__(self, name, getattr(made, name))  # the class is frozen
