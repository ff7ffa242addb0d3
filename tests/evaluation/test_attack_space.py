"""What an attack declares on its fields is what searches see of it."""

from dataclasses import dataclass, field
from functools import partial
from typing import Annotated, ClassVar, Literal

from pydantic import PositiveInt
from pydantic.dataclasses import dataclass as checked
from refusals import refuses

from roletrust_baselines import BadMouthing, OnOff
from roletrust_env import Policy
from roletrust_env.evaluation.attackers import HONEST_POLICY
from roletrust_env.evaluation.scripts import Mixture, Space, as_spec
from roletrust_env.parameters import (
    Accomplices,
    NotSearched,
    SearchRange,
    Share,
    Victims,
)


@dataclass(frozen=True)
class Own(Policy):
    """An attack of somebody else's, of Python's own dataclasses."""

    attacks: ClassVar = frozenset({"quality"})

    delay: int = 7
    bad: Share = 0.1
    rounds: Annotated[int, SearchRange(2, 5)] = 2
    mood: Literal["sour", "sweet", "bitter"] = "sour"
    power: Annotated[float, SearchRange(-1, 3)] = 1.0
    quiet: Annotated[Share, NotSearched()] = 0.0
    places: Annotated[tuple[int, ...], Victims()] = (0,)
    ring: Annotated[tuple[int, ...], Accomplices()] = ()


def test_a_class_of_python_itself_is_searched_by_what_its_fields_declare():
    space = Space(Own, (1, 3, 4), (2,), 50)
    assert space.size == 5
    assert space.channels == {"quality"}
    assert space.decode([0.0] * 5) == Own(
        bad=0, rounds=2, mood="sour", power=-1, places=(1,), ring=(2,)
    )
    assert space.decode([0.25, 0.6, 0.5, 0.25, 0.5]) == Own(
        bad=0.25, rounds=4, mood="sweet", power=0, places=(1, 3), ring=(2,)
    )
    assert space.decode([1.0] * 5) == Own(
        bad=1, rounds=5, mood="bitter", power=3, places=(1, 3, 4), ring=(2,)
    )


def test_what_is_fixed_is_not_searched():
    space = Space(partial(BadMouthing, lie="relative", targets=(4,)), (0, 1, 2), (), 50)
    assert space.size == 1
    assert space.default == BadMouthing(lie="relative", targets=(4,))
    assert space.decode([0.3]) == BadMouthing(lie="relative", level=0.3, targets=(4,))


def test_where_nobody_is_honest_there_are_no_victims():
    space = Space(BadMouthing, (), (), 50)
    assert {space.decode([0.0, 0.5, x]).targets for x in (0.0, 1.0)} == {None}


def test_a_mixture_picks_a_kind_and_its_parameters():
    spaces = [Space(kind, (), (), 50) for kind in (OnOff, BadMouthing)]
    mixture = Mixture(spaces)
    assert mixture.size == 5
    assert mixture.default == OnOff()
    assert mixture.decode([0.49, 0.0, 0.1, 0.2, 0.3]) == OnOff(
        period=1, duty=0.1, bad=0.2, good=0.3
    )
    assert mixture.decode([0.5, 0.0, 0.1, 0.2, 0.3]) == BadMouthing(level=0.1)
    assert Mixture(spaces[1:]).size == 3
    assert (Mixture([]).size, Mixture([]).default) == (0, HONEST_POLICY)


def test_words_are_those_of_the_command_line():
    assert (
        as_spec(BadMouthing(level=1 / 3, start=4)) == "bad-mouthing:start=4,lie=constant,level=0.33"
    )
    assert (
        as_spec(OnOff(switching="random", duty=0.25))
        == "on-off:period=2,duty=0.25,bad=0,good=1,switching=random"
    )
    assert (
        as_spec(BadMouthing(targets=tuple(range(7))))
        == "bad-mouthing:lie=constant,level=0.5,targets=[0,...,6]"
    )
    assert as_spec(HONEST_POLICY) == "honest"


@checked(frozen=True)
class Demanding(Policy):
    """Has no default."""

    bad: Share
    delay: PositiveInt = field(default=1)


@checked(frozen=True)
class Contrary(Policy):
    """Refuses what it declares."""

    rounds: Annotated[PositiveInt, SearchRange(0, 5)] = 1


def test_what_cannot_be_searched_says_why():
    with refuses(ValueError, "Demanding", "bad"):
        Space(Demanding, (), (), 50)
    assert Space(partial(Demanding, bad=0.5), (), (), 50).size == 0
    with refuses(ValueError, "Contrary", "rounds", "0"):
        Space(Contrary, (), (), 50).decode([0.0])
    with refuses(ValueError, "NotSearched", "Policy"):
        Space(NotSearched, (), (), 50)
    for low, high in ((2, 1), (0, float("inf")), (float("nan"), 1)):
        with refuses(ValueError, low, high):
            SearchRange(low, high)
