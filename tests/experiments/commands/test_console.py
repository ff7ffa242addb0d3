"""What the commands print with."""

import io

import pytest
from rich.console import Console

from roletrust_experiments.commands.console import progress_bar


class Screen(io.StringIO):
    """Where somebody looks."""

    def isatty(self):
        return True


@pytest.mark.parametrize(("where", "shown"), [(Screen, True), (io.StringIO, False)])
def test_a_progress_bar_moves_or_is_not_there(where, shown):
    """A notebook asks for colours, as `force_terminal` does, and keeps all that is printed. Short
    work needs no log."""
    console = Console(file=where(), force_terminal=True)
    with progress_bar(console) as progress:
        for _ in progress.track(range(3), description="Playing"):
            pass
        progress.console.print("said")
    assert ("Playing" in console.file.getvalue()) == shown
    assert "said" in console.file.getvalue()


def test_a_log_has_a_line_of_progress_at_most_every_ten_seconds(monkeypatch):
    clock = iter([0.0, *(4.0 * k for k in range(1, 100))])
    monkeypatch.setattr("roletrust_experiments.commands.console.monotonic", lambda: now[0])
    now, file = [next(clock)], io.StringIO()
    with progress_bar(Console(file=file, width=20)) as progress:
        job = progress.add_task("Playing a long game", total=8)
        for done in range(1, 9):
            now[0] = next(clock)
            (progress.advance(job) if done % 2 else progress.update(job, completed=done))
    lines = file.getvalue().splitlines()
    assert [line.split()[:-1] for line in lines] == [
        ["Playing", "a", "long", "game", "38%", "3/8"],
        ["Playing", "a", "long", "game", "75%", "6/8"],
    ]
