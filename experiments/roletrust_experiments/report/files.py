"""The files of a report: the page, and its tables and figures."""

import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from roletrust_env.errors import check_unicode
from roletrust_env.storage.files import prepare_folder, write_csv, write_text
from roletrust_experiments.report.content import read
from roletrust_experiments.report.figures import write_figures
from roletrust_experiments.report.page import page


def report(
    results: str | Path | Sequence[str | Path], out: str | Path, *, pages: str = ""
) -> list[str]:
    """Write the results of a benchmark as one page that opens in any browser, without a network.

    Args:
        results: Files `results.sqlite`, at most one of trust models and one of learners.
        out: Folder of the page `report.html`; of a CSV file, a PNG and a PDF for each figure; and
            of `leaderboard.md` and `regimes.csv`.
        pages: Address of the folder with the pages of the trust models of this project. Empty makes
            no links.

    Returns:
        The names of the files.

    Raises:
        ValueError: A file cannot be read or is empty, or two have the same kind.
        OSError: A file cannot be written.

    Example:
        >>> from pathlib import Path
        >>> from tempfile import mkdtemp
        >>> from roletrust_env.benchmarking import benchmark, load_suite
        >>> from roletrust_experiments.report.files import report
        >>> suite = load_suite("quick")
        >>> small = suite.worlds.model_copy(update={"selection": 1, "measured": 2})
        >>> suite = suite.model_copy(update={"worlds": small, "games": 1, "selection_games": 1})
        >>> out = Path(mkdtemp())
        >>> _ = benchmark("mean", suite, workers=0, progress=False, out=out)
        >>> report(out / "results.sqlite", out / "report")[:3]
        ['report.html', 'leaderboard.md', 'regimes.csv']
    """
    given = [results] if isinstance(results, str | Path) else results
    paths, out = [Path(one) for one in given], Path(out)
    if not paths:
        raise ValueError("results is empty; it must be a results.sqlite, or two")
    for path in paths:
        check_unicode("the path of the results", str(path))  # which the page shows
    content = read(paths)
    prepare_folder(out)
    for name, table in content.tables.items():
        rows = [[_flat(value) for value in row] for row in table.rows]
        write_csv(out / f"{name}.csv", table.header, rows)
    drawn = write_figures(out, content, ".png", ".pdf")
    pictures = {name: (out / f"{name}.png").read_bytes() for name in drawn}
    command = shlex.join(["roletrust", "report", *map(str, paths), "--out", str(out)])
    replayed, written = "", ["report.html"]
    if models := content.models:
        models.write(out)
        replayed = shlex.join(["roletrust", "replay", str(models.path)])
        written += ["leaderboard.md", "regimes.csv"]
    write_text(out / "report.html", page(content, pictures, command, pages.rstrip("/"), replayed))
    return written + [f"{name}.{kind}" for name in drawn for kind in ("csv", "png", "pdf")]


def _flat(value: Any) -> Any:
    """Return a value for a field of a table; a curve becomes one field."""
    return " ".join(f"{part:g}" for part in value) if isinstance(value, list) else value
