"""A file that one process has for itself."""

import os
from pathlib import Path


class HeldFile:
    """A file that is locked for this process as long as it is open, under any of its names.

    Args:
        path: Path of the file; it is created if it does not exist.
        mode: Permissions of a new file.

    Attributes:
        number: Number of the open file.

    Raises:
        BlockingIOError: Another process has it.
        OSError: It cannot be opened.
    """

    def __init__(self, path: Path, mode: int = 0o644) -> None:
        import fcntl  # some systems lack it, and the rest of the project runs there

        self._path = path
        self.number = os.open(path, os.O_RDWR | os.O_CREAT | os.O_APPEND, mode)
        try:
            fcntl.flock(self.number, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BaseException:
            self.close()
            raise

    def check(self) -> None:
        """Check that the path still names the file, so that what is written is not lost.

        Raises:
            FileNotFoundError: The file was deleted or replaced.
        """
        try:
            named = os.path.samestat(os.stat(self._path), os.fstat(self.number))
        except OSError:
            named = False
        if not named:
            raise FileNotFoundError(f"{self._path} was deleted or replaced while it was in use")

    def close(self) -> None:
        """Release the file."""
        os.close(self.number)
