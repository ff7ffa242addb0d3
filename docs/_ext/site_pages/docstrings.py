"""Docstrings as pages: formulas are typeset or stay as they are, names in backticks become links.

Autodoc calls these functions; their arguments are those of its events.
"""

import ast
import inspect
import re
import textwrap
import tomllib
from collections.abc import Callable, Iterable
from dataclasses import is_dataclass
from functools import cache
from pathlib import Path
from typing import Any

from docutils import nodes
from latex2mathml.converter import convert
from sphinx.addnodes import pending_xref
from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment
from sphinx.util.nodes import make_refnode

from roletrust_env.game.policy import registry as attackers
from roletrust_env.logs.models import LOG_MODELS
from roletrust_env.trust.model import registry as models

MARKDOWN = "## "
"""First characters of a heading in a docstring in Markdown, as in Gymnasium; such a docstring is a
page of its own."""


def readable(app: Sphinx, what: str, name: str, thing: Any, options: Any, lines: list[str]) -> None:
    """Mark formulas, which stand indented after an empty line, and show the attributes of data as
    parameters.

    The formula of a trust model or an attack is typeset. It stands where the docstring has it as
    plain text, else after the first paragraph. Their parameters stand in the table of their page.
    """
    if any(kind.factory(of) is thing for kind in (models, attackers) for of in kind.names()):
        lines[:] = re.sub(
            r"^(?:Args|Attributes):\n(?: .*\n|\n)*", "", "\n".join([*lines, ""]), flags=re.M
        ).splitlines()
    page = next((at for at, line in enumerate(lines) if line.startswith(MARKDOWN)), len(lines))
    made_of_them = is_dataclass(thing) or hasattr(thing, "_fields")
    lines[:] = [
        "Args:" if made_of_them and line == "Attributes:" else line
        for line in _with_formulas(lines[:page], formula_of(thing))
    ]


def _with_formulas(lines: list[str], latex: list[str]) -> list[str]:
    result: list[str] = []
    inside = replacing = False
    for before, line in zip(["", *lines], lines, strict=False):
        indented = line.startswith("    ")
        if line and not indented:
            inside = re.fullmatch(r"[A-Z]\w*:", line) is not None  # a section, such as Args
            replacing = False
        elif indented and not before and not inside:
            replacing, inside = bool(latex), True
            result += [*typeset(latex), ""] if replacing else ["::", ""]
            latex = []
        if not (replacing and indented):
            result.append(line)
    if latex:
        first = result.index("") if "" in result else len(result)
        result[first:first] = ["", *typeset(latex)]
    return result


def as_written(
    app: Sphinx,
    what: str,
    name: str,
    thing: Any,
    options: Any,
    signature: str | None,
    returns: str | None,
) -> tuple[str, str] | None:
    """Return signatures that are short: types as the source has them, for classes names and
    defaults only.
    """
    if what in ("function", "method"):
        node = _definition(thing)
        if node is None:
            return None
        names = [*node.args.posonlyargs, *node.args.args]
        if names and names[0].arg in ("self", "cls"):
            (node.args.posonlyargs or node.args.args).pop(0)
        return f"({ast.unparse(node.args)})", ast.unparse(node.returns) if node.returns else ""
    if getattr(thing, "_is_protocol", False):
        return "", ""
    if what == "class" and signature:
        try:
            parameters = inspect.signature(thing).parameters.values()
        except (TypeError, ValueError):
            return None
        bare = [parameter.replace(annotation=inspect.Parameter.empty) for parameter in parameters]
        return str(inspect.Signature(bare)), ""
    return None


def _definition(thing: Any) -> ast.FunctionDef | None:
    """Return the function in the source."""
    try:
        source = textwrap.dedent(inspect.getsource(inspect.unwrap(thing)))
    except (OSError, TypeError):
        return None
    node = ast.parse(source).body[0]
    return node if isinstance(node, ast.FunctionDef) else None


def skipped(app: Sphinx, what: str, name: str, thing: Any, skip: bool, options: Any) -> bool | None:
    """Skip fields of a NamedTuple, which are documented as attributes."""
    return True if type(thing).__name__ == "_tuplegetter" or name.startswith("model_") else None


def found_by_its_last_names(
    app: Sphinx, env: BuildEnvironment, node: pending_xref, text: nodes.TextElement
) -> nodes.reference | None:
    """Return the link of a name such as `Policy.quality`: the only object whose full name ends with
    it.
    """
    if node.get("refdomain") != "py":
        return None
    found = env.domains.python_domain.find_obj(env, None, None, node["reftarget"], None, 1)  # type: ignore[arg-type]
    places = {(entry.docname, entry.node_id) for _, entry in found}
    if len(places) != 1:
        return None
    (page, place), *_ = places
    return make_refnode(app.builder, node["refdoc"], page, place, text, node["reftarget"])


@cache
def formulas() -> dict[str, dict[str, str]]:
    """Return the LaTeX of each trust model and each attack, by `models`, `attacks` or `neighbours`
    and by name.
    """
    return tomllib.loads(Path(__file__).with_name("formulas.toml").read_text(encoding="utf-8"))


def formula_of(thing: object) -> list[str]:
    r"""Return the rows of LaTeX of a class that is registered or of a neighbouring field, none
    without a formula.

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
    """Return the lines of a math directive of reStructuredText, one aligned row for each
    formula.
    """
    return [
        ".. math::",
        "",
        r"   \begin{align*}",
        *(f"   {row} \\\\" for row in rows[:-1]),
        f"   {rows[-1]}",
        r"   \end{align*}",
    ]


def inline(translator: Any, node: nodes.math) -> None:
    """Write a formula within a text as MathML, which browsers show without a script or a font from
    elsewhere.
    """
    translator.body.append(convert(node.astext()))
    raise nodes.SkipNode


def block(translator: Any, node: nodes.math_block) -> None:
    """Write a formula of its own lines as MathML. See `inline`."""
    latex = node.astext()
    translator.body.append(f'<div class="math">{convert(latex, display="block")}</div>\n')
    raise nodes.SkipNode
