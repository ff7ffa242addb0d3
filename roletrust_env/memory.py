"""The memory that is free, and refusals of what does not fit into it."""

import os
import re
from pathlib import Path

_SHARE = 0.8
"""Share of the free memory that a run may take; the rest is for what is not counted here."""


def check_memory(option: str, number: int, each: float, hint: str = "") -> None:
    """Refuse a run that does not fit into the memory.

    Args:
        option: Option that sets the size of the run.
        number: Value of the option.
        each: Memory for each unit of it, in bytes.
        hint: Further cost of the run, in words.

    Raises:
        ValueError: The run does not fit. The message says what it would take, and about how large a
            run fits.
    """
    free = _SHARE * available()
    if number * each > free:
        fits = int(free / each)
        fits -= fits % 10 ** max(0, len(str(fits)) - 2)  # two digits
        raise ValueError(
            f"{option} {number:,} would take about {in_bytes(number * each)} of memory{hint}; "
            f"{in_bytes(free)} can be had, enough for about {fits:,}"
        )


def available() -> float:
    """Return the free memory in bytes as Linux states it, else that of the whole machine, else
    infinity.
    """
    try:
        free = float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    except (AttributeError, ValueError, OSError):
        free = float("inf")
    if match := re.search(r"MemAvailable: *(\d+) kB", kernel_file("/proc/meminfo")):
        free = 1024.0 * int(match[1])
    limit = kernel_file("/sys/fs/cgroup/memory.max").strip()  # of a container; or the word max
    return min(free, float(limit)) if limit.isdecimal() else free


def in_bytes(size: float) -> str:
    """Return a size for people.

    Example:
        >>> in_bytes(3.26e12), in_bytes(21e6)
        ('3.3 TB', '21 MB')
    """
    unit, of = next(
        ((unit, of) for unit, of in (("TB", 1e12), ("GB", 1e9)) if size >= of), ("MB", 1e6)
    )
    return f"{two_digits(size / of)} {unit}"


def two_digits(value: float) -> str:
    """Return a number with two digits for people."""
    return f"{value:.1f}".removesuffix(".0") if value < 10 else f"{float(f'{value:.1e}'):,.0f}"


def kernel_file(path: str) -> str:
    """Return a file of the kernel; empty where there is none."""
    try:
        return Path(path).read_text()
    except OSError:
        return ""
