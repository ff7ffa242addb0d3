"""Registry of named objects (trust models, scenarios, attackers) that other packages can add to."""

import inspect
import warnings
from collections.abc import Callable, Mapping
from dataclasses import fields
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from threading import get_ident
from typing import Any, Generic, TypeVar, cast

from pydantic import ValidationError

from roletrust_env.errors import short, suggest, validation_message
from roletrust_env.parameters import UnknownParameterError, unknown_parameter

T = TypeVar("T")


class Registry(Generic[T]):
    """Names, and the factory of the object that each of them stands for.

    A name is looked up among the registered factories, and then among the entry points that
    installed packages declare under `group`. A package with many objects can instead declare a
    module in the group `roletrust_env.plugins`. That module is imported before the first look-up in
    any registry of a name that is not registered, and registers the objects.

    An entry point is loaded only when its name is looked up, so a broken package affects only its
    own names. A registered or installed factory can be a function; the objects that it makes are
    checked. A class given by module and name is checked before it is called, see `for_class`.

    Args:
        kind: Name of such objects in error messages, for example `"trust model"`.
        group: Entry-point group, for example `"roletrust_env.trust_models"`.
        base: Class or runtime-checkable protocol of the objects.
    """

    def __init__(self, kind: str, group: str, base: type[Any]) -> None:
        self.kind = kind
        self.group = group
        self.base = base
        self._factories: dict[str, Callable[..., T]] = {}

    def register(self, name: str, factory: Callable[..., T]) -> None:
        """Add a factory under a new name.

        Args:
            name: New name.
            factory: Function of the parameters that makes an object, usually its class.

        Raises:
            ValueError: The name is taken, or is not a word of letters, digits, `-`, `_` and `.`;
                or the factory cannot be called.
        """
        if (
            not isinstance(name, str)
            or not name
            or not all(c.isalnum() or c in "-_." for c in name)
        ):
            raise ValueError(
                f"{name!r} is not a valid name of a {self.kind}; use letters, digits, '-', '_' and "
                "'.'"
            )
        if name in self._factories:
            raise ValueError(f"{self.kind} {name!r} is already registered")
        if not callable(factory):
            raise ValueError(
                f"the factory of {self.kind} {name!r} must be a class or a function, "
                f"got {short(repr(factory))}"
            )
        self._factories[name] = factory

    def unregister(self, name: str) -> None:
        """Remove a factory that was registered under a name."""
        del self._factories[name]

    def __contains__(self, name: str) -> bool:
        """Return whether a name is known. Installed packages are searched only if it is not
        registered here.
        """
        return self.registered(name) is not None or name in self._plugins()

    def registered(self, name: str) -> Callable[..., T] | None:
        """Return the factory that is registered under a name here, or None. Entry points of the
        group do not count.
        """
        if name not in self._factories:
            load_plugins()
        return self._factories.get(name)

    def names(self) -> list[str]:
        """Return all known names: first those registered here, then those of installed packages."""
        load_plugins()
        return list(dict.fromkeys([*self._factories, *self._plugins()]))

    def factory(self, name: str) -> Callable[..., T]:
        """Return the factory of a name.

        Raises:
            ValueError: The name is unknown (the message lists the known names), or its plug-in
                cannot be loaded.
        """
        if not isinstance(name, str):
            raise ValueError(f"the name of a {self.kind} must be a text, got {short(repr(name))}")
        if registered := self.registered(name):
            return registered
        plugins = self._plugins()
        if name not in plugins:
            raise ValueError(
                f"unknown {self.kind} {short(repr(name))}{suggest(name, self.names())}"
            )
        try:
            factory = plugins[name].load()
        except (Exception, SystemExit) as error:  # a foreign package can raise anything on import
            raise ValueError(
                f"{self.kind} {name!r} comes from {_describe_failure(plugins[name], error)}"
            ) from error
        if not callable(factory):
            raise ValueError(
                f"{self.kind} {name!r} comes from {plugins[name].value!r}, which cannot be called"
            )
        loaded: Callable[..., T] = factory
        return loaded

    def for_class(self, module: str, name: str) -> "Registry[T]":
        """Return a registry with a single class, given by its module and its name.

        The module is imported, which executes its code. The class is not called.

        Raises:
            ValueError: The class cannot be loaded, or its objects do not belong into this registry.
        """
        text = f"{module}:{name}"
        try:
            cls = EntryPoint(name, text, self.group).load()
        except (Exception, SystemExit) as error:  # a foreign module can raise anything on import
            raise ValueError(
                f"{self.kind} {text!r} cannot be loaded: {_describe_import_error(error)}"
            ) from error
        if requirement := _unmet_requirement(cls, self.base):
            raise ValueError(
                f"{self.kind} {text!r} must make a {self.base.__name__}, so it must be a class "
                f"{requirement}"
            )
        return self.with_only(name, cls)

    def with_only(self, name: str, factory: Callable[..., T]) -> "Registry[T]":
        """Return a registry of the same kind with a single factory, registered under a name."""
        single: Registry[T] = Registry(self.kind, self.group, self.base)
        single.register(name, factory)
        return single

    def accepted_parameters(self, name: str, offered: Mapping[str, Any]) -> dict[str, Any]:
        """Return those of the offered parameters that the factory of a name accepts.

        Raises:
            ValueError: The name is unknown.
        """
        known = inspect.signature(self.factory(name)).parameters
        accepts_all = any(parameter.kind is parameter.VAR_KEYWORD for parameter in known.values())
        return {key: value for key, value in offered.items() if accepts_all or key in known}

    def make(self, name: str, /, **parameters: Any) -> T:
        """Make the object of a name, with these parameters.

        Raises:
            ValueError: The name is unknown, the factory does not accept these parameters, or it
                makes an object that does not belong into this registry.
        """
        factory = self.factory(name)
        signature = inspect.signature(factory)
        accepted = self.accepted_parameters(name, parameters)
        for parameter in parameters:
            if parameter not in accepted:
                raise ValueError(
                    unknown_parameter(f"{self.kind} {name!r}", parameter, signature.parameters)
                )
        try:
            signature.bind(**parameters)
        except TypeError as error:
            raise ValueError(
                f"{self.kind} {name!r}: {error}; it takes {', '.join(signature.parameters)}"
            ) from None
        try:
            made = factory(**parameters)
        except UnknownParameterError as error:  # the factory passed an unknown parameter on
            raise ValueError(f"{self.kind} {name!r}: {error}") from None
        except ValidationError as error:
            raise ValueError(f"{self.kind} {name!r}: {validation_message(error)}") from None
        if isinstance(made, type) or not isinstance(made, self.base):
            raise ValueError(
                f"{self.kind} {name!r} made {made!r}; it must make a {self.base.__name__}"
            )
        return made

    def described(self, made: T) -> dict[str, Any]:
        """Return the registered name of an object, as `name`, and its parameters, see `read`.

        Raises:
            ValueError: Its class is not registered, or it cannot be made again from its parameters.
        """
        name = next(
            (name for name, factory in self._factories.items() if factory is type(made)), None
        )
        own = [field.name for field in fields(cast(Any, made)) if field.init] if name else []
        given = {key: getattr(made, key) for key in own}
        parameters = {
            key: self.described(argument) if isinstance(argument, self.base) else argument
            for key, argument in given.items()
        }
        if name is None or self.read({"name": name, **parameters}) != made:
            raise ValueError(
                f"{made!r} is no {self.kind} that is registered with a name and parameters"
            )
        return {"name": name, **parameters}

    def read(self, table: Mapping[str, Any]) -> T:
        """Return the object of a table of its name and its parameters, which may be tables, too.

        Raises:
            ValueError: See `make`; or there is no name.
        """
        if not isinstance(name := table.get("name"), str):
            raise ValueError(f"{dict(table)} has no name of a {self.kind}")
        parameters = {key: argument for key, argument in table.items() if key != "name"}
        return self.make(
            name,
            **{
                k: self.read(argument) if isinstance(argument, Mapping) else argument
                for k, argument in parameters.items()
            },
        )

    def describe(self) -> dict[str, str]:
        """Return the summary of each name: the first line of its docstring, or the source of an
        unloaded plug-in.
        """
        load_plugins()
        described = {name: summary(factory) for name, factory in self._factories.items()}
        for name, plugin in self._plugins().items():
            described.setdefault(name, f"from {plugin.module}:{plugin.attr}")
        return described

    def _plugins(self) -> dict[str, EntryPoint]:
        return {plugin.name: plugin for plugin in entry_points(group=self.group)}


_LOADING: set[int] = set()
"""Threads that import plug-ins."""


@cache
def load_plugins() -> None:
    """Import the modules of the entry-point group `roletrust_env.plugins`; a broken one is a
    warning.
    """
    if get_ident() in _LOADING:  # a plug-in looks a name up while it is imported
        return
    _LOADING.add(get_ident())
    try:
        _import_plugins()
    finally:
        _LOADING.discard(get_ident())


def _import_plugins() -> None:
    for plugin in entry_points(group="roletrust_env.plugins"):
        try:
            plugin.load()
        except (Exception, SystemExit) as error:  # a foreign package can raise anything on import
            warnings.warn(
                f"plug-in {plugin.name!r} comes from {_describe_failure(plugin, error)}",
                stacklevel=3,
            )


def summary(factory: Any) -> str:
    """Return the first line of the docstring of a factory; empty without a docstring."""
    return (inspect.getdoc(factory) or "").partition("\n")[0]


def _describe_failure(plugin: EntryPoint, error: BaseException) -> str:
    """Return why a plug-in cannot be loaded, and the extra to install if the entry point declares
    one.
    """
    target = plugin.value.partition(" ")[0]
    if isinstance(error, ModuleNotFoundError) and plugin.extras and plugin.dist:
        requirement = f"{plugin.dist.name}[{','.join(plugin.extras)}]"
        return f"{target!r}, which needs {error.name}: pip install {requirement!r}"
    return f"{target!r}, which cannot be loaded: {error!r}"


def _describe_import_error(error: BaseException) -> str:
    """Return the reason in words. A script without an import guard can exit, and then has no
    message.
    """
    return (
        "importing it ends Python"
        if isinstance(error, SystemExit)
        else str(error) or type(error).__name__
    )


def _unmet_requirement(candidate: Any, base: type[Any]) -> str:
    """Return what a class must have to belong to a base class or protocol, in words; empty if it
    has it.
    """
    cls = candidate if isinstance(candidate, type) else object
    if not getattr(base, "_is_protocol", False):
        return "" if issubclass(cls, base) else f"derived from {base.__name__}"
    # An instance can have attributes of the protocol that its class does not have, so only methods
    # are checked.
    methods = [
        name for name, part in vars(base).items() if inspect.isfunction(part) and name[0] != "_"
    ]
    fits = all(callable(getattr(cls, name, None)) for name in methods)
    return "" if fits else f"with the method{'s' * (len(methods) > 1)} {', '.join(methods)}"
