"""What was run: the source of a model's or an attack's class, and the package that it is of."""

import hashlib
import inspect
import sys
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import cache
from importlib.metadata import packages_distributions, version
from pathlib import Path
from types import FunctionType
from typing import Annotated, Any

from pydantic import Field

from roletrust_env.benchmark.fingerprint import fingerprint, has_file
from roletrust_env.storage.untrusted import UntrustedModel

Sha256 = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]
Word = Annotated[str, Field(max_length=300, pattern=r"^[^\x00-\x1f\x7f]*$")]
"""One line of text, which a terminal shows as it is."""


_OWN = ("roletrust_env", "roletrust_agents", "roletrust_baselines", "roletrust_experiments")
"""Packages of this project, which the metadata of an editable installation does not list."""


class Source(UntrustedModel):
    """Of a class."""

    made_by: Word
    """The class, as `package.module.Class`."""
    package: Word
    """The installed package that it is of; empty if it is of none."""
    version: Word
    """Of the package."""
    sha256: Sha256
    """Of the files in which it and the classes that it is derived from stand, without Python's own."""


def source_of(factory: Callable[..., Any]) -> Source:
    """The source of what a registry holds.

    Raises:
        ValueError: some of it stands in no file.
    """
    kind = getattr(factory, "kind", factory)  # of a model that is given as an object
    kinds = inspect.getmro(kind) if isinstance(kind, type) else (kind,)
    modules = sorted({kind.__module__ for kind in kinds if _top(kind.__module__) not in sys.stdlib_module_names})
    digest = hashlib.sha256()
    for module in modules:
        digest.update(f"{module}\n".encode() + _text(module))
    package, number = _package(_top(factory.__module__))
    made_by = f"{factory.__module__}.{getattr(factory, '__qualname__', type(factory).__qualname__)}"
    return Source(made_by=made_by, package=package, version=number, sha256=digest.hexdigest())


def hashes(named: Mapping[str, Callable[..., Any]]) -> dict[str, str]:
    """Return the hash of the source of each factory, by its name.

    That of a trust model that is given as an object covers its parameters, too, and so does that of a factory that is
    no class or function of a file, such as a `functools.partial`.
    """
    found = {}
    for name, factory in named.items():
        with suppress(ValueError):
            found[name] = source_of(factory).sha256
        in_file = isinstance(factory, type | FunctionType) and has_file(factory.__module__)
        if not in_file:
            own = getattr(factory, "fingerprint", None) or fingerprint(factory)
            found[name] = hashlib.sha256(f"{found.get(name)}\n{own}".encode()).hexdigest()
    return found


def _text(module: str) -> bytes:
    file = getattr(sys.modules.get(module), "__file__", None)
    if file is None or not has_file(module):
        raise ValueError(f"{module} stands in no file, so nobody could see later whether it is the same")
    return Path(file).read_bytes()


def _top(module: str) -> str:
    return module.partition(".")[0]


@cache
def _package(top: str) -> tuple[str, str]:
    """The name and the version of the installed package that brings a top-level module."""
    found = packages_distributions().get(top, ["roletrust-env"] if top in _OWN else [])
    return (found[0], version(found[0])) if found else ("", "")
