"""Registry of named objects (trust models, scenarios, attackers), and the texts that name them.

Other packages can add to it. Texts are `NAME:key=value,...` or
`package.module:Class:key=value,...`.
"""

import inspect
import os
import re
import sys
import tomllib
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from threading import get_ident
from typing import Any, Generic, TypeVar, cast

from pydantic import ValidationError

from roletrust_env.errors import short, suggest, validation_message
from roletrust_env.parameters import UnknownParameterError, unknown_parameter

T = TypeVar("T")

# A comma that no bracket, brace or quote encloses; values are not nested deeper than TOML's inline
# tables need.
_COMMA = re.compile(r""",(?=(?:[^\[\]{}"']|\[[^\]]*\]|\{[^}]*\}|"[^"]*"|'[^']*')*$)""")


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
    """Return the first paragraph of the docstring of a factory as one line; empty without a
    docstring.
    """
    return " ".join((inspect.getdoc(factory) or "").partition("\n\n")[0].split())


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


def parse_value(text: str) -> Any:
    """Return a value as TOML has it (`3`, `0.5`, `true`, `[0, 1]`, `{kind = "choice"}`), or else
    the text itself.

    Example:
        >>> parse_value("0.5"), parse_value("[0, 1]"), parse_value("random")
        (0.5, (0, 1), 'random')
    """
    try:
        data = tomllib.loads(f"value = {text}")
    except (tomllib.TOMLDecodeError, RecursionError):
        return text
    return _frozen(data["value"]) if len(data) == 1 else text


def parse_settings(settings: Sequence[str], option: str = "--set") -> dict[str, Any]:
    """Return the fields of texts of the form `field=value`.

    Args:
        settings: Texts.
        option: Name of their option in error messages.

    Raises:
        ValueError: A text has another form, or a field occurs twice.
    """
    parsed: dict[str, Any] = {}
    for setting in settings:
        field, equals, value = setting.partition("=")
        field = field.strip()
        if not equals or not field:
            raise ValueError(f"{option} has {setting!r}; it must be of the form field=value")
        if field in parsed:
            raise ValueError(f"{option} sets {field!r} twice")
        parsed[field] = parse_value(value.strip())
    return parsed


def parse_parameters(text: str) -> tuple[str, dict[str, Any]]:
    """Return the name and the parameters of `NAME[:key=value,...]`.

    Raises:
        ValueError: A parameter is not of the form key=value, or is given twice.

    Example:
        >>> parse_parameters("on-off:start=10,targets=[0, 1]")
        ('on-off', {'start': 10, 'targets': (0, 1)})
    """
    name, _, rest = text.strip().partition(":")
    return name, _parameters(rest, text)


def parse_entry(registry: Registry[Any], text: str) -> tuple[Registry[Any], str, dict[str, Any]]:
    """Return the registry, the name there and the parameters of an entry that a text names.

    Args:
        registry: Registry of the name.
        text: Text `NAME[:key=value,...]` or `package.module:Class[:key=value,...]`; the module may
            lie in the current folder.

    Raises:
        ValueError: The name is unknown, or it names something of another kind.
    """
    name, _, rest = text.strip().partition(":")
    owner, _, after = rest.partition(":")
    if name not in registry:
        if not name or not owner.strip().isidentifier():
            explain_unknown(registry, name)
        if os.getcwd() not in sys.path:
            sys.path.append(os.getcwd())
        registry, name, rest = registry.for_class(name, owner.strip()), owner.strip(), after
    return registry, name, _parameters(rest, text)


def make_entry(registry: Registry[T], name: str, parameters: Mapping[str, Any], text: str) -> T:
    """Return the object that `parse_entry` found by a text. See `Registry.make`.

    Raises:
        ValueError: It cannot be made. The message has the text.
    """
    try:
        return registry.make(name, **parameters)
    except (
        TypeError
    ) as error:  # a value of the wrong type, which the maker compared or computed with
        raise ValueError(f"{text!r}: a value is of the wrong type ({error})") from None
    except (
        LookupError,
        ArithmeticError,
        AttributeError,
        RuntimeError,
    ) as error:  # of a class that others wrote
        raise ValueError(f"{text!r} cannot be made: {type(error).__name__}: {error}") from error


def explain_unknown(registry: Registry[Any], name: str) -> None:
    """Refuse an unknown name, and say how a class of another package is named.

    Raises:
        ValueError: The name is unknown.
    """
    try:
        registry.factory(name)
    except ValueError as error:
        raise ValueError(
            f"{error}. Your own is package.module:Class, or a name that an installed package "
            f"declares as an entry point in the group {registry.group!r}"
        ) from None


def _parameters(rest: str, text: str) -> dict[str, Any]:
    return parse_settings([part for part in _COMMA.split(rest) if part.strip()], option=repr(text))


def _frozen(value: Any) -> Any:
    """Return lists as tuples, so that a policy that holds them can be hashed."""
    if isinstance(value, list):
        return tuple(_frozen(item) for item in value)
    return {key: _frozen(item) for key, item in value.items()} if isinstance(value, dict) else value
