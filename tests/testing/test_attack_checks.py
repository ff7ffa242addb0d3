"""`check_attack` refuses an attack for each rule that it breaks, in one line that says what to
change."""

from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
import pytest
from refusals import refuses

from roletrust_env import Policy, WindowedAttack
from roletrust_env.arrays import namespace
from roletrust_env.parameters import Share
from roletrust_env.testing import check_attack


@dataclass(frozen=True)
class Sound(Policy):
    attacks: ClassVar[frozenset[str]] = frozenset({"ratings"})
    level: Share = 0.1

    def ratings(self, view: Any, memory: Any, random: Any) -> Any:
        return 0 * view.service + self.level, memory


class WithMemory(Policy):
    attacks = frozenset({"quality"})

    def begin(self, random: Any, shape: Any) -> Any:
        return 0 * random.uniform(shape)

    def quality(self, view: Any, memory: Any, random: Any) -> Any:
        return 0 * view.trust + 0.5, self.after(memory)

    def after(self, memory: Any) -> Any:
        return memory + 1


class WritesToMemory(WithMemory):
    def after(self, memory: Any) -> Any:
        memory += 1
        return memory


class RemembersInItself(WithMemory):
    rounds = 0

    def after(self, memory: Any) -> Any:
        self.rounds += 1
        return memory


class TooGood(WithMemory):
    def quality(self, view: Any, memory: Any, random: Any) -> Any:
        return 0 * view.trust + 2, memory


class MixesGames(WithMemory):
    def quality(self, view: Any, memory: Any, random: Any) -> Any:
        return 0 * view.trust + view.trust.mean(), memory


class IsRandom(WithMemory):
    source = np.random.default_rng(0)

    def quality(self, view: Any, memory: Any, random: Any) -> Any:
        return 0 * view.trust + float(self.source.random()), memory


class DrawsAsItShould(WithMemory):
    def quality(self, view: Any, memory: Any, random: Any) -> Any:
        return random.uniform(view.trust.shape), memory


class InDoublePrecision(WithMemory):
    def quality(self, view: Any, memory: Any, random: Any) -> Any:
        xp = namespace(view.trust)
        return xp.zeros(view.trust.shape, dtype=xp.float64), memory


class NumpyOnly(WithMemory):
    def quality(self, view: Any, memory: Any, random: Any) -> Any:
        return np.full(view.trust.shape, 0.5, dtype=view.trust.dtype), memory


class WithoutChannels(Policy):
    pass


class Unknown(Policy):
    attacks = frozenset({"looks"})


@dataclass(frozen=True)
class Unhashable(Sound):
    targets: list[int] = field(default_factory=list)


class Idle(Policy):
    attacks = frozenset({"ratings"})


class Late(WindowedAttack):
    attacks = frozenset({"ratings"})


@pytest.mark.parametrize(
    "attack", [Sound(), WithMemory(), DrawsAsItShould()], ids=lambda one: type(one).__name__
)
def test_a_sound_attack_passes(attack: Any) -> None:
    check_attack(attack)


@pytest.mark.parametrize(
    ("attack", "words"),
    [
        (WritesToMemory(), ("WritesToMemory()", "memory")),
        (
            RemembersInItself(),
            ("RemembersInItself()", "attributes"),
        ),
        (TooGood(), ("TooGood()", "0", "quality")),
        (MixesGames(), ("MixesGames()", "batch")),
        (
            IsRandom(),
            ("IsRandom()", "random"),
        ),
        (
            InDoublePrecision(),
            ("float64", "float32"),
        ),
        (
            WithoutChannels(),
            ("frozenset()", "quality"),
        ),
        (Unknown(), ("Unknown()", "looks")),
        (Unhashable(), ("Unhashable",)),
    ],
    ids=lambda attack: type(attack).__name__,
)
def test_each_broken_rule_is_named_in_one_line(attack: Any, words: tuple[str, ...]) -> None:
    with refuses(AssertionError, *words, type(attack).__name__):
        check_attack(attack, torch=False)


def test_an_attack_for_numpy_only_is_refused_on_torch() -> None:
    pytest.importorskip("torch")
    check_attack(NumpyOnly(), torch=False)
    with refuses(AssertionError, "NumpyOnly()", "torch.float64"):
        check_attack(NumpyOnly())


def test_an_attack_that_plays_honestly_gets_a_hint() -> None:
    with pytest.warns(UserWarning, match=r"Idle\(\).* 25 "):
        check_attack(Idle(), torch=False)


def test_a_class_and_another_object_are_refused() -> None:
    with refuses(ValueError, "Sound()"):
        check_attack(Sound)  # type: ignore[arg-type]
    with refuses(ValueError, "3", "roletrust_env.Policy"):
        check_attack(3)  # type: ignore[arg-type]
