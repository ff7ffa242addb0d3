"""Source code of the models and attacks of a run: hashes of their files, and their packages."""

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

from roletrust_env.benchmarking.fingerprint import fingerprint, has_file
from roletrust_env.storage.untrusted import UntrustedModel

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
    """Hash of the files that define the class and its base classes, without those of the standard library."""


def source_of(factory: Callable[..., Any]) -> Source:
    """Return the source of a factory in a registry.

    Args:
        factory: Class or function.

    Raises:
        ValueError: A part of the source is not in a file.
    """
    kind = getattr(factory, "kind", factory)  # the class of a model that was given as an object
    kinds = inspect.getmro(kind) if isinstance(kind, type) else (kind,)
    modules = sorted({kind.__module__ for kind in kinds if _top(kind.__module__) not in sys.stdlib_module_names})
    digest = hashlib.sha256()
    for module in modules:
        digest.update(f"{module}\n".encode() + _text(module))
    package, number = _package(_top(factory.__module__))
    made_by = f"{factory.__module__}.{getattr(factory, '__qualname__', type(factory).__qualname__)}"
    return Source(made_by=made_by, package=package, version=number, sha256=digest.hexdigest())


def hashes(factories: Mapping[str, Callable[..., Any]]) -> dict[str, str]:
    """Return the source hashes of factories by name.

    The hash of a factory that is not a class or a function of a file covers its parameters, too. Examples are a trust
    model that is given as an object, and a `functools.partial`.

    Args:
        factories: Factories by name.
    """
    digests = {}
    for name, factory in factories.items():
        with suppress(ValueError):
            digests[name] = source_of(factory).sha256
        in_file = isinstance(factory, type | FunctionType) and has_file(factory.__module__)
        if not in_file:
            own = getattr(factory, "fingerprint", None) or fingerprint(factory)
            digests[name] = hashlib.sha256(f"{digests.get(name)}\n{own}".encode()).hexdigest()
    return digests


def _text(module: str) -> bytes:
    file = getattr(sys.modules.get(module), "__file__", None)
    if file is None or not has_file(module):
        raise ValueError(f"{module} is not in a file, so its source could not be compared later")
    return Path(file).read_bytes()


def _top(module: str) -> str:
    return module.partition(".")[0]


@cache
def _package(top: str) -> tuple[str, str]:
    """Return the name and the version of the installed package that contains a top-level module."""
    names = packages_distributions().get(top, ["roletrust-env"] if top in _OWN else [])
    return (names[0], version(names[0])) if names else ("", "")
