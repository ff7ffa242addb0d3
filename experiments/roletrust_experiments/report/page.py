"""The HTML page: the template with tables and pictures, complete in one file."""

import math
import shlex
from base64 import b64encode
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader
from markupsafe import Markup

from roletrust_env.errors import check_unicode
from roletrust_env.evaluation.specs import is_own_model
from roletrust_env.metrics.confidence import Estimate, Interval
from roletrust_env.storage.files import prepare_folder, write_csv, write_text
from roletrust_experiments.report.board import label
from roletrust_experiments.report.content import Content, read
from roletrust_experiments.report.figures import write_figures


def report(results: Path | Sequence[Path], out: Path, *, pages: str = "") -> list[str]:
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
        >>> from roletrust_experiments.report.page import report
        >>> suite = load_suite("quick")
        >>> small = suite.worlds.model_copy(update={"selection": 1, "measured": 2})
        >>> suite = suite.model_copy(update={"worlds": small, "games": 1, "selection_games": 1})
        >>> out = Path(mkdtemp())
        >>> _ = benchmark("mean", suite, workers=0, progress=False, out=out)
        >>> report(out / "results.sqlite", out / "report")[:3]
        ['report.html', 'leaderboard.md', 'regimes.csv']
    """
    paths = [results] if isinstance(results, Path) else list(results)
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


def environment() -> Environment:
    """Return the templates of pages, with filters for numbers."""
    loader = PackageLoader("roletrust_experiments.report", "template")
    made = Environment(loader=loader, autoescape=True, trim_blocks=True, lstrip_blocks=True)
    made.filters |= {
        "estimate": _estimate,
        "interval": _interval,
        "number": _number,
        "label": lambda row: label(row.model, row.rule),
    }
    return made


def page(
    content: Content,
    pictures: Mapping[str, bytes],
    command: str,
    pages: str = "",
    replayed: str = "",
) -> str:
    """Return the page, which needs no other file and no network.

    Args:
        content: Content of the report.
        pictures: Picture of each table as a PNG file, by name.
        command: Command that writes the page.
        pages: Address of the folder with the pages of the trust models of this project. Empty makes
            no links.
        replayed: Command that plays the worst attack on the best model again.
    """
    models = content.models
    names = [row.model for row in models.board.rows] if models and pages else []
    return (
        environment()
        .get_template("page.html")
        .render(
            models=models,
            learners=content.learners,
            sections=content.parts,
            command=command,
            replayed=replayed,
            pages={
                name: f"{pages}/{name.partition(':')[0]}.html"
                for name in names
                if is_own_model(name)
            },
            pictures={name: b64encode(picture).decode() for name, picture in pictures.items()},
        )
    )


def _number(value: float) -> str:
    return "-" if math.isnan(value) else f"{value:.3f}" if isinstance(value, float) else str(value)


def _estimate(value: Estimate) -> Markup:
    half = "" if math.isnan(value.half) else f" ± {value.half:.3f}"
    return Markup('{}<span class="half">{}</span>').format(_number(value.mean), half)


def _interval(value: Interval) -> Markup:
    ends = "" if math.isnan(value.low) else f" {value.low:.2f} to {value.high:.2f}"
    return Markup('{}<span class="half">{}</span>').format(_number(value.value), ends)
