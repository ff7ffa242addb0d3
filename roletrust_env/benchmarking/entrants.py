"""Trust model objects in a benchmark. Each gets a name in this process and in the worker
processes.
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cache, partial
from typing import Any, cast

import cloudpickle

from roletrust_env.benchmarking.sources import fingerprint
from roletrust_env.trust import TrustModel
from roletrust_env.trust.model import registry as trust_models

Entrant = str | type[Any] | TrustModel[Any]
"""Trust model: a spec such as `"role-trust:lam=0.7"`, a class, or an instance."""


def name_entrants(models: Sequence[Entrant]) -> tuple[tuple[str, ...], dict[str, TrustModel[Any]]]:
    """Return the names of trust models in a suite, and the instances by name.

    A spec is its own name. Every other model is named by its class; a second one of the class gets
    a number.

    Raises:
        ValueError: An object is not a trust model, or its class needs parameters.
    """
    names: list[str] = []
    instances: dict[str, TrustModel[Any]] = {}
    for model in models:
        if isinstance(model, str):
            names.append(model)
            continue
        instance = _instance(model)
        used = {*names, *trust_models.names()}
        kind = type(instance).__name__
        name = next(
            candidate
            for k in range(1, len(models) + 2)
            if (candidate := kind if k == 1 else f"{kind}-{k}") not in used
        )
        names.append(name)
        instances[name] = instance
    return tuple(dict.fromkeys(names)), instances


@contextmanager
def temporary_registration(instances: Mapping[str, TrustModel[Any]]) -> Iterator[None]:
    """Register trust models under their names until the context ends."""
    known: list[str] = []
    try:
        for name, model in instances.items():
            trust_models.register(name, _factory(model))
            known.append(name)
        yield
    finally:
        for name in known:
            trust_models.unregister(name)


def pack(instances: Mapping[str, TrustModel[Any]]) -> bytes:
    """Serialise trust models for another process. Classes from a notebook or a script are included.

    Raises:
        ValueError: One of them cannot be sent to another process.
    """
    packed = {}
    for name, model in instances.items():
        try:
            packed[name] = cloudpickle.dumps(model)
        except Exception as error:  # a class of another package may raise anything
            raise ValueError(
                f"trust model {name} cannot be sent to another process ({type(error).__name__}: "
                f"{error}); "
                "with workers=0 it plays in this one"
            ) from error
    return cloudpickle.dumps(packed) if packed else b""


@cache
def register_packed(packed: bytes) -> None:
    """Register the serialised trust models in a worker process."""
    if packed:
        for name, model in cloudpickle.loads(packed).items():
            trust_models.register(name, _unpacking(model))


def _unpacking(packed: bytes) -> Any:
    """Return a factory that loads a model when it is played, so that one that fails to load affects
    no other.
    """

    @cache
    def load() -> Any:
        return cloudpickle.loads(packed)

    return load


def _factory(model: TrustModel[Any]) -> Any:
    """Return a factory that states the source of the model's class, see
    `roletrust_env.benchmarking.sources`.
    """
    kind, factory = type(model), cast(Any, partial(_same, model))
    factory.kind, factory.fingerprint = kind, fingerprint(model)
    factory.__module__, factory.__qualname__, factory.__doc__ = (
        kind.__module__,
        kind.__qualname__,
        kind.__doc__,
    )
    return factory


def _same(model: TrustModel[Any]) -> TrustModel[Any]:
    return model


def _instance(model: Any) -> TrustModel[Any]:
    if isinstance(model, type):
        try:
            model = model()
        except TypeError as error:
            raise ValueError(
                f"{model.__name__} needs parameters ({error}); give an instance of it"
            ) from None
        except (Exception, SystemExit) as error:  # a class of another package may raise anything
            raise ValueError(
                f"{model.__name__} cannot be made ({type(error).__name__}: {error})"
            ) from error
    if not isinstance(model, TrustModel):
        raise ValueError(
            f"{model!r} is not a trust model: give an instance, a class, or a name such as "
            "'role-trust'"
        )
    return model
