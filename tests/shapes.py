"""Check the shapes in the annotations of the library while it plays.

`checked_shapes` wraps the public functions and methods of `trust`, `game` and `metrics`. A wrapped
function compares its arguments and its result with the `Shape`s of its annotations, and with those
of the fields of NamedTuples. The sizes S, P, N and the batch are the same in all of a call.
"""

import functools
import importlib
import inspect
import pkgutil
import sys
import types
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Annotated, Any, TypeVar, Union, get_args, get_origin, get_type_hints

import roletrust_env.game
import roletrust_env.metrics
import roletrust_env.trust
from roletrust_env.shapes import Shape
from roletrust_env.trust.ratings import Ratings

PACKAGES = (roletrust_env.trust, roletrust_env.game, roletrust_env.metrics)

_VIEWS = ("ProviderView", "RaterView", "SparseRaterView", "AgentView", "IdentityView")
"""NamedTuples with a batch of their own: agents of a role, then games."""

_UNCHECKED = {"game.views.ViewLayout.places"}
"""Functions inside which nothing is checked: this one makes views of positions, which are whole."""

_KINDS = {
    "float": ("float",),
    "bool": ("bool",),
    "whole": ("int", "uint"),
    "number": ("float", "int", "uint"),
    "any": ("",),
}


class WrongShapeError(BaseException):
    """An array is not what the annotation says. The library catches any `Exception` of a model."""


class Sizes:
    """The sizes of one call.

    Args:
        where: Name of the function.
        known: Sizes by the name of the axis.
        sparse: Whether the game is sparse: then a pair is a cell, (S, K).
        in_trust: Whether this is a function of trust models. Then a memory of pairs may be one for
            known pairs, shape (K,), and a tuple whose type is not said is the state of a model.
            Elsewhere it is the memory of a policy, which may hold anything.
    """

    def __init__(self, where: str, known: dict[str, int], *, sparse: bool, in_trust: bool) -> None:
        self.where, self.sizes, self.batches = where, known, dict[str, tuple[int, ...]]()
        self.sparse, self.in_trust = sparse, in_trust

    def fits(self, value: Any, notes: tuple[Any, ...], scope: str) -> bool:
        """Return whether an array has the shape and dtype of an annotation, and take its sizes."""
        shape_of = next(note for note in notes if isinstance(note, Shape))
        if not hasattr(value, "shape") or not hasattr(value, "dtype"):
            return False
        if not str(value.dtype).rpartition(".")[2].startswith(_KINDS[shape_of.kind]):
            return False
        if self.in_trust and value.ndim == 1 and ("pair" in notes or "age" in notes):
            return True
        axes = shape_of.axes.replace("S P", "S K") if self.sparse else shape_of.axes
        if self.sparse and scope == "ProviderView":
            axes = axes.replace("S", "0")  # it sees no ratings
        names, shape, sizes = axes.split(), tuple(value.shape), dict(self.sizes)
        with_batch = names[-1:] == ["..."]
        names = names[: len(names) - with_batch]
        if len(shape) < len(names) or (not with_batch and len(shape) != len(names)):
            return False
        for name, size in zip(names, shape, strict=False):
            if size != (int(name) if name.isdigit() else sizes.setdefault(name, size)):
                return False
        batch = shape[len(names) :]
        if with_batch and self.batches.setdefault(scope, batch) != batch:
            return False
        self.sizes = sizes
        return True

    def check(self, value: Any, hint: Any, name: str, scope: str = "") -> None:
        """Compare a value with its annotation.

        Raises:
            WrongShapeError: They differ.
        """
        if value is None:
            return
        parts, origin = get_args(hint), get_origin(hint)
        if isinstance(value, tuple) and hasattr(value, "_fields"):
            if hint is not Any or self.in_trust or name.endswith(".trust"):
                self._check_fields(value, name, scope)
        elif isinstance(value, Ratings):
            self._check_ratings(value, name)
        elif origin in (Union, types.UnionType):
            if not any(self._accepts(value, part, scope) for part in parts):
                self._fail(name, value, hint)
        elif origin is tuple and isinstance(value, tuple):
            each = [parts[0]] * len(value) if parts[1:] == (...,) else parts
            for k, (part, of_part) in enumerate(zip(value, each, strict=True)):
                self.check(part, of_part, f"{name}[{k}]", scope)
        elif parts and isinstance(value, list | tuple):
            for k, part in enumerate(value):
                self.check(part, parts[0], f"{name}[{k}]", scope)
        elif _has_shape(hint) and not self.fits(value, hint.__metadata__, scope):
            self._fail(name, value, hint)

    def _accepts(self, value: Any, part: Any, scope: str) -> bool:
        if _has_shape(part):
            return self.fits(value, part.__metadata__, scope)
        return part is Any or not isinstance(part, type) or isinstance(value, part)

    def _check_fields(self, value: Any, name: str, scope: str) -> None:
        cls = type(value)
        scope = scope or (cls.__name__ if cls.__name__ in _VIEWS else "")
        hints = hints_of(cls)
        for field, part in zip(cls._fields, value, strict=True):
            self.check(part, hints.get(field), f"{name}.{field}", scope)

    def _check_ratings(self, ratings: Ratings, name: str) -> None:
        for axis, size in zip("SP", ratings.shape, strict=True):
            if self.sizes.setdefault(axis, size) != size:
                raise WrongShapeError(f"{self.where}: {name} is of {ratings.shape} agents")
        if ratings.raters is None:
            self.check(ratings.values, Annotated[Any, Shape("S P ...")], f"{name}.values")
            self.check(ratings.mask, Annotated[Any, Shape("S P ...", "bool")], f"{name}.mask")

    def _fail(self, name: str, value: Any, hint: Any) -> None:
        found = f"{getattr(value, 'dtype', type(value).__name__)}"
        raise WrongShapeError(
            f"{self.where}: {name} is {found} of shape {tuple(getattr(value, 'shape', ()))}; its "
            f"annotation is {hint}, with {self.sizes}, batch {self.batches}"
        )


def _has_shape(hint: Any) -> bool:
    return any(isinstance(note, Shape) for note in getattr(hint, "__metadata__", ()))


def _has_choice(hint: Any) -> bool:
    """Return whether an annotation has several shapes: then others are to be known first."""
    is_union = get_origin(hint) in (Union, types.UnionType)
    parts = get_args(hint)
    return (is_union and sum(map(_has_shape, parts)) > 1) or any(map(_has_choice, parts))


def has_shapes(hint: Any) -> bool:
    """Return whether there is a shape anywhere in an annotation, or in the fields of a type in
    it."""
    if _has_shape(hint) or hint is Ratings:
        return True
    fields = hints_of(hint).values() if hasattr(hint, "_fields") else get_args(hint)
    return any(has_shapes(part) for part in fields)


@functools.cache
def hints_of(thing: Any) -> dict[str, Any]:
    """Return the annotations of a function or of a class."""
    try:
        return get_type_hints(thing, include_extras=True)
    except NameError:  # a name that type checkers alone know
        return {}


def _known_sizes(owner: Any) -> dict[str, int]:
    """Return the sizes that an object knows by its roster."""
    for place in (owner, getattr(owner, "game", None), getattr(owner, "_game", None)):
        roster = getattr(place, "roster", None) or getattr(place, "_roster", None)
        if roster is not None:
            return {"S": roster.n_raters, "P": roster.n_providers, "N": roster.n_agents}
    return {}


_pauses: list[str] = []
"""Functions in progress inside which nothing is checked."""


def checked(
    function: Callable[..., Any],
    where: str,
    *,
    sparse: bool = False,
    calls: Counter[str] | None = None,
) -> Callable[..., Any]:
    """Return a function that checks its arguments and its result by its annotations.

    Args:
        function: Function or method.
        where: Name of the function in errors.
        sparse: See `Sizes`.
        calls: Number of calls of each function, which this one adds to.
    """
    hints, parameters = hints_of(function), inspect.signature(function)
    in_trust = function.__module__.startswith("roletrust_env.trust")

    @functools.wraps(function)
    def check(*args: Any, **kwargs: Any) -> Any:
        if _pauses:
            return function(*args, **kwargs)
        if where in _UNCHECKED:
            _pauses.append(where)
            try:
                return function(*args, **kwargs)
            finally:
                _pauses.pop()
        given = parameters.bind(*args, **kwargs).arguments
        sizes = Sizes(where, _known_sizes(given.get("self")), sparse=sparse, in_trust=in_trust)
        arguments = [name for name in given if name not in ("self", "cls")]
        for name in sorted(arguments, key=lambda name: _has_choice(hints.get(name))):
            sizes.check(given[name], hints.get(name), name)
        if "" not in sizes.batches and len(sizes.batches) == 1:
            sizes.batches[""] = next(iter(sizes.batches.values()))
        result = function(*args, **kwargs)
        if not isinstance(hints.get("return"), TypeVar):  # it may be the same type, of other sizes
            sizes.check(result, hints.get("return"), "the result")
        if calls is not None:
            calls[where] += 1
        return result

    return check


def modules() -> Iterator[types.ModuleType]:
    """Iterate over the modules of the three packages."""
    for package in PACKAGES:
        yield package
        for info in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
            yield importlib.import_module(info.name)


def public_functions() -> Iterator[tuple[Any, str, str, types.FunctionType, Any]]:
    """Iterate over the public functions and methods of the three packages.

    Yields:
        The module or class, the name in it, the name for errors, the function, and the way back
        from a function to what the owner has: `property`, `classmethod`, `staticmethod` or None.
    """
    for module in modules():
        short = module.__name__.removeprefix("roletrust_env.")
        for name, thing in list(vars(module).items()):
            if name.startswith("_") or getattr(thing, "__module__", None) != module.__name__:
                continue
            if isinstance(thing, types.FunctionType):
                yield module, name, f"{short}.{name}", thing, None
            elif isinstance(thing, type) and not getattr(thing, "_is_protocol", False):
                for attribute, member in list(vars(thing).items()):
                    kind, function = None, member
                    if isinstance(member, property):
                        kind, function = property, member.fget
                    elif isinstance(member, classmethod | staticmethod):
                        kind, function = type(member), member.__func__
                    is_public = not attribute.startswith("_") or attribute == "__init__"
                    if is_public and isinstance(function, types.FunctionType):
                        yield thing, attribute, f"{short}.{name}.{attribute}", function, kind


@contextmanager
def checked_shapes(*, sparse: bool = False) -> Iterator[Counter[str]]:
    """Check the shapes of all public functions of the three packages inside the block.

    Args:
        sparse: Whether the games in the block are sparse.

    Yields:
        The number of calls of each function that has shapes.
    """
    calls, before, replaced = Counter[str](), list[tuple[Any, str, Any]](), dict[int, Any]()
    for owner, name, where, function, kind in public_functions():
        if where not in _UNCHECKED and not any(map(has_shapes, hints_of(function).values())):
            continue
        calls[where] = 0
        new = checked(function, where, sparse=sparse, calls=calls)
        before.append((owner, name, vars(owner)[name]))
        if isinstance(owner, types.ModuleType):
            replaced[id(function)] = new
        else:
            setattr(owner, name, new if kind is None else kind(new))
    for module in [
        module for name, module in sys.modules.items() if name.startswith(("roletrust_", "test"))
    ]:
        for name, thing in list(vars(module).items()):
            if id(thing) in replaced:
                before.append((module, name, thing))
                setattr(module, name, replaced[id(thing)])
    try:
        yield calls
    finally:
        for owner, name, thing in before:
            setattr(owner, name, thing)
