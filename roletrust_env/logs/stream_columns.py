"""Columns of ratings that a stream is given, as arrays."""

from typing import Any, TypeAlias

import numpy as np

from roletrust_env.arrays import numpy_array
from roletrust_env.logs.names import Names
from roletrust_env.logs.sources import Reading, value_column
from roletrust_env.logs.values import seconds_to_nanoseconds, time_nanoseconds
from roletrust_env.trust.key_index import Floats, Ints

StreamColumns: TypeAlias = tuple[Names, Names, Floats, Ints]
"""Names of raters and of providers, ratings on [0, 1], and times in nanoseconds."""


def time_column(times: Any, length: int) -> Ints:
    """Return a column of times in nanoseconds: numbers are seconds, and dates are since 1970.

    Raises:
        ValueError: A value is not a time, or some dates have a time zone and others do not.
    """
    array = numpy_array("the column of times", times, "numbers or dates")
    if array.shape != (length,):
        raise ValueError(f"times have shape {array.shape}; there are {length} raters")
    if array.dtype.kind == "b":
        raise ValueError("times must be numbers or dates, got bool")
    if array.dtype.kind in "iuf":
        return seconds_to_nanoseconds(array)
    if array.dtype.kind == "M":
        if (gone := np.isnat(array)).any():
            raise ValueError(f"times have {array[gone][0]} at position {int(gone.argmax()) + 1}")
        try:
            seconds_to_nanoseconds(array.astype("datetime64[s]").astype(np.int64))
        except OverflowError:
            raise ValueError(f"times have the unit of {array.dtype}; it may be ns") from None
        dates = array.astype("datetime64[ns]")
        if (dates.astype(array.dtype) != array).any() and array.dtype < dates.dtype:
            raise ValueError(f"times of {array.dtype} must be within 292 years of 1970")
        whole: Ints = dates.astype(np.int64)
        return whole
    import pyarrow as arrow

    try:
        column = arrow.chunked_array([value_column(array.tolist())])
    except (arrow.ArrowException, OverflowError, ValueError) as error:
        raise ValueError(f"times must be numbers or dates: {error}") from None
    return time_nanoseconds(column, Reading(), lambda at: f"times, position {int(at) + 1}")


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
    none = *np.zeros((2, 0), np.int64), np.zeros(0), np.zeros(0, np.int64)
    return tuple(np.concatenate(columns) for columns in zip(*parts or [none], strict=True))  # type: ignore[return-value]
