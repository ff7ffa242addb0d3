"""Files of NumPy arrays with a checksum, which are never code."""

import hashlib
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from zipfile import ZIP_STORED, ZipFile, is_zipfile

import numpy as np
import numpy.typing as npt

from roletrust_env.storage.files import replacing

Arrays = Mapping[str, npt.NDArray[Any]]

_SUM = "sha256"


def save_arrays(path: Path, arrays: Arrays) -> None:
    """Write arrays of numbers to a file with a checksum, completely or not at all, also if the
    power fails.
    """
    with replacing(path) as temporary, temporary.open("wb") as file:
        np.savez(file, **arrays, **{_SUM: _checksum(arrays)})  # type: ignore[arg-type]
        file.flush()
        os.fsync(file.fileno())


def load_arrays(path: Path) -> dict[str, npt.NDArray[Any]]:
    """Return the arrays that `save_arrays` has written.

    Raises:
        ValueError: The file is something else, is damaged, or was changed. The message says what is
            wrong, without the path.
        OSError: The file cannot be opened.
    """
    with open(path, "rb") as file:
        try:
            if not is_zipfile(file):  # NumPy would take it for a pickle
                raise ValueError("it is no zip file")
            with ZipFile(file) as packed:
                if any(part.compress_type != ZIP_STORED for part in packed.infolist()):
                    raise ValueError("it is compressed, so it may become larger than memory")
            file.seek(0)
            with np.load(file, allow_pickle=False) as stored:
                arrays = dict(stored)
            checksum = arrays.pop(_SUM)
        except (
            Exception
        ) as error:  # the readers of NumPy and of zip files raise many kinds on damaged files
            raise ValueError(f"it is no complete file of arrays: {_reason(error)}") from None
    if not np.array_equal(checksum, _checksum(arrays)):
        raise ValueError("its numbers are not the saved ones: the checksum differs")
    return arrays


def _checksum(arrays: Arrays) -> npt.NDArray[np.uint8]:
    """Return the SHA-256 of arrays with their names, types and shapes."""
    digest = hashlib.sha256()
    for name, array in sorted(arrays.items()):
        digest.update(f"{name} {array.dtype.str} {array.shape} ".encode())
        digest.update(np.ascontiguousarray(array).data)
    return np.frombuffer(digest.digest(), np.uint8)


def _reason(error: Exception) -> str:
    """Return the first line of an error, or its kind if it has none."""
    if isinstance(error, KeyError):
        return f"{error.args[0]} is missing"
    return str(error).partition("\n")[0] or type(error).__name__
