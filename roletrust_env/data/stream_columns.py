"""Columns of ratings that a stream is given, as arrays."""

from datetime import date
from decimal import Decimal
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from roletrust_env.arrays import numpy_array
from roletrust_env.data.names import Names
from roletrust_env.data.units import (
    UNITS,
    date_seconds,
    has_zone,
    iso_dates,
    lost_digits,
)
from roletrust_env.trust.key_index import Floats

StreamColumns: TypeAlias = tuple[Names, Names, Floats, Floats, Floats]
"""Names of raters and of providers, ratings on [0, 1], times, and what these do not hold, see
`lost_digits`."""


def seconds_column(times: Any, length: int) -> tuple[Floats, Floats | float]:
    """Return a column of times as numbers, dates as seconds since 1970, and what these do not hold,
    see `lost_digits`.

    Raises:
        ValueError: A time is none, or some dates have a time zone and others none.
    """
    array = numpy_array("the column of times", times, "numbers or dates")
    if array.dtype.kind in "OUT" and array.size:
        texts = [
            one.isoformat() if isinstance(one, date) else one for one in array.ravel().tolist()
        ]
        if all(isinstance(text, str) for text in texts):
            ticks, unit = iso_dates(
                texts, lambda at: f"times, position {at + 1}", zoned=has_zone(texts[0])
            )
            found, scale = ticks.reshape(array.shape), UNITS[unit]
            return number_column("times", found / scale, length), lost_digits(
                found / scale, found, scale
            )
    if array.dtype.kind == "M":
        fine = np.datetime_data(array.dtype)[0] in ("ns", "ps", "fs", "as")
        array = array.astype("M8[ns]") if fine else array
        seconds = number_column("times", date_seconds(array), length)
        return seconds, lost_digits(seconds, array.astype(np.int64), UNITS["ns"]) if fine else 0.0
    if array.dtype.kind == "b":
        raise ValueError("times must be numbers")
    seconds = number_column("times", times, length)
    if array.dtype.kind in "iu":
        return seconds, lost_digits(seconds, array.astype(np.int64), 1)
    exact = enumerate(array.tolist() if array.dtype == object else ())
    lost = {
        at: float(one - type(one)(seconds[at]))
        for at, one in exact
        if isinstance(one, int | Decimal)
    }
    return seconds, np.array([lost.get(at, 0.0) for at in range(length)]) if lost else 0.0


def number_column(column: str, values: Any, length: int) -> Floats:
    """Return a column as finite numbers."""
    array = numpy_array(f"the column of {column}", values, "numbers")
    try:
        if array.dtype.kind not in "biufO":
            raise TypeError
        array = array.astype(np.float64, copy=False)
    except (ValueError, TypeError, OverflowError):
        raise ValueError(f"{column} must be numbers") from None
    if array.shape != (length,):
        raise ValueError(f"{column} have shape {array.shape}; there are {length} raters")
    if not (known := np.isfinite(array)).all():
        raise ValueError(
            f"{column} hold {array[~known][0]} at position {known.argmin() + 1}; all must be "
            "numbers"
        )
    return array


def joined_columns(parts: list[StreamColumns]) -> StreamColumns:
    """Return columns one after the other; columns without ratings if there are none."""
    none = np.zeros(0, np.int64), np.zeros(0, np.int64), *np.zeros((3, 0))
    return tuple(np.concatenate(columns) for columns in zip(*parts or [none], strict=True))  # type: ignore[return-value]


def among(names: Names, chosen: set[Any]) -> npt.NDArray[np.bool_]:
    """Return whether each name is one of the chosen."""
    return np.fromiter((name in chosen for name in names.tolist()), bool, len(names))
