"""The fingerprint of an object: what it does and holds, the same in every process.

A trust model that is given as an object has a name, which says nothing of its parameters. The fingerprint tells whether
stored results are those of the same object.
"""

import hashlib
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path
from types import BuiltinFunctionType, CodeType, FunctionType, MethodType, ModuleType
from typing import Any

import numpy as np

_KNOWN = ("roletrust_env", "roletrust_agents", "roletrust_baselines", "numpy", "torch", "pydantic", "pydantic_core")
"""Packages with classes that their version tells apart."""

_PLAIN = (type(None), bool, int, float, complex, str, bytes)


def fingerprint(thing: object) -> str:
    """Return the hash of an object's parameters, and of the code of its class.

    Args:
        thing: Any object. Parts that say nothing of their content count by their class only.

    Example:
        >>> fingerprint({"lam": 0.5, "cut": 2}) == fingerprint({"cut": 2, "lam": 0.5})
        True
        >>> fingerprint([0.5]) == fingerprint([0.6])
        False
    """
    return _digest(thing, {})


def has_file(module: str) -> bool:
    """Return whether a module that is loaded comes from a file."""
    file = getattr(sys.modules.get(module), "__file__", None)
    return file is not None and Path(file).is_file()


def _digest(thing: Any, seen: dict[int, int]) -> str:
    """Return the hash of an object; of one that is open already, that of its number."""
    if isinstance(thing, _PLAIN):
        return _hash(type(thing).__name__, repr(thing))
    if id(thing) in seen:
        return _hash("again", seen[id(thing)])
    seen[id(thing)] = len(seen)
    try:
        return _hash(*_parts(thing, seen))
    finally:
        del seen[id(thing)]


def _parts(thing: Any, seen: dict[int, int]) -> Iterable[object]:
    """Return the parts of an object as text."""
    if hasattr(thing, "detach") and hasattr(thing, "cpu") and not isinstance(thing, type):
        thing = thing.detach().cpu().numpy()  # a tensor of torch
    if isinstance(thing, np.ndarray) and thing.dtype != object:
        return "array", thing.dtype.str, thing.shape, hashlib.sha256(thing.tobytes()).hexdigest()
    if isinstance(thing, list | tuple):
        return type(thing).__qualname__, *(_digest(part, seen) for part in thing)
    if isinstance(thing, set | frozenset):
        return type(thing).__qualname__, *sorted(_digest(part, seen) for part in thing)
    if isinstance(thing, Mapping):
        pairs = sorted((_digest(key, seen), _digest(value, seen)) for key, value in thing.items())
        return type(thing).__qualname__, *pairs
    if isinstance(thing, ModuleType | BuiltinFunctionType):
        return "name", getattr(thing, "__module__", ""), thing.__name__
    if isinstance(thing, MethodType):
        return "method", _digest(thing.__self__, seen), _digest(thing.__func__, seen)
    if isinstance(thing, FunctionType):
        return _function(thing, seen)
    if isinstance(thing, CodeType):
        return "code", thing.co_code.hex(), thing.co_names, *(_digest(one, seen) for one in thing.co_consts)
    if isinstance(thing, staticmethod | classmethod):
        return type(thing).__name__, _digest(thing.__func__, seen)
    if isinstance(thing, property):
        return "property", *(_digest(one, seen) for one in (thing.fget, thing.fset))
    if isinstance(thing, type):
        return _class(thing, seen)
    return _object(thing, seen)


def _function(function: FunctionType, seen: dict[int, int]) -> Iterable[object]:
    """Return the parts of a function: its code, and the values from outside that the code names."""
    code, values = function.__code__, []
    for cell in function.__closure__ or ():
        try:
            values.append(cell.cell_contents)
        except ValueError:  # nothing was assigned yet
            values.append(None)
    if not has_file(function.__module__):
        values += [function.__globals__[name] for name in code.co_names if name in function.__globals__]
    values += [code, function.__defaults__, function.__kwdefaults__]
    return "function", function.__qualname__, *(_digest(value, seen) for value in values)


def _class(cls: type, seen: dict[int, int]) -> Iterable[object]:
    """Return the parts of a class: its name, and its attributes unless it is of a known package."""
    name = "class", cls.__module__, cls.__qualname__
    top = cls.__module__.partition(".")[0]
    if top in _KNOWN or (top in sys.stdlib_module_names and _is_there(cls)):
        return name
    own = {key: value for key, value in vars(cls).items() if not (key.startswith("__") and not callable(value))}
    return *name, *(_digest(base, seen) for base in cls.__bases__), _digest(own, seen)


def _is_there(cls: type) -> bool:
    """Return whether a class is in the module that it names: one made by `type(...)` below an `ABC` names `abc`."""
    return getattr(sys.modules.get(cls.__module__), cls.__qualname__, None) is cls


def _object(thing: Any, seen: dict[int, int]) -> Iterable[object]:
    """Return the parts of an object by the protocol of `pickle`, which leaves out what cannot be stored."""
    kind = _digest(type(thing), seen)
    try:
        reduced = thing.__reduce_ex__(4)
    except Exception:  # a class of another package may raise anything
        reduced = getattr(thing, "__dict__", None)
    if isinstance(reduced, tuple):
        listed, paired = (tuple(part) if part is not None else () for part in (*reduced[3:5], None, None)[:2])
        reduced = (*reduced[:3], listed, paired)
    return "object", kind, _digest(reduced, seen)


def _hash(*parts: object) -> str:
    return hashlib.sha256(repr(parts).encode()).hexdigest()
