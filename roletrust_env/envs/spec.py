"""The specification of an environment in Gymnasium, which can be written as JSON and read back.

`import roletrust_env` imports this file, so it imports what it needs of others when a specification
is written.
"""

from collections.abc import Mapping
from dataclasses import asdict, fields, replace
from enum import Enum
from pathlib import Path
from textwrap import shorten
from typing import Any

import numpy as np
from gymnasium.envs.registration import EnvSpec


class TaskSpec(EnvSpec):
    """Specification whose JSON has trust models and policies by their names and parameters.

    Such an object is a table, for example `{"name": "role-trust", "lam": 0.7}`, which `make_task`
    reads.
    """

    @classmethod
    def of(cls, spec: EnvSpec, **changes: Any) -> "TaskSpec":
        """Return a specification of Gymnasium with other values of some fields."""
        return cls(
            **{field.name: getattr(spec, field.name) for field in fields(spec) if field.init}
            | changes
        )

    def __eq__(self, other: object) -> bool:
        """Return whether another specification, also one of Gymnasium's own class, has the same
        fields.
        """
        return isinstance(other, EnvSpec) and vars(self) == vars(other)

    def to_json(self) -> str:
        """Return the specification as JSON.

        Raises:
            ValueError: An argument has no name, such as a model that is not registered.
        """
        kwargs = {name: _plain(name, value) for name, value in self.kwargs.items()}
        return EnvSpec.to_json(replace(self, kwargs=kwargs))


def _plain(name: str, value: Any) -> Any:
    """Return an argument as JSON has it.

    Raises:
        ValueError: That is not possible.
    """
    from roletrust_env.game.attack_task import Stealth
    from roletrust_env.game.policy import registry as policies
    from roletrust_env.trust.model import registry as trust_models

    if value is None or isinstance(value, str | bool | int | float):
        return value
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, Enum):
        return value.value
    if isinstance(value, Stealth):
        return asdict(value)
    if isinstance(value, Mapping):
        return {str(key): _plain(f"{name} of {key!r}", one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(name, one) for one in value]
    for registry in (trust_models, policies):
        if isinstance(value, registry.base) and not isinstance(value, type):
            return {key: _plain(name, one) for key, one in registry.described(value).items()}
    if callable(dump := getattr(value, "model_dump", None)) and name != "scenario":
        return dump(mode="json")  # a part of a scenario
    hint = "the name of one, or its file" if name == "scenario" else "a name, or plain values"
    raise ValueError(
        f"{name} is {shorten(repr(value), 80)}, which cannot be written as JSON; give {hint}"
    )
