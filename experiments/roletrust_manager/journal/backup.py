"""Backups of a journal while its manager runs."""

import shutil
import sqlite3
from contextlib import closing
from pathlib import Path

from roletrust_env.storage.files import replacing
from roletrust_env.storage.untrusted import check_file
from roletrust_manager.journal.lines import complete_size

_SQLITE = b"SQLite format 3\0"


def is_database(journal: Path) -> bool:
    """Return whether a journal is a database of SQLite; else it is a file of lines.

    Raises:
        OSError: The file cannot be read.
    """
    check_file(journal, "a journal is a file")
    with journal.open("rb") as file:
        return file.read(len(_SQLITE)) == _SQLITE


def back_up(journal: Path, out: Path) -> None:
    """Copy all that a manager has acknowledged, also while it runs.

    Args:
        journal: Journal of a manager of robots, or store of a manager on HTTP, a file of SQLite. A
            database of PostgreSQL has `pg_dump`.
        out: New file.

    Raises:
        ValueError: The journal is damaged.
        OSError: It cannot be read, or the copy cannot be written or exists.
    """
    if out.exists():
        raise FileExistsError(f"{out} exists already; a backup needs a new file")
    is_sqlite = is_database(journal)
    with replacing(out) as temporary:
        temporary.touch(journal.stat().st_mode & 0o777)
        if not is_sqlite:
            with journal.open("rb") as file, temporary.open("wb") as copy:
                shutil.copyfileobj(file, copy)
            with temporary.open("r+b") as copy:
                copy.truncate(complete_size(temporary))
            return
        try:
            source = sqlite3.connect(f"{journal.resolve().as_uri()}?mode=ro", uri=True)
            with closing(source), closing(sqlite3.connect(temporary)) as target:
                source.backup(target)
                target.execute("pragma journal_mode = delete")  # one file has all
        except sqlite3.Error as error:
            raise ValueError(f"{journal} cannot be copied: {error}") from None
