"""Tables of named things: registered here, or brought by installed packages."""

from collections.abc import Callable
from importlib.metadata import entry_points

import pytest
from refusals import refuses

from roletrust_baselines import OnOff
from roletrust_env import (
    Scenario,
    attackers,
    make_attacker,
    make_scenario,
    register_attacker,
    register_scenario,
    scenarios,
)
from roletrust_env.registry import Registry, load_plugins


def box(size: int = 1) -> tuple[str, int]:
    """A box.

    More than one line.
    """
    return "box", size


class Crate(tuple):
    def __new__(cls, items: tuple[int, ...] = ()) -> "Crate":
        return super().__new__(cls, items)


@pytest.fixture
def registry() -> Registry:
    registry: Registry = Registry("thing", "roletrust_env.tests.things", tuple)
    registry.register("box", box)
    return registry


def test_a_thing_is_made_by_name(registry: Registry) -> None:
    assert registry.make("box", size=3) == ("box", 3)
    assert registry.names() == ["box"]
    assert registry.describe() == {"box": "A box."}


@pytest.mark.parametrize("name", ["", "two words", "a/b", "box\n", "a,b"])
def test_a_name_is_a_word(registry: Registry, name: str) -> None:
    with refuses(ValueError, repr(name)):
        registry.register(name, box)


def test_a_name_is_given_once(registry: Registry) -> None:
    with refuses(ValueError, "box"):
        registry.register("box", lambda: None)
    assert registry.make("box") == ("box", 1)


@pytest.mark.parametrize("name", ["bax", "zebra"])
def test_an_unknown_name_is_answered_with_the_known_ones(registry: Registry, name: str) -> None:
    with refuses(ValueError, name, "box"):
        registry.make(name)


def test_unknown_parameters_are_answered_with_the_known_ones(registry: Registry) -> None:
    with refuses(ValueError, "box", "weight"):
        registry.make("box", weight=3)


def test_what_a_plug_in_brings_is_found_last(registry: Registry, install: Callable) -> None:
    install("crate", registry.group, "def made(size=1): return 'crate', size")
    assert registry.names() == ["box", "crate"]
    assert registry.describe()["crate"] == "from crate:made"
    assert registry.make("crate", size=2) == ("crate", 2)
    with refuses(ValueError, "crat", "crate"):
        registry.make("crat")


def test_a_plug_in_does_not_shadow_what_is_registered(
    registry: Registry, install: Callable
) -> None:
    install("box", registry.group, "raise RuntimeError")
    assert registry.make("box") == ("box", 1)


@pytest.mark.parametrize(
    "code", ["raise RuntimeError('half installed')", "raise SystemExit", "made = 3"]
)
def test_a_broken_plug_in_harms_only_who_asks_for_it(
    registry: Registry, install: Callable, code: str
) -> None:
    install("shattered", registry.group, code)
    assert registry.make("box") == ("box", 1)
    assert "shattered" in registry.describe()
    with refuses(ValueError, "shattered"):
        registry.make("shattered")


@pytest.mark.parametrize("code", ["def made(): return 3", "made = tuple[int]", "class made: pass"])
def test_what_a_plug_in_makes_is_looked_at(
    registry: Registry, install: Callable, code: str
) -> None:
    install("changeling", registry.group, code)
    with refuses(ValueError, "changeling"):
        registry.make("changeling")


def test_a_plug_in_may_say_which_extra_brings_what_it_lacks(
    registry: Registry, install: Callable
) -> None:
    install("hungry", registry.group, "import no_such_food")
    install("frugal", registry.group, "import no_such_food", "frugal = frugal:made [food,drink]")
    with refuses(ValueError, "hungry:made", "no_such_food"):
        registry.make("hungry")
    with refuses(ValueError, "no_such_food", "frugal[food,drink]"):
        registry.make("frugal")


def test_plug_ins_are_imported_once_though_one_of_them_looks_names_up(
    install: Callable, monkeypatch: pytest.MonkeyPatch
) -> None:
    asking = "from roletrust_env.trust.model import registry\nmade = registry.names()\n"
    install("broken_module", "roletrust_env.plugins", "raise RuntimeError('broken')")
    install("asking_module", "roletrust_env.plugins", asking)
    ours = [
        one for one in entry_points(group="roletrust_env.plugins") if one.name.endswith("_module")
    ]
    monkeypatch.setattr("roletrust_env.registry.entry_points", lambda group: ours)
    load_plugins.cache_clear()
    with pytest.warns(UserWarning, match="plug-in") as caught:
        load_plugins()
    assert [str(one.message).split()[1] for one in caught] == ["'broken_module'"]


def test_a_class_named_by_hand_is_one_of_the_kind(registry: Registry) -> None:
    own = registry.for_class(__name__, "Crate")
    assert own.make("Crate", items=(1, 2)) == (1, 2)
    for name in ("box", "OnOff", "Registry"):
        with refuses(ValueError, name):
            registry.for_class(__name__, name)


def test_a_script_that_ends_python_does_not_end_the_command(
    registry: Registry, install: Callable
) -> None:
    install("script", "nobody", "import sys\nsys.exit(0)")
    with refuses(ValueError, "script:made"):
        registry.for_class("script", "made")


def test_a_scenario_from_user_code_is_known_by_name() -> None:
    mine = make_scenario("paper-3x3").change(name="mine", description="My own.")
    register_scenario(mine)
    assert make_scenario("mine") is mine
    assert scenarios()["mine"] == "My own."
    with refuses(ValueError, "mine"):
        register_scenario(mine)


def test_scenarios_of_installed_packages(install: Callable) -> None:
    code = (
        "from roletrust_env import make_scenario\ndef made(): return "
        "make_scenario('peers').change(max_cycles=3)"
    )
    install("faraway", "roletrust_env.scenarios", code)
    assert make_scenario("faraway").max_cycles == 3
    assert {"faraway", "paper-3x3"} <= set(scenarios())


def test_a_broken_scenario_plug_in_harms_only_who_asks_for_it(install: Callable) -> None:
    install("brokenscenario", "roletrust_env.scenarios", "raise RuntimeError('half installed')")
    assert "paper-3x3" in scenarios()
    with refuses(ValueError, "brokenscenario", "brokenscenario:made"):
        make_scenario("brokenscenario")


def test_attackers_are_known_by_name() -> None:
    register_attacker("my-own", OnOff)
    assert {"on-off", "bad-mouthing", "my-own"} <= set(attackers())
    assert attackers()["on-off"].startswith("On-off attack")
    assert make_attacker("my-own", period=4) == OnOff(period=4)
    with refuses(ValueError, "onoff", "on-off"):
        make_attacker("onoff")
    with refuses(ValueError, "on-off", "perod"):
        make_attacker("on-off", perod=4)


@pytest.mark.parametrize("name", scenarios())
def test_presets_are_described(name: str) -> None:
    scenario = make_scenario(name)
    assert isinstance(scenario, Scenario)
    assert scenario.name == name
    assert scenario.description
    assert scenario.tags
