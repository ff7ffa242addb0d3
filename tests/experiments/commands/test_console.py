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
    """A notebook asks for colours, as `force_terminal` does, and keeps all that is printed."""
    console = Console(file=where(), force_terminal=True)
    with progress_bar(console) as progress:
        for _ in progress.track(range(3), description="Playing"):
            pass
        progress.console.print("said")
    assert ("Playing" in console.file.getvalue()) == shown
    assert "said" in console.file.getvalue()
