"""A tape in C: the statements that play one round of one game."""

import math
import re
from collections.abc import Mapping, Sequence

from roletrust_env.game.traced.tape import Element, Symbol, Tape, Untraceable

_PRELUDE = """#include <math.h>
#include <stdint.h>
#include <stdlib.h>
typedef {real} real;
typedef {whole} whole;
typedef uint32_t word;
typedef int flag;
"""

TYPES = {"f": "real", "i": "whole", "u": "word", "b": "flag"}
"""C type of a number, by the kind of its dtype."""

_C = {
    "({} / {})": "((real){} / (real){})",
    "(not {})": "(!{})",
    "({} and {})": "({} & {})",  # flags are 0 or 1, and a loop without jumps can be vectorised
    "({} or {})": "({} | {})",
    "({1} if {0} else {2})": "({0} ? {1} : {2})",
    "({0} if {0} > {1} else {1})": "({0} > {1} ? {0} : {1})",
    "({0} if {0} < {1} else {1})": "({0} < {1} ? {0} : {1})",
    "(1.0 if {} else 0.0)": "((real){})",
    "float({})": "((real){})",
    "int({})": "((whole){})",
}
"""Expressions that C writes in another way than Python."""

_AS_IN_PYTHON = re.compile(
    r"\(\{\}( \+ \{\})+\)|\(\{\} ([-*<>^]|[<>=!]=|>>) \{\}\)|\(-\{\}\)|\{\}|\(\{0\} (\*|!=) \{0\}\)|\(\{\} != 0\)"  # noqa: E501
)
_FUNCTION = re.compile(r"(abs|sqrt|sin|cos|exp|log|expm1|log1p|pow)\((\{\}|\{\}, \{\})\)")
_LOOK_UP = re.compile(r"(\w+)\[\{\}\]")


def prelude(real: str) -> str:
    """Return the types that the statements use.

    Args:
        real: C type of numbers, `double` or `float`.
    """
    return _PRELUDE.format(real=real, whole="int64_t" if real == "double" else "int32_t")


def c_body(
    tape: Tape, places: Mapping[Symbol, str], targets: Sequence[tuple[str, Element]], real: str
) -> tuple[list[str], list[str]]:
    """Return the statements of a round.

    Args:
        tape: Operations of the round.
        places: Expression in C of each input.
        targets: Place in C of each result, and the element that it is set to.
        real: C type of numbers, `double` or `float`.

    Returns:
        The statements, and the declarations of the tables that they use.

    Raises:
        Untraceable: The round calls NumPy.
    """
    names = dict(places)
    tables: dict[str, str] = {}

    def shown(element: Element) -> str:
        return names[element] if isinstance(element, Symbol) else _constant(element, real)

    lines = []
    wanted = [element for _, element in targets if isinstance(element, Symbol)]
    for k, one in enumerate(tape.needed(wanted, places)):
        if one.call:
            raise Untraceable(
                f"a round calls NumPy: C has no {one.template.partition('(')[0].rpartition('_')[0]}"
            )
        result = one.results[0]
        expression = _expression(one.template, one.arguments, real)
        if look_up := _LOOK_UP.fullmatch(one.template):
            table = tape.names[look_up[1]]
            tables[look_up[1]] = _table(look_up[1], table, result.kind, real)
            last = len(table) - 1  # a game that is over may be played on, and its round left unused
            expression = (
                f"{look_up[1]}[{{0}} < 0 ? {{0}} + {last + 1} : {{0}} < {last} ? {{0}} : {last}]"
            )
        names[result] = f"t{k + 1}"
        lines.append(
            f"const {TYPES[result.kind]} t{k + 1} = "
            f"{expression.format(*map(shown, one.arguments))};"
        )
    lines += [f"{place} = {shown(element)};" for place, element in targets]
    return lines, list(tables.values())


def _expression(template: str, arguments: Sequence[Element], real: str) -> str:
    """Return the expression in C of a template in Python."""
    if function := _FUNCTION.fullmatch(template):
        name = function[1]
        if name == "abs":
            name = "llabs" if getattr(arguments[0], "kind", "f") != "f" else "fabs"
        return f"{name}{'f' * (real == 'float' and name != 'llabs')}({function[2]})"
    if template == "({} // {})" and isinstance(arguments[1], int) and arguments[1] > 0:
        return "(({0} < 0 ? {0} - {1} + 1 : {0}) / {1})"
    if template in _C or _AS_IN_PYTHON.fullmatch(template):
        return _C.get(template, template)
    if _LOOK_UP.fullmatch(template):
        return template
    raise Untraceable(f"C has no {template}")


def _constant(element: Element, real: str) -> str:
    """Return a number or a flag of Python in C, with all its digits."""
    if isinstance(element, bool):
        return str(int(element))
    if isinstance(element, int):
        return f"({element}LL)" if abs(element) >= 2**31 else f"({element})"
    if math.isnan(element):
        return "NAN"
    text = "INFINITY" if math.isinf(element) else repr(abs(element))
    return f"({'-' if math.copysign(1, element) < 0 else ''}({real}){text})"


def _table(name: str, numbers: Sequence[Element], kind: str, real: str) -> str:
    entries = ", ".join(_constant(number, real) for number in numbers)
    return f"static const {TYPES[kind]} {name}[] = {{{entries}}};"
