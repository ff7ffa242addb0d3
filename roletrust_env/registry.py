"""A table of named things (trust models, scenarios, attackers) that other packages can add to."""

import inspect
from collections.abc import Callable
from difflib import get_close_matches
from importlib.metadata import EntryPoint, entry_points
from typing import Any, Generic, TypeVar

from pydantic import ValidationError

from roletrust_env.errors import explain

Thing = TypeVar("Thing")


class Registry(Generic[Thing]):
    """Names and the factories that make the things they name.

    A name is found in the table itself or, failing that, among the entry points that installed packages declare under
    `group`. An entry point is loaded only when its name is asked for, so a broken package harms nobody else.

    Args:
        kind: what the things are called in error messages, for example `"trust model"`.
        group: the entry-point group, for example `"roletrust_env.trust_models"`.
    """

    def __init__(self, kind: str, group: str) -> None:
        self.kind = kind
        self.group = group
        self._factories: dict[str, Callable[..., Thing]] = {}

    def register(self, name: str, factory: Callable[..., Thing]) -> None:
        """Add a factory under a new name.

        Raises:
            ValueError: the name is taken, or is not a word of letters, digits, `-`, `_` and `.`.
        """
        if not name or not all(c.isalnum() or c in "-_." for c in name):
            raise ValueError(f"{name!r} is no name for a {self.kind}; use letters, digits, '-', '_' and '.'")
        if name in self._factories:
            raise ValueError(f"a {self.kind} named {name!r} is registered already")
        self._factories[name] = factory

    def names(self) -> list[str]:
        """All known names: those registered here, then those that installed packages bring."""
        return list(dict.fromkeys([*self._factories, *self._plugins()]))

    def factory(self, name: str) -> Callable[..., Thing]:
        """The factory of one name.

        Raises:
            ValueError: nobody knows the name (the message lists the known ones), or its plug-in cannot be loaded.
        """
        if name in self._factories:
            return self._factories[name]
        plugins = self._plugins()
        if name not in plugins:
            near = get_close_matches(str(name), self.names(), 1)
            hint = f"; did you mean {near[0]!r}?" if near else "."
            raise ValueError(f"unknown {self.kind} {name!r}{hint} Known: {', '.join(self.names())}")
        try:
            factory = plugins[name].load()
        except Exception as error:  # whatever a foreign package raises on import
            raise ValueError(
                f"{self.kind} {name!r} comes from {plugins[name].value!r}, which cannot be loaded: {error!r}"
            ) from error
        if not callable(factory):
            raise ValueError(f"{self.kind} {name!r} comes from {plugins[name].value!r}, which cannot be called")
        made: Callable[..., Thing] = factory
        return made

    def make(self, name: str, **parameters: Any) -> Thing:
        """Make the thing of that name, with these parameters.

        Raises:
            ValueError: the name is unknown, or the thing does not take these parameters.
        """
        factory = self.factory(name)
        signature = inspect.signature(factory)
        try:
            signature.bind(**parameters)
        except TypeError as error:
            raise ValueError(f"{self.kind} {name!r}: {error}; it takes {', '.join(signature.parameters)}") from None
        try:
            return factory(**parameters)
        except ValidationError as error:
            raise ValueError(f"{self.kind} {name!r}: {explain(error)}") from None

    def describe(self) -> dict[str, str]:
        """Each name with the first line of its factory's docstring; a plug-in not yet loaded says whence it comes."""
        described = {name: (inspect.getdoc(f) or "").partition("\n")[0] for name, f in self._factories.items()}
        for name, plugin in self._plugins().items():
            described.setdefault(name, f"from {plugin.value}")
        return described

    def _plugins(self) -> dict[str, EntryPoint]:
        return {plugin.name: plugin for plugin in entry_points(group=self.group)}
