"""Tables of columns, as CSV or Parquet, written by pyarrow."""

from pathlib import Path
from typing import Any

import numpy as np

from roletrust_env.storage.files import replacing

_LARGE = 1e12  # numbers that have no six decimals in 64 bits


def write_table(path: Path, table: Any) -> None:
    """Write a table of pyarrow, completely or not at all.

    Args:
        path: Path of the file: `.parquet` for Parquet, else CSV. There, texts are in quotes, and
            missing ones empty. Columns of floats have six decimals if all are below 10^12.
        table: Table.
    """
    if path.suffix.lower() == ".parquet":
        from pyarrow.parquet import ParquetWriter as Writer
    else:
        from pyarrow.csv import CSVWriter as Writer

        table = _decimals(table)
    with replacing(path) as temporary, Writer(temporary, table.schema) as writer:
        writer.write_table(table)


def _decimals(table: Any) -> Any:
    """Return a table with six decimals in place of floats, and with texts in place of dictionaries
    of them.
    """
    import pyarrow as arrow

    for place, field in enumerate(table.schema):
        column = table.column(place).combine_chunks()
        if arrow.types.is_floating(field.type):
            missing = column.is_null(nan_is_null=True).to_numpy(False)
            values = np.where(missing, 0.0, column.to_numpy(False))
            if np.abs(values).max(initial=0.0) >= _LARGE:
                continue
            millionths = arrow.array(np.rint(values * 1e6).astype(np.int64), mask=missing)
            column = arrow.Array.from_buffers(
                arrow.decimal64(18, 6), len(column), millionths.buffers()
            )
        elif arrow.types.is_dictionary(field.type):
            column = column.dictionary_decode()
        table = table.set_column(place, field.name, column)
    return table
