"""Arguments that no face takes."""

from collections.abc import Callable, Iterable
from inspect import Parameter, signature
from typing import Any

from roletrust_env.world import Scenario


def refuse_unknown(face: type[Any], arguments: Iterable[str], *takers: Callable[..., Any]) -> None:
    """Refuse an argument that nobody takes, in Python's own words: some libraries wait for them and do without it.

    Args:
        face: the class that was called.
        arguments: names of keyword arguments.
        takers: what the arguments are handed on to, beside the scenario's `change`.

    Raises:
        TypeError: an argument is none of the takers', no field of a scenario and not `noise`.
    """
    callables: tuple[Callable[..., Any], ...] = (face, *takers)
    parameters = [p for taker in callables for p in signature(taker).parameters.values()]
    named = [p.name for p in parameters if p.kind is not Parameter.VAR_KEYWORD]
    known = list(dict.fromkeys([*named, *Scenario.model_fields, "noise"]))
    for name in arguments:
        if name not in known:
            raise TypeError(
                f"{face.__name__}.__init__() got an unexpected keyword argument {name!r}; known are {', '.join(known)}"
            )
