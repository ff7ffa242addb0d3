"""The tape on which the operations of a round are written, and the function in straight-line Python
that it becomes.
"""

import math
from collections import Counter
from collections.abc import Callable, Container, Iterable, Mapping, Sequence
from textwrap import TextWrapper
from typing import Any, NamedTuple

import numpy as np

from roletrust_env.arrays import Array

Element = Any
"""A `Symbol`, or a number or a flag of Python, which is the same in every round."""

_WIDTH = 88
"""Length up to which the expression of a number that is used once is put where it is used."""


_IS = "\N{NO-BREAK SPACE}=\N{NO-BREAK SPACE}"  # outside of brackets a line must not break
_WRAP = TextWrapper(100, " " * 4, " " * 8, break_long_words=False, break_on_hyphens=False)


class Untraceable(Exception):  # noqa: N818 - no error of the user
    """The rules do something that cannot be written as straight-line code; the message is the
    reason.
    """


class Symbol:
    """A number that is known only when a round is played.

    Attributes:
        kind: Kind of its dtype: `f`, `i` or `b`.
        name: Name of an input; empty for a result, which the writer names.
    """

    __slots__ = ("kind", "name")

    def __init__(self, kind: str, name: str = "") -> None:
        self.kind, self.name = kind, name

    def _refuse(self, *_: Any) -> Any:
        raise Untraceable("a rule leaves NumPy's functions of arrays")

    __lt__ = __le__ = __gt__ = __ge__ = __add__ = __radd__ = __mul__ = __rmul__ = __sub__ = (
        __rsub__
    ) = __invert__ = __neg__ = __eq__ = __ne__ = __bool__ = _refuse
    __hash__ = object.__hash__  # of the identity


class Operation(NamedTuple):
    """An operation of a round.

    Attributes:
        results: Symbols that it sets.
        template: Expression in Python with a place for each argument, as for `str.format`.
        arguments: Elements that it takes.
        call: Function that returns the results for vectors, and how many arguments are in each;
            None where the operation is no call.
    """

    results: Sequence[Symbol]
    template: str
    arguments: Sequence[Element]
    call: tuple[Callable[..., Array], list[int]] | None = None

    def symbols(self) -> list[Symbol]:
        """Return the symbols in the expression, as often as they stand there."""
        if "{0}" not in self.template:
            return [one for one in self.arguments if isinstance(one, Symbol)]
        return [
            one
            for k, one in enumerate(self.arguments)
            if isinstance(one, Symbol)
            for _ in range(self.template.count(f"{{{k}}}"))
        ]


class Written(NamedTuple):
    """A written round.

    Attributes:
        play: The round. It takes the numbers of each input, and returns a tuple for each output.
        lines: Its source in Python.
    """

    play: Callable[..., Any]
    lines: list[str]

    @property
    def source(self) -> str:
        """The source, in lines that are not too long to read."""
        return (
            "\n".join([self.lines[0], *map(_WRAP.fill, self.lines[1:])]).replace(_IS, " = ") + "\n"
        )


class Tape:
    """The operations of a round in order, each once.

    Args:
        limit: Number of operations beyond which NumPy is faster.
        for_c: Whether it becomes C for many games: in either precision, with the functions of C.

    Attributes:
        assumed: Tables of flags, of which a row was taken as it is in this round, and the symbol of
            its place.
        names: Functions and tables in the expressions, by name.

    Raises:
        Untraceable: There are more operations than the limit.
    """

    def __init__(self, limit: int, for_c: bool = False) -> None:
        self.for_c = for_c
        self.assumed: list[tuple[Symbol, Array]] = []
        self._operations: list[Operation] = []
        self.names: dict[str, Any] = {
            "sqrt": math.sqrt,
            "sin": _sin(),
            "inf": math.inf,
            "nan": math.nan,
        }
        self._limit = limit
        self._known: dict[Any, Symbol] = {}

    def write(self, template: str, arguments: Sequence[Element], kind: str) -> Symbol:
        """Return the symbol of an operation, which is written down if it is new."""
        # The bits count: 0.0, -0.0, 0 and False are four constants.
        key = template, *(one if isinstance(one, Symbol) else repr(one) for one in arguments)
        if key not in self._known:
            self._known[key] = symbol = Symbol(kind)
            self._append(Operation((symbol,), template, arguments))
        return self._known[key]

    def call(
        self,
        function: Callable[..., Array],
        name: str,
        lists: Sequence[Sequence[Element]],
        kinds: str,
    ) -> Any:
        """Return the symbols of the entries that a function returns for vectors, each with its
        kind.
        """
        results = [Symbol(kind) for kind in kinds]
        places = ", ".join(f"({'{}, ' * len(one)})" for one in lists)
        arguments = [element for one in lists for element in one]
        template = f"{self.named(name, function)}({places}).tolist()"
        self._append(Operation(results, template, arguments, (function, list(map(len, lists)))))
        return results

    def named(self, name: str, value: Any) -> str:
        """Return a new name for a function or a table."""
        name = f"{name}_{len(self.names)}"
        self.names[name] = value
        return name

    def written(
        self, inputs: Mapping[str, Sequence[Symbol]], outputs: Sequence[Sequence[Element] | None]
    ) -> Written:
        """Return the function of this tape.

        Args:
            inputs: Names of its arguments, and the symbols that their entries are.
            outputs: Elements of each result; None is returned as None.
        """
        returned = [
            element for output in outputs for element in output or () if isinstance(element, Symbol)
        ]
        needed = self.needed(returned)
        uses = Counter([*returned, *(symbol for one in needed for symbol in one.symbols())])
        text = {symbol: symbol.name for symbols in inputs.values() for symbol in symbols}

        def shown(element: Element) -> str:
            return text[element] if isinstance(element, Symbol) else repr(element)

        lines, count = [], 0
        for name, symbols in inputs.items():
            if any(uses[symbol] for symbol in symbols):
                lines.append(
                    f"({', '.join(text[one] if uses[one] else '_' for one in symbols)},){_IS}{name}"
                )
        for one in needed:
            expression = one.template.format(*map(shown, one.arguments))
            if not one.call and uses[one.results[0]] == 1 and len(expression) <= _WIDTH:
                text[one.results[0]] = expression
                continue
            for symbol in one.results:
                count += 1
                text[symbol] = f"t{count}"
            targets = ", ".join(text[symbol] for symbol in one.results)
            lines.append(
                f"({targets},){_IS}{expression}" if one.call else f"{targets}{_IS}{expression}"
            )
        results = (
            "None" if one is None else f"({''.join(f'{shown(part)}, ' for part in one)})"
            for one in outputs
        )
        lines.append(f"return ({', '.join(results)},)")
        lines = [f"def play({', '.join(inputs)}):", *lines]
        scope = dict(self.names)
        exec(compile("\n ".join(lines).replace(_IS, "="), "<a written round>", "exec"), scope)
        return Written(scope["play"], lines)

    def needed(self, returned: Iterable[Symbol], known: Container[Symbol] = ()) -> list[Operation]:
        """Return the operations on which a result depends, in order, without those by which symbols
        become known.
        """
        wanted, kept = {symbol for symbol in returned if symbol not in known}, []
        for one in reversed(self._operations):
            if not wanted.isdisjoint(one.results):
                kept.append(one)
                wanted.update(symbol for symbol in one.symbols() if symbol not in known)
        return kept[::-1]

    def _append(self, operation: Operation) -> None:
        self._operations.append(operation)
        if len(self._operations) > self._limit:
            raise Untraceable(f"a round has more than {self._limit:,} operations")


def _sin() -> Callable[[float], float]:
    """Return Python's sine where it is NumPy's to the bit, and NumPy's elsewhere."""
    angles = np.linspace(0.0, math.pi, 1001)
    same = np.sin(angles).tolist() == [math.sin(angle) for angle in angles.tolist()]
    return math.sin if same else lambda angle: float(np.sin(angle))
