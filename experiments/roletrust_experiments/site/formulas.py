"""Typeset formulas: LaTeX becomes MathML, which browsers show without a script or a font from elsewhere."""

import tomllib
from collections.abc import Callable, Iterable
from functools import cache
from importlib.resources import files
from typing import Any

from docutils import nodes
from latex2mathml.converter import convert
from sphinx.application import Sphinx

from roletrust_env.game.policy import registry as attackers
from roletrust_env.trust.model import registry as models
from roletrust_env.trust.models.log_models import LOG_MODELS


def setup(app: Sphinx) -> None:
    """Register the renderer as `mathml`; `html_math_renderer` in `docs/conf.py` chooses it."""
    app.add_html_math_renderer("mathml", inline_renderers=(_inline, None), block_renderers=(_block, None))


@cache
def formulas() -> dict[str, dict[str, str]]:
    """Return the LaTeX of each trust model and each attack, by `models`, `attacks` or `neighbours` and by name."""
    return tomllib.loads(files("roletrust_experiments.site").joinpath("formulas.toml").read_text(encoding="utf-8"))


def formula_of(thing: object) -> list[str]:
    r"""Return the rows of LaTeX of a class that is registered or of a neighbouring field, none without a formula.

    Example:
        >>> from roletrust_baselines import Pessimistic
        >>> formula_of(Pessimistic)
        ['y_j &= \\frac{x_j}{2}, \\quad j \\in \\textit{targets}']
    """
    places: dict[str, tuple[Iterable[str], Callable[[str], Any]]] = {
        "models": (models.names(), models.factory),
        "attacks": (attackers.names(), attackers.factory),
        "neighbours": (LOG_MODELS, LOG_MODELS.__getitem__),
    }
    for kind, (names, factory) in places.items():
        for name, latex in formulas()[kind].items():
            if name in names and factory(name) is thing:
                return latex.strip().splitlines()
    return []


def typeset(rows: list[str]) -> list[str]:
    """Return the lines of a math directive of reStructuredText, one aligned row for each formula."""
    return [
        ".. math::",
        "",
        r"   \begin{align*}",
        *(f"   {row} \\\\" for row in rows[:-1]),
        f"   {rows[-1]}",
        r"   \end{align*}",
    ]


def _inline(translator: Any, node: nodes.math) -> None:
    translator.body.append(convert(node.astext()))
    raise nodes.SkipNode


def _block(translator: Any, node: nodes.math_block) -> None:
    latex = node.astext()
    translator.body.append(f'<div class="math">{convert(latex, display="block")}</div>\n')
    raise nodes.SkipNode
