"""Files that somebody else wrote: they are what they say they are, or refused in one line, and never run."""

import json
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError

from roletrust_env.errors import explain

_MAX_GROUP_ROUNDS = 10_000_000


class UntrustedModel(BaseModel):
    """Data from elsewhere: no field too many, no type but its own, no number that is none."""

    model_config = ConfigDict(
        frozen=True, strict=True, extra="forbid", allow_inf_nan=False, use_attribute_docstrings=True
    )


Kind = TypeVar("Kind", bound=UntrustedModel)


def read_limited(path: Path, limit: int) -> bytes:
    """A file that is not too large; no more of it is read than is allowed.

    Raises:
        ValueError: it has more bytes.
        OSError: it cannot be read.
    """
    with path.open("rb") as file:
        data = file.read(limit + 1)
    if len(data) > limit:
        raise ValueError(f"{path} has more than {limit} bytes")
    return data


def parse_json(text: bytes) -> Any:
    """JSON as its standard has it: pydantic alone would let NaN pass, and the last of two fields of one name win.

    Raises:
        ValueError: it is none, it is nested too deeply, or one of these is in it.
    """
    try:
        return json.loads(text.decode(), object_pairs_hook=_once, parse_constant=_no_number)
    except RecursionError:
        raise ValueError("the JSON is nested too deeply") from None


def parse_untrusted(kind: type[Kind], text: bytes) -> Kind:
    """Data of some kind, from JSON that `parse_json` takes.

    Raises:
        ValueError: a field is wrong; it says which, and what is allowed.
    """
    try:
        return kind.model_validate_json(text)
    except ValidationError as error:
        raise ValueError(explain(error)) from None


def check_scenario_size(scenario: Any) -> None:
    """Refuse a scenario, as JSON has it, that would take long to look at.

    Raises:
        ValueError: it has too many groups of agents, or rounds; or it does not say how many.
    """
    groups, rounds = scenario.get("agents"), scenario.get("max_cycles", 1)
    if not isinstance(groups, list) or not isinstance(rounds, int):
        raise ValueError("the scenario has no list of agents, or no whole number of rounds")
    if len(groups) * rounds > _MAX_GROUP_ROUNDS:
        raise ValueError(f"the scenario has {len(groups)} groups of agents and {rounds} rounds: too many")


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        raise ValueError("a field stands twice in the JSON")
    return found


def _no_number(text: str) -> Any:
    raise ValueError(f"the JSON holds {text}, which is no number")
