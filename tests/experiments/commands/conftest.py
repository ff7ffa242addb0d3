"""A report that several files of tests read."""

from pathlib import Path

import pytest
import report_run


@pytest.fixture(scope="session")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of two runs, with the report on them in `out`."""
    here = tmp_path_factory.mktemp("report")
    report_run.write_report(here)
    return here
