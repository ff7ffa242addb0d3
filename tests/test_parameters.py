"""Constructors that refuse what they do not know, and say what was probably meant."""

import dataclasses
import inspect
import pickle

import pydantic.dataclasses
import pytest
from refusals import refuses

from roletrust_env.game.policy import WindowedAttack
from roletrust_env.parameters import (
    Share,
    UnknownParameterError,
    checked_dataclass,
    refuse_unknown_parameters,
    unknown_parameter,
)
from roletrust_env.registry import Registry
from roletrust_env.trust import make_trust_model, trust_models
from roletrust_env.trust.model import registry
from roletrust_env.trust.models.central.role_trust import RoleTrust


@checked_dataclass
class Plain:
    level: Share = 0.5
    words: tuple[str, ...] = ()


@checked_dataclass(config=pydantic.ConfigDict(arbitrary_types_allowed=True))
class Holder:
    held: object = None


@checked_dataclass
class Heir(Holder):
    more: inspect.Signature | None = None


class Undecorated(Plain):
    pass


@pydantic.dataclasses.dataclass(frozen=True)
class Foreign(Plain):
    """A class of another package, which knows nothing of ours."""

    start: int = 0


@refuse_unknown_parameters
@dataclasses.dataclass
class Standard:
    budget: int
    hidden: int = dataclasses.field(default=0, init=False)


@pytest.mark.parametrize(
    ("name", "known", "message"),
    [
        (
            "lvl",
            ["level", "words"],
            "It has no parameter 'lvl'; did you mean 'level'? It takes level, words",
        ),
        ("zzz", ["level"], "It has no parameter 'zzz'. It takes level"),
        ("zzz", [], "It has no parameter 'zzz'. It takes none"),
    ],
)
def test_the_message_suggests_the_near_name(name: str, known: list[str], message: str) -> None:
    assert unknown_parameter("It", name, known) == message


@pytest.mark.parametrize("cls", [Plain, Undecorated])
def test_unknown_parameters_are_refused(cls: type[Plain]) -> None:
    assert cls(0.2).level == cls(level=0.2).level == 0.2
    with refuses(UnknownParameterError, "lvl", "level", cls.__name__):
        cls(lvl=0.2)  # type: ignore[call-arg]


def test_what_was_checked_is_checked_still() -> None:
    with refuses(pydantic.ValidationError, "level", "[0, 1]"):
        Plain(level=2.0)
    with refuses(pydantic.ValidationError, "Plain", "3"):
        Plain(0.2, ("a",), 3)  # type: ignore[call-arg]
    with pytest.raises(dataclasses.FrozenInstanceError):
        Plain().level = 0.1  # type: ignore[misc]


def test_it_is_a_dataclass_as_others_are() -> None:
    plain = Plain(level=0.2)
    assert dataclasses.replace(plain, level=0.3) == Plain(level=0.3)
    assert pickle.loads(pickle.dumps(plain)) == plain
    assert list(inspect.signature(Plain).parameters) == ["level", "words"]
    assert repr(plain) == "Plain(level=0.2, words=())"
    with pytest.raises(TypeError):
        dataclasses.replace(plain, lvl=0.3)  # type: ignore[call-arg]


def test_configuration_is_inherited() -> None:
    assert Heir(object(), more=inspect.signature(len)).more is not None
    with refuses(TypeError, "zzz", "held", "more"):
        Heir(zzz=1)  # type: ignore[call-arg]


def test_a_foreign_heir_refuses_too() -> None:
    assert Foreign(start=2).start == 2
    with refuses((TypeError, ValueError), "lvl"):
        Foreign(lvl=0.2)  # type: ignore[call-arg]


def test_an_attack_of_another_package_refuses_too() -> None:
    @pydantic.dataclasses.dataclass(frozen=True)
    class Lies(WindowedAttack):
        level: float = 0.5

    assert Lies(level=0.2, start=3).start == 3
    with refuses((TypeError, ValueError), "lvl"):
        Lies(lvl=0.2)  # type: ignore[call-arg]
    with refuses(TypeError, "strat", "start"):
        WindowedAttack(strat=3)  # type: ignore[call-arg]


def test_a_standard_dataclass_can_refuse() -> None:
    assert Standard(3) == Standard(budget=3)
    with refuses(TypeError, "budgte", "budget"):
        Standard(budgte=3)  # type: ignore[call-arg]
    with refuses(TypeError, "hidden"):
        Standard(budget=3, hidden=3)  # type: ignore[call-arg]
    with refuses(TypeError, "1", "budget"):
        Standard()  # type: ignore[call-arg]


# --- trust models ---------------------------------------------------------------------------------


def test_the_example_of_a_trust_model() -> None:
    with refuses(TypeError, "RoleTrust", "lamb", "lam", "initial"):
        RoleTrust(lamb=0.7)  # type: ignore[call-arg]


@pytest.mark.parametrize("name", [name for name in trust_models() if name != "doubt"])
def test_every_trust_model_refuses(name: str) -> None:
    cls = registry.factory(name)
    parameters = list(inspect.signature(cls).parameters)
    with refuses(TypeError, cls.__name__, "initail", *parameters):
        cls(initail=0.5)
    with refuses(ValueError, "initail", name):
        make_trust_model(name, initail=0.5)


def test_the_registry_suggests_in_one_line() -> None:
    with refuses(ValueError, "role-trust", "lamb", "lam", "initial"):
        make_trust_model("role-trust", lamb=0.7)


def test_a_factory_that_passes_everything_on_gives_one_line_too() -> None:
    things: Registry[Plain] = Registry("thing", "roletrust_env.tests.things", Plain)
    things.register("any", lambda **parameters: Plain(**parameters))
    assert things.make("any", level=0.1) == Plain(0.1)
    with refuses(ValueError, "any", "lvl", "level"):
        things.make("any", lvl=0.1)
