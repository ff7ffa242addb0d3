"""The HTML page: the template with tables and pictures, complete in one file."""

import math
from base64 import b64encode
from collections.abc import Mapping

from jinja2 import Environment, PackageLoader
from markupsafe import Markup

from roletrust_env.evaluation.specs import is_own_model
from roletrust_env.metrics.confidence import Estimate, Interval
from roletrust_experiments.report.board import label
from roletrust_experiments.report.content import Content


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
