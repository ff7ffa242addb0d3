"""Files from untrusted sources: each is validated or refused with a message of one line, and never
executed.
"""

import json
import re
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError

from roletrust_env.errors import check_unicode, validation_message

_MAX_GROUP_ROUNDS = 10_000_000
_MAX_VALUES, _MAX_FIELDS = (
    3_000_000,
    10_000,
)  # of a file and of an object in it: an error may be told of each
_SURROGATE = re.compile(rb"\\u[dD][89a-fA-F]")  # as JSON writes half a character


class UntrustedModel(BaseModel):
    """Base class of untrusted data: no extra fields, no type conversion, and only finite
    numbers.
    """

    model_config = ConfigDict(
        frozen=True, strict=True, extra="forbid", allow_inf_nan=False, use_attribute_docstrings=True
    )


Kind = TypeVar("Kind", bound=UntrustedModel)


def check_file(path: Path, advice: str, *, wanted: str = "a file") -> None:
    """Check that a path leads to a file.

    Args:
        path: Path to check.
        advice: Where such a file comes from, for the error message.
        wanted: File to give in place of a folder, for the error message.

    Raises:
        ValueError: There is none, it is a folder, or it cannot be looked up, such as a name that is
            too long.
    """
    try:
        if path.is_dir():
            raise ValueError(f"{path} is a folder; give the path of {wanted}")
        if not path.is_file():
            raise ValueError(f"there is no file {str(path)!r}; {advice}")
    except OSError as error:
        raise ValueError(
            f"path {str(path)[:100]!r}... cannot be looked up: {error.strerror}"
        ) from None


def read_limited(path: Path, limit: int) -> bytes:
    """Read a file of limited size. At most one byte above the limit is read.

    Args:
        path: Path of the file.
        limit: Largest size, bytes.

    Raises:
        ValueError: The file is larger.
        OSError: The file cannot be read.
    """
    with path.open("rb") as file:
        data = file.read(limit + 1)
    if len(data) > limit:
        raise ValueError(f"{path} has more than {limit} bytes")
    return data


def parse_json(text: bytes) -> Any:
    """Parse strict JSON: without NaN, two fields of one name, and texts that are no Unicode, such
    as half a surrogate.

    Raises:
        ValueError: The text is not such JSON, or it is nested too deeply.
    """
    try:
        data = json.loads(
            text.decode(), object_pairs_hook=_unique_fields, parse_constant=_refuse_constant
        )
    except RecursionError:
        raise ValueError("the JSON is nested too deeply") from None
    except (json.JSONDecodeError, UnicodeDecodeError) as error:
        raise ValueError(f"there is no JSON: {error}") from None
    if _SURROGATE.search(text):
        check_unicode("the JSON", json.dumps(data, ensure_ascii=False))
    return data


def parse_untrusted(kind: type[Kind], text: bytes) -> Kind:
    """Validate JSON as data of a kind. Call `parse_json` first to check that it is strict JSON.

    Raises:
        ValueError: A field is wrong; the message names it and the allowed values.
    """
    try:
        return kind.model_validate_json(text)
    except ValidationError as error:
        raise ValueError(validation_message(error)) from None


def read_untrusted(kind: type[Kind], path: Path, limit: int, *, what: str, command: str) -> Kind:
    """Read a JSON file of limited size, and validate it as data of a kind.

    Args:
        kind: Class of the data.
        path: Path of the file.
        limit: Largest size, bytes.
        what: What the file is, for error messages.
        command: Command that creates such a file, for error messages.

    Raises:
        ValueError: The file does not exist or is a folder, or its content is not allowed.
        OSError: The file cannot be read.
    """
    check_file(path, f"`{command}` creates one")
    text = read_limited(path, limit)
    try:
        if sum(text.count(mark) for mark in (b",", b"[", b"{")) > _MAX_VALUES:
            raise ValueError(f"it has more than {_MAX_VALUES:,} values")
        parse_json(text)
        return parse_untrusted(kind, text)
    except ValueError as error:
        raise ValueError(f"{what} {path}: {error}") from None


def check_scenario_size(scenario: Any) -> None:
    """Refuse a scenario that would take too long to validate.

    Args:
        scenario: Scenario, as parsed JSON.

    Raises:
        ValueError: The scenario has too many groups of agents or rounds, or their number is
            missing.
    """
    groups, rounds = scenario.get("agents"), scenario.get("max_cycles", 1)
    if not isinstance(groups, list) or not isinstance(rounds, int):
        raise ValueError("the scenario must have a list of agents and a whole number of rounds")
    if len(groups) * rounds > _MAX_GROUP_ROUNDS:
        raise ValueError(
            f"the scenario has {len(groups)} groups of agents and {rounds} rounds: too many"
        )


def _unique_fields(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    if len(pairs) > _MAX_FIELDS:
        raise ValueError(f"the JSON has an object of more than {_MAX_FIELDS:,} fields")
    fields = dict(pairs)
    if len(fields) < len(pairs):
        raise ValueError("the JSON has two fields of one name")
    return fields


def _refuse_constant(text: str) -> Any:
    raise ValueError(f"the JSON has {text}, which is not a number")
