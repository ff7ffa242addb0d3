"""The folder of a training run: its configuration, and checkpoints that survive a kill at any moment."""

import hashlib
import json
import os
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from roletrust_env.storage.files import clear_unfinished, prepare_folder, replacing, unfinished_path, write_json

_KEPT = 2
"""Number of checkpoints on disk: the last one, and one to fall back on if the last is damaged."""


class Checkpoint(NamedTuple):
    """State from which training continues.

    Attributes:
        steps: Number of rounds so far.
        files: Contents of its files by name.
        notes: Plain data.
    """

    steps: int
    files: Mapping[str, bytes]
    notes: Mapping[str, Any]


class RunFolder:
    """The files of one run.

    Args:
        path: Path of the folder; it is created when something is written.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._checkpoints = path / "checkpoints"

    def config(self) -> dict[str, Any] | None:
        """Return the configuration of the run; None in a new folder.

        Raises:
            ValueError: The file is broken.
        """
        file = self.path / "config.json"
        if not file.exists():
            return None
        try:
            config = json.loads(file.read_text(encoding="utf-8"))
        except ValueError as error:
            raise ValueError(f"{file} is broken ({error}); start again with another --out") from None
        if not isinstance(config, dict):
            raise ValueError(f"{file} holds no run; start again with another --out")
        return config

    def prepare(self) -> None:
        """Check that the run can be written, and remove unfinished files of a killed run.

        Raises:
            OSError: The folder cannot be written.
        """
        prepare_folder(self.path)
        clear_unfinished(self._checkpoints)

    def begin(self, config: Mapping[str, Any]) -> None:
        """Write the configuration of the run."""
        write_json(self.path / "config.json", config)

    def save(self, checkpoint: Checkpoint) -> None:
        """Add a checkpoint, either complete or not at all, and remove all but the last two."""
        self._checkpoints.mkdir(parents=True, exist_ok=True)
        final = self._checkpoints / f"{checkpoint.steps:012d}"
        new = unfinished_path(final)
        shutil.rmtree(new, ignore_errors=True)  # of a failed attempt of this process
        new.mkdir()
        digests = {name: hashlib.sha256(data).hexdigest() for name, data in checkpoint.files.items()}
        about = {"steps": checkpoint.steps, "sha256": digests, "notes": checkpoint.notes}
        for name, data in {**checkpoint.files, "about.json": json.dumps(about).encode()}.items():
            with (new / name).open("wb") as file:
                file.write(data)
                file.flush()
                os.fsync(file.fileno())
        if final.exists():  # damaged, or training would have continued from it
            shutil.rmtree(final)
        os.replace(new, final)
        for old in self._found()[_KEPT:]:
            shutil.rmtree(old)

    def last(self) -> Checkpoint | None:
        """Return the newest undamaged checkpoint; None if there is none."""
        return next((found for path in self._found() if (found := _read(path)) is not None), None)

    def _found(self) -> list[Path]:
        """Return the folders of checkpoints, the newest first."""
        return sorted((path for path in self._checkpoints.glob("[0-9]*") if path.is_dir()), reverse=True)


def write_bytes(path: Path, data: bytes) -> None:
    """Write a file whole or not at all."""
    with replacing(path) as temporary:
        temporary.write_bytes(data)


def _read(path: Path) -> Checkpoint | None:
    """Return a checkpoint; None if a file is missing or has changed since it was written."""
    try:
        about = json.loads((path / "about.json").read_bytes())
        files = {name: (path / name).read_bytes() for name in about["sha256"]}
        for name, expected in about["sha256"].items():
            if hashlib.sha256(files[name]).hexdigest() != expected:
                return None
        return Checkpoint(about["steps"], files, about["notes"])
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return None
