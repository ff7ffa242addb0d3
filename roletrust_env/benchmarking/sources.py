"""Sources of the models and attacks of a run: hashes of their files, their packages, and
fingerprints of objects.

A trust model that is given as an object has a name, which says nothing of its parameters. Its
fingerprint is what it does and holds, the same in every process. It tells whether stored results
are those of the same object.
"""

import ast
import hashlib
import inspect
import os
import sys
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from functools import cache
from importlib.machinery import PathFinder
from importlib.metadata import entry_points, packages_distributions, version
from importlib.util import find_spec
from pathlib import Path
from types import BuiltinFunctionType, CodeType, FunctionType, MethodType, ModuleType
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from roletrust_env.evaluation.specs import named_factory
from roletrust_env.storage.untrusted import UntrustedModel
from roletrust_env.trust.model import registry as trust_models
from roletrust_env.trust.model_checks import is_own
from roletrust_env.trust.remote import KINDS as REMOTE

_KNOWN = (
    "roletrust_env",
    "roletrust_agents",
    "roletrust_baselines",
    "numpy",
    "torch",
    "pydantic",
    "pydantic_core",
)
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
        return (
            "code",
            thing.co_code.hex(),
            thing.co_names,
            *(_digest(constant, seen) for constant in thing.co_consts),
        )
    if isinstance(thing, staticmethod | classmethod):
        return type(thing).__name__, _digest(thing.__func__, seen)
    if isinstance(thing, property):
        return "property", *(_digest(accessor, seen) for accessor in (thing.fget, thing.fset))
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
        values += [
            function.__globals__[name] for name in code.co_names if name in function.__globals__
        ]
    values += [code, function.__defaults__, function.__kwdefaults__]
    return "function", function.__qualname__, *(_digest(value, seen) for value in values)


def _class(cls: type, seen: dict[int, int]) -> Iterable[object]:
    """Return the parts of a class: its name, and its attributes unless it is of a known package."""
    name = "class", cls.__module__, cls.__qualname__
    top = cls.__module__.partition(".")[0]
    if (top in _KNOWN or top in sys.stdlib_module_names) and _is_there(cls):
        return name
    own = {
        key: value
        for key, value in vars(cls).items()
        if not (key.startswith("__") and not callable(value))
    }
    return *name, *(_digest(base, seen) for base in cls.__bases__), _digest(own, seen)


def _is_there(thing: Any) -> bool:
    """Return whether a class or a function is in the module that it names: one made below an `ABC`
    names `abc`.
    """
    value: Any = sys.modules.get(thing.__module__)
    for name in thing.__qualname__.split("."):
        value = getattr(value, name, None)
    return value is thing


def _object(thing: Any, seen: dict[int, int]) -> Iterable[object]:
    """Return the parts of an object by the protocol of `pickle`, which leaves out what cannot be
    stored.
    """
    kind = _digest(type(thing), seen)
    try:
        reduced = thing.__reduce_ex__(4)
    except Exception:  # a class of another package may raise anything
        reduced = getattr(thing, "__dict__", None)
    if isinstance(reduced, tuple):
        listed, paired = (
            tuple(part) if part is not None else () for part in (*reduced[3:5], None, None)[:2]
        )
        reduced = (*reduced[:3], listed, paired)
    return "object", kind, _digest(reduced, seen)


def _hash(*parts: object) -> str:
    return hashlib.sha256(repr(parts).encode()).hexdigest()


Sha256 = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]
Word = Annotated[str, Field(max_length=300, pattern=r"^[^\x00-\x1f\x7f]*$")]
"""One line of text without control characters."""

_OWN = ("roletrust_env", "roletrust_agents", "roletrust_baselines", "roletrust_experiments")
"""Packages of this project. The metadata of an editable installation does not list them."""


class Source(UntrustedModel):
    """Source of a class."""

    made_by: Word
    """Path of the class, as `package.module.Class`."""
    package: Word
    """Name of the installed package. Empty if the class belongs to none."""
    version: Word
    """Version of the package."""
    sha256: Sha256
    """Hash of the code in the files that define the class and its base classes, without those of
    the standard library, and without comments, docstrings and layout."""


def source_of(factory: Callable[..., Any]) -> Source:
    """Return the source of a factory in a registry.

    Raises:
        ValueError: A part of the source is not in a file, or says that it is of a module where it
            is not.
    """
    parts = [factory]
    if not isinstance(factory, type | FunctionType):  # an object says what it makes by `kind`
        parts = [
            type(factory),
            *(getattr(factory, name) for name in ("func", "kind") if hasattr(factory, name)),
        ]
    kinds = [
        kind
        for part in parts
        for kind in (inspect.getmro(part) if isinstance(part, type) else (part,))
    ]
    for kind in kinds:
        _check_home(kind, itself=kind in parts)
    modules = sorted(
        {kind.__module__ for kind in kinds if _top(kind.__module__) not in sys.stdlib_module_names}
    )
    digest = hashlib.sha256()
    for module in modules:
        digest.update(f"{module}\n".encode() + _text(module))
    package, number = _package(_top(factory.__module__))
    made_by = f"{factory.__module__}.{getattr(factory, '__qualname__', type(factory).__qualname__)}"
    return Source(made_by=made_by, package=package, version=number, sha256=digest.hexdigest())


def model_source(text: str) -> Source:
    """Return the source of a trust model. A class of another package is not imported, since its
    code would run here.

    Its hash is of all Python files of its package, or of the file of its module.

    Args:
        text: Text `NAME[:key=value,...]`; NAME may be `package.module:Class`.

    Raises:
        ValueError: The name is unknown, or a part of the source is not in a file.
    """
    name, _, rest = text.strip().partition(":")
    kind = rest.partition(":")[0].strip()
    declared = {point.name: point.value for point in entry_points(group=trust_models.group)}
    known = name in REMOTE or trust_models.registered(name) is not None
    if known or not (name in declared or kind.isidentifier()):
        return source_of(named_factory(trust_models, text))
    module, _, kind = declared.get(name, f"{name}:{kind}").partition("[")[0].strip().partition(":")
    top, digest = _top(module), hashlib.sha256()
    spec = PathFinder.find_spec(top, [*sys.path, os.getcwd()]) or find_spec(top)
    if spec is None or not (spec.submodule_search_locations or spec.has_location):
        raise ValueError(
            f"trust model {text!r} is in no file that is found, so its source could not be "
            "compared later"
        )
    for folder in map(Path, spec.submodule_search_locations or ()):
        for file in sorted(folder.rglob("*.py")):
            name = f"{file.relative_to(folder).as_posix()}\n"
            digest.update(name.encode() + _code(file.read_bytes()))
    if not spec.submodule_search_locations:
        file = Path(spec.origin or "")
        digest.update(_code(file.read_bytes()) if file.suffix == ".py" else file.read_bytes())
    package, number = _package(top)
    return Source(
        made_by=f"{module}.{kind}", package=package, version=number, sha256=digest.hexdigest()
    )


def hashes(factories: Mapping[str, Callable[..., Any]]) -> dict[str, str]:
    """Return the source hashes of factories by name.

    The hash of a factory that is not a class or a function of a file covers its parameters, too.
    Examples are a trust model that is given as an object, and a `functools.partial`.
    """
    digests = {}
    for name, factory in factories.items():
        with suppress(ValueError):
            digests[name] = source_of(factory).sha256
        in_file = isinstance(factory, type | FunctionType) and has_file(factory.__module__)
        if not in_file or name not in digests:
            own = getattr(factory, "fingerprint", None) or fingerprint(factory)
            digests[name] = hashlib.sha256(f"{digests.get(name)}\n{own}".encode()).hexdigest()
    return digests


def _check_home(kind: Any, *, itself: bool) -> None:
    """Refuse a class or a function with the name of a module that it is not from: the hash would be
    that of others.

    Raises:
        ValueError: Its module does not have it, or it is none of the trust models where it says
            that it is one.
    """
    module, name = kind.__module__, kind.__qualname__
    known = _top(module) in (*_OWN, *sys.stdlib_module_names)
    local = "<locals>" in name and not known
    stranger = itself and module.startswith("roletrust_env.trust.models.") and not is_own(kind)
    if stranger or not (local or _is_there(kind)):
        raise ValueError(
            f"{name} says that it is of {module}, which does not have it, so its source is not "
            "known"
        )


def _text(module: str) -> bytes:
    file = getattr(sys.modules.get(module), "__file__", None)
    if file is None or not has_file(module):
        raise ValueError(f"{module} is not in a file, so its source could not be compared later")
    return _code(Path(file).read_bytes())


def _code(text: bytes) -> bytes:
    """Return the code of a Python file without its comments, docstrings and layout."""
    tree = ast.parse(text)
    for node in ast.walk(tree):
        body = getattr(node, "body", None)
        if isinstance(body, list):  # of a lambda it is an expression
            texts = [_is_text(statement) for statement in body]
            node.body = [one for one, text in zip(body, texts, strict=True) if not text]  # type: ignore[attr-defined]
    return ast.unparse(tree).encode()


def _is_text(statement: ast.stmt) -> bool:
    return isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant)


def _top(module: str) -> str:
    return module.partition(".")[0]


@cache
def _package(top: str) -> tuple[str, str]:
    """Return the name and the version of the installed package that contains a top-level module."""
    names = packages_distributions().get(top, ["roletrust-env"] if top in _OWN else [])
    return (names[0], version(names[0])) if names else ("", "")
