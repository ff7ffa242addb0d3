"""What a process has started, as this system tells it."""

from contextlib import suppress
from pathlib import Path


def children(pid: int) -> list[int]:
    """The ids of a process's own processes."""
    found = []
    for entry in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):  # it has ended
            if entry.joinpath("stat").read_text().rpartition(")")[2].split()[1] == str(pid):
                found.append(int(entry.name))
    return found
