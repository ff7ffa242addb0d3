"""The header of a file that holds the state of a stream."""

import json
from typing import Any, Literal

import numpy as np
import numpy.typing as npt
from pydantic import Field, NonNegativeInt

from roletrust_env.errors import short
from roletrust_env.logs.calibration import Calibration
from roletrust_env.storage.untrusted import UntrustedModel, parse_json, parse_untrusted
from roletrust_env.trust.stored import taken

FORMAT = 7


class StreamHeader(UntrustedModel):
    """Content of a file beside its arrays; the names with an underscore are attributes of a
    stream.
    """

    format: Literal[7] = 7
    settings: dict[str, Any]
    start: int | None = Field(alias="_start", gt=-(2**63), lt=2**63)
    latest: int | None = Field(alias="_latest", gt=-(2**63), lt=2**63)
    begun: bool = Field(alias="_begun")
    calibration: Calibration | None
    n_late: NonNegativeInt
    n_repeated: NonNegativeInt
    texts: list[list[str] | None] = Field(min_length=4, max_length=4)
    """Names of raters, of providers, and of both in ratings that wait; None where they are whole
    numbers."""


def header_array(header: StreamHeader) -> npt.NDArray[np.uint8]:
    """Return a header as bytes of JSON."""
    return np.frombuffer(json.dumps(header.model_dump(by_alias=True)).encode(), np.uint8)


def read_header(arrays: dict[str, npt.NDArray[Any]]) -> StreamHeader:
    """Take the header from the arrays of a file.

    Raises:
        ValueError: It is missing, damaged, or of another format.
    """
    text = taken(arrays, "header", np.uint8, (None,)).tobytes()
    data = parse_json(text)
    if data and isinstance(data, dict) and data.get("format") != FORMAT:
        raise ValueError(
            f"its format is {short(str(data.get('format')))}, and {FORMAT} is read here"
        )
    return parse_untrusted(StreamHeader, text)
