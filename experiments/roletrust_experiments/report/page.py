"""The HTML page: the template with tables, figures and their numbers, complete in one file."""

import json
import math
from collections.abc import Mapping, Sequence
from typing import Any

from bokeh.embed import json_item
from bokeh.resources import Resources
from jinja2 import Environment, PackageLoader
from markupsafe import Markup

from roletrust_env.evaluation.specs import is_own_model
from roletrust_env.metrics.confidence import Estimate, Interval
from roletrust_experiments.report.content import Content
from roletrust_experiments.report.figures import figures
from roletrust_experiments.report.looks import looks

_DIGITS = 4
"""Decimals of the numbers in the page; the CSV files have more."""

_CHOSEN = 6
"""Number of models that the figures show at first."""


def page(content: Content, command: str, pages: str = "") -> str:
    """Return the page, which needs no other file and no network.

    Args:
        content: Content of the report.
        command: Command that writes the page.
        pages: Address of the folder with the pages of the trust models of this project. Empty makes no links.
    """
    told = content.robustness
    styles = {
        who: {name: look._asdict() for name, look in looks(part.order).items()}
        for who, part in (("model", told), ("learner", content.learners))
        if part is not None
    }
    data = {
        "tables": {name: _plain(table.columns()) for name, table in content.tables.items()},
        "looks": styles,
        "heat": {name: heat._asdict() for name, heat in told.heat_maps.items()} if told else {},
        "worst": told.worst_conditions if told else {},
        "figures": {name: json_item(found) for name, found in figures(content).items()},
    }
    environment = Environment(
        loader=PackageLoader("roletrust_experiments.report", "template"),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {"estimate": _estimate, "interval": _interval, "number": _number, "share": _share}
    linked = filter(is_own_model, told.order) if told and pages else ()
    return environment.get_template("page.html").render(
        told=told,
        learned=content.learners,
        sections=content.parts,
        command=command,
        looks=styles,
        chosen=_CHOSEN,
        pages={name: f"{pages}/{name.partition(':')[0]}.html" for name in linked},
        choices={name: table.choices() for name, table in content.tables.items()},
        data=Markup(_script_safe(json.dumps(data, allow_nan=False, separators=(",", ":")))),
        bokeh=Markup(Resources(mode="inline", components=["bokeh"]).render_js()),
    )


def _script_safe(text: str) -> str:
    """Return JSON that an HTML parser never reads as a tag."""
    return text.replace("<", "\\u003c")


def _plain(columns: Mapping[str, Sequence[Any]]) -> dict[str, Any]:
    return {name: _shared([_value(value) for value in values]) for name, values in columns.items()}


def _shared(values: list[Any]) -> Any:
    """Return a column; if most values repeat, each value once and the indices."""
    places: dict[str, int] = {}
    at = [places.setdefault(json.dumps(value), len(places)) for value in values]
    return {"values": [json.loads(text) for text in places], "at": at} if 2 * len(places) < len(values) else values


def _value(value: Any) -> Any:
    if isinstance(value, list):
        return [_value(part) for part in value]
    if isinstance(value, float):
        return None if math.isnan(value) else round(value, _DIGITS)
    return value


def _number(value: float) -> str:
    return "-" if math.isnan(value) else f"{value:.3f}"


def _estimate(value: Estimate) -> Markup:
    half = "" if math.isnan(value.half) else f" ± {value.half:.3f}"
    return Markup('{}<span class="half">{}</span>').format(_number(value.mean), half)


def _interval(value: Interval) -> Markup:
    ends = "" if math.isnan(value.low) else f" {value.low:.2f} to {value.high:.2f}"
    return Markup('{}<span class="half">{}</span>').format(_number(value.value), ends)


def _share(value: float) -> str:
    return "-" if math.isnan(value) else f"{value:.0%}"
