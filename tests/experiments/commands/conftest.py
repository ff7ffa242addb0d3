"""A report that several files of tests read."""

from pathlib import Path
from typing import Any

import pytest
import report_run

from roletrust_env.benchmarking.pool import LocalPool


@pytest.fixture(scope="session")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of two runs, with the report on them in `out`."""
    here = tmp_path_factory.mktemp("report")
    report_run.write_report(here)
    return here


@pytest.fixture
def in_process(monkeypatch: pytest.MonkeyPatch) -> None:
    """Cells are played in this process, where they neither hang nor die."""

    def pool(workers: int | None, **options: Any) -> LocalPool:
        return LocalPool(0, records=options.get("records", {}))

    for command in ("benchmark", "submit"):
        monkeypatch.setattr(f"roletrust_experiments.commands.{command}.LocalPool", pool)
