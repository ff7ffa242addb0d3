"""A table of named things (trust models, scenarios, attackers) that other packages can add to."""

import inspect
import warnings
from collections.abc import Callable, Mapping
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from typing import Any, Generic, TypeVar

from pydantic import ValidationError

from roletrust_env.errors import explain, suggest
from roletrust_env.parameters import UnknownParameterError, unknown_parameter

Thing = TypeVar("Thing")


class Registry(Generic[Thing]):
    """Names and the factories that make the things they name.

    A name is looked up in the table and then among the entry points that installed packages declare under `group`. A
    package with many things may instead name a module in the group `roletrust_env.plugins`: the module is imported
    before the first look-up in any registry, and registers them. An entry point is loaded only when its name is asked
    for, so a broken package harms nobody else. A registered or installed factory may be a function, and what it makes
    is checked. A class that is named by hand is checked before anything of it is called, see `own`.

    Args:
        kind: what the things are called in error messages, for example `"trust model"`.
        group: the entry-point group, for example `"roletrust_env.trust_models"`.
        base: the class or the runtime-checkable protocol of the things.
    """

    def __init__(self, kind: str, group: str, base: type[Any]) -> None:
        self.kind = kind
        self.group = group
        self.base = base
        self._factories: dict[str, Callable[..., Thing]] = {}

    def register(self, name: str, factory: Callable[..., Thing]) -> None:
        """Add a factory under a new name.

        Raises:
            ValueError: the name is taken, or is not a word of letters, digits, `-`, `_` and `.`.
        """
        if not name or not all(c.isalnum() or c in "-_." for c in name):
            raise ValueError(f"{name!r} is no name for a {self.kind}; use letters, digits, '-', '_' and '.'")
        if name in self._factories:
            raise ValueError(f"{self.kind} {name!r} is registered already")
        self._factories[name] = factory

    def unregister(self, name: str) -> None:
        """Remove a factory that was registered under a name."""
        del self._factories[name]

    def __contains__(self, name: str) -> bool:
        """Whether a name is known; what is installed is looked through only for those not registered here."""
        load_plugins()
        return name in self._factories or name in self._plugins()

    def names(self) -> list[str]:
        """All known names: those registered here, then those that installed packages bring."""
        load_plugins()
        return list(dict.fromkeys([*self._factories, *self._plugins()]))

    def factory(self, name: str) -> Callable[..., Thing]:
        """The factory of one name.

        Raises:
            ValueError: nobody knows the name (the message lists the known ones), or its plug-in cannot be loaded.
        """
        load_plugins()
        if name in self._factories:
            return self._factories[name]
        plugins = self._plugins()
        if name not in plugins:
            raise ValueError(f"unknown {self.kind} {name!r}{suggest(name, self.names())}")
        try:
            factory = plugins[name].load()
        except (Exception, SystemExit) as error:  # whatever a foreign package raises on import
            raise ValueError(f"{self.kind} {name!r} comes from {_trouble(plugins[name], error)}") from error
        if not callable(factory):
            raise ValueError(f"{self.kind} {name!r} comes from {plugins[name].value!r}, which cannot be called")
        made: Callable[..., Thing] = factory
        return made

    def own(self, module: str, name: str) -> "Registry[Thing]":
        """A registry of one class, named by hand by the module that has it.

        Importing the module runs what stands in it. Nothing in it is called here.

        Raises:
            ValueError: it cannot be loaded, or is not a class of the things of this registry.
        """
        text = f"{module}:{name}"
        try:
            found = EntryPoint(name, text, self.group).load()
        except (Exception, SystemExit) as error:  # whatever a foreign module raises on import
            raise ValueError(f"{self.kind} {text!r} cannot be loaded: {_said(error)}") from error
        if lacking := _lacking(found, self.base):
            raise ValueError(f"{self.kind} {text!r} must make a {self.base.__name__}, so it must be a class {lacking}")
        own: Registry[Thing] = Registry(self.kind, self.group, self.base)
        own.register(name, found)
        return own

    def taken(self, name: str, offered: Mapping[str, Any]) -> dict[str, Any]:
        """Of some parameters that are offered, those that the factory of that name takes.

        Raises:
            ValueError: the name is unknown.
        """
        known = inspect.signature(self.factory(name)).parameters
        everything = any(parameter.kind is parameter.VAR_KEYWORD for parameter in known.values())
        return {key: value for key, value in offered.items() if everything or key in known}

    def make(self, name: str, **parameters: Any) -> Thing:
        """Make the thing of that name, with these parameters.

        Raises:
            ValueError: the name is unknown, the thing does not take these parameters, or what its factory makes is
                something else.
        """
        factory = self.factory(name)
        signature = inspect.signature(factory)
        taken = self.taken(name, parameters)
        for parameter in parameters:
            if parameter not in taken:
                raise ValueError(unknown_parameter(f"{self.kind} {name!r}", parameter, signature.parameters))
        try:
            signature.bind(**parameters)
        except TypeError as error:
            raise ValueError(f"{self.kind} {name!r}: {error}; it takes {', '.join(signature.parameters)}") from None
        try:
            made = factory(**parameters)
        except UnknownParameterError as error:  # of a factory that passes on all that it is given
            raise ValueError(f"{self.kind} {name!r}: {error}") from None
        except ValidationError as error:
            raise ValueError(f"{self.kind} {name!r}: {explain(error)}") from None
        if isinstance(made, type) or not isinstance(made, self.base):
            raise ValueError(f"{self.kind} {name!r} made {made!r}; it must make a {self.base.__name__}")
        return made

    def describe(self) -> dict[str, str]:
        """Each name with the first line of its factory's docstring; a plug-in not yet loaded says whence it comes."""
        load_plugins()
        described = {name: summary(factory) for name, factory in self._factories.items()}
        for name, plugin in self._plugins().items():
            described.setdefault(name, f"from {plugin.module}:{plugin.attr}")
        return described

    def _plugins(self) -> dict[str, EntryPoint]:
        return {plugin.name: plugin for plugin in entry_points(group=self.group)}


@cache
def load_plugins() -> None:
    """Import the modules of the entry-point group `roletrust_env.plugins`; a broken one is a warning."""
    for plugin in entry_points(group="roletrust_env.plugins"):
        try:
            plugin.load()
        except (Exception, SystemExit) as error:  # whatever a foreign package raises on import
            warnings.warn(f"plug-in {plugin.name!r} comes from {_trouble(plugin, error)}", stacklevel=2)


def summary(factory: Any) -> str:
    """The first line of a factory's docstring; empty without one."""
    return (inspect.getdoc(factory) or "").partition("\n")[0]


def _trouble(plugin: EntryPoint, error: BaseException) -> str:
    """Why a plug-in cannot be loaded, and what to install where it says so, as in `package.module:name [extra]`."""
    whence = plugin.value.partition(" ")[0]
    if isinstance(error, ModuleNotFoundError) and plugin.extras and plugin.dist:
        wanted = f"{plugin.dist.name}[{','.join(plugin.extras)}]"
        return f"{whence!r}, which needs {error.name}: pip install {wanted!r}"
    return f"{whence!r}, which cannot be loaded: {error!r}"


def _said(error: BaseException) -> str:
    """What an import came to, in words; a script that is no module may end Python, and says nothing of it."""
    return "importing it ends Python" if isinstance(error, SystemExit) else str(error) or type(error).__name__


def _lacking(found: Any, base: type[Any]) -> str:
    """What something lacks to be a class of such things, in words; empty if nothing."""
    kind = found if isinstance(found, type) else object
    if not getattr(base, "_is_protocol", False):
        return "" if issubclass(kind, base) else f"derived from {base.__name__}"
    # Of a protocol's attributes an instance may have what its class has not, so its methods alone count here.
    methods = [name for name, part in vars(base).items() if inspect.isfunction(part) and name[0] != "_"]
    fits = all(callable(getattr(kind, name, None)) for name in methods)
    return "" if fits else f"with the method{'s' * (len(methods) > 1)} {', '.join(methods)}"
