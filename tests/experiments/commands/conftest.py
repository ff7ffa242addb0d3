"""A report that several files of tests read, and what spares commands their longest work."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest
import report_run

from roletrust_env.benchmarking.pool import play_safely


@pytest.fixture(scope="session")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of two runs, with the report on them in `out`."""
    here = tmp_path_factory.mktemp("report")
    report_run.write_report(here)
    return here


@pytest.fixture
def drawn() -> None:
    """Figures are drawn."""


@pytest.fixture(autouse=True)
def _undrawn(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Figures are made, but their files are empty: to draw them takes longer than most commands."""

    def write(path: Path, *_: Any, **__: Any) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()

    if "drawn" not in request.fixturenames:
        drawing = (
            "commands.benchmark",
            "commands.play",
            "commands.replay",
            "commands.train",
            "plots.paper",
        )
        for module in (*drawing, "report.figures"):
            monkeypatch.setattr(f"roletrust_experiments.{module}.write_figure", write)


class _InProcess:
    """A pool that plays cells in this process, where they neither hang nor die."""

    def __init__(self, workers: int | None, *_: Any, records: Any = None, **__: Any) -> None:
        self._records = records or {}

    def play(self, suite: Any, cells: Sequence[Any]) -> Iterator[tuple[Any, Any]]:
        for cell in cells:
            yield cell, play_safely(suite, cell, b"", self._records.get(cell))


@pytest.fixture
def in_process(monkeypatch: pytest.MonkeyPatch) -> None:
    """Commands start no processes for cells."""
    for module in ("roletrust_env.benchmarking.run", "roletrust_env.benchmarking.entry_check"):
        monkeypatch.setattr(f"{module}.LocalPool", _InProcess)
