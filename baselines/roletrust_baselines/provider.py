"""Scripted attacks on the quality of services."""

from dataclasses import field
from typing import Annotated, Any, ClassVar, Literal

from pydantic import NonNegativeInt, PositiveInt

from roletrust_env.arrays import Array, cast, namespace
from roletrust_env.game.policy import Channel, WindowedAttack, asleep, wake
from roletrust_env.game.views import ProviderView
from roletrust_env.parameters import (
    GameLength,
    Lam,
    NotSearched,
    SearchRange,
    Share,
    checked_dataclass,
)
from roletrust_env.randomness import Random


@checked_dataclass
class CheatingProvider(WindowedAttack):
    """Provider that serves as well as it can, except in the rounds in which it cheats.

    Attributes:
        bad: Quality of bad service, in [0, 1].
    """

    bad: Share = 0.0
    attacks: ClassVar[frozenset[Channel]] = frozenset({"quality"})

    def cheats(self, view: ProviderView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return whether it would cheat in this round, boolean, shape (...), and its new memory."""
        raise NotImplementedError

    def quality(self, view: ProviderView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return bad quality in the active rounds in which it cheats, and 1 otherwise. See
        `Policy.quality`.
        """
        zero = 0 * view.trust
        cheats, memory = self.cheats(view, memory, random)
        return namespace(zero).where(
            cheats & self.active(view.round), zero + self.bad, zero + 1
        ), memory


@checked_dataclass
class OnOff(WindowedAttack):
    """On-off attack (OOA): a provider that serves badly and well in turn.

    Su and Saint-Jore (EWSN 2023), section 3, Figure 3. With `switching="random"` the phases of bad
    and of good service have geometrically distributed lengths, with the same means as in the
    regular attack.

    Attributes:
        period: Number of rounds of a bad and a good phase together.
        duty: Share of the period with bad service, in [0, 1]. A regular period begins with its bad
            rounds, rounded up.
        bad: Quality of bad service, in [0, 1].
        good: Quality of good service during the attack, in [0, 1].
        switching: Switching between the phases, `"regular"` or `"random"`.
    """

    period: Annotated[PositiveInt, SearchRange(1, 12)] = 2
    duty: Share = 0.5
    bad: Share = 0.0
    good: Share = 1.0
    switching: Annotated[Literal["regular", "random"], NotSearched()] = "regular"
    attacks: ClassVar[frozenset[Channel]] = frozenset({"quality"})

    def begin(self, random: Random, shape: tuple[int, ...]) -> Any:
        """Return whether the first phase is bad, if the switching is random. See `Policy.begin`."""
        return None if self.switching == "regular" else random.uniform(shape) < self.duty

    def quality(self, view: ProviderView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return bad and good quality in turn while active, and 1 otherwise. See
        `Policy.quality`.
        """
        xp, zero = namespace(view.trust), 0 * view.trust
        bad_rounds = self.duty * self.period
        if self.switching == "regular":
            bad = (
                view.round - self.start
            ) % self.period < bad_rounds - 1e-9  # as 0.07 * 100 is slightly above 7
        else:
            bad = memory
            switches = xp.where(
                bad, _switch_probability(bad_rounds), _switch_probability(self.period - bad_rounds)
            )
            memory = bad ^ (random.uniform(view.trust.shape) < switches)
        quality = xp.where(bad, zero + self.bad, zero + self.good)
        return xp.where(self.active(view.round), quality, zero + 1), memory


def _switch_probability(mean_rounds: float) -> float:
    """Return the probability per round that a phase of this mean length ends."""
    return 1.0 if mean_rounds <= 1 else 1 / mean_rounds


@checked_dataclass
class Camouflage(CheatingProvider):
    """Camouflage: a provider that serves well until it is trusted, and badly from then on.

    This is the sleeper of the literature on unfair ratings (Irissappane, Jiang and Zhang 2012),
    applied to services. With `wakes_at=0` it depends on the round only, like `OnOff(start=...,
    duty=1)`.

    Attributes:
        wakes_at: Own ToP from which on it cheats, permanently, in [0, 1].
    """

    start: Annotated[NonNegativeInt, SearchRange(0, 100)] = 20
    wakes_at: Share = 0.8

    def begin(self, random: Random, shape: tuple[int, ...]) -> Any:
        """Return that it is asleep. See `Policy.begin`."""
        return asleep(random, shape)

    def cheats(self, view: ProviderView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return whether its trust has been high enough in an active round. See
        `CheatingProvider.cheats`.
        """
        return wake(self.active(view.round) & (view.trust >= self.wakes_at), memory)


@checked_dataclass
class Exit(CheatingProvider):
    """Exit: a provider that serves well until the last rounds of the game, in which it cheats.

    A provider that is about to leave has no trust to lose. With a new identity afterwards, this is
    the re-entry of Kerr and Cohen (2009), "Smart Cheaters Do Prosper". The attack has to know the
    length of the game, which the command line and the searches fill in.

    Attributes:
        length: Length of the game, in rounds.
        last: Number of rounds at the end of the game in which it cheats.
    """

    length: Annotated[PositiveInt, GameLength()] = field(kw_only=True)
    last: Annotated[PositiveInt, SearchRange(1, 30)] = 10

    def cheats(self, view: ProviderView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return whether this is one of the last rounds. See `CheatingProvider.cheats`."""
        return view.round >= self.length - self.last, memory


@checked_dataclass
class Opportunistic(CheatingProvider):
    """Opportunistic service: a provider that serves well only while its own trust is low.

    Chen, Bao and Guo (2016), "Trust-Based Service Management for Social Internet of Things
    Systems": good service when its reputation drops, bad service when it is high. The paper gives
    no formula; the threshold is our interpretation.

    Attributes:
        threshold: Own ToP from which on it cheats, in [0, 1].
    """

    threshold: Share = 0.7

    def cheats(self, view: ProviderView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return whether its trust has reached the threshold. See `CheatingProvider.cheats`."""
        return view.trust >= self.threshold, memory


@checked_dataclass
class ReputationLag(CheatingProvider):
    """Reputation lag: a provider that cheats until the first bad ratings arrive, and then serves
    well.

    Kerr and Cohen (2009), "Smart Cheaters Do Prosper": until bad ratings arrive, a provider still
    sells on its old trust. In our interpretation it cheats while it is trusted and the mean of the
    ratings that arrived in the last round is not low, or no ratings arrived. An opportunistic
    provider stops when its trust falls; this one stops earlier.

    Attributes:
        threshold: Own ToP from which on it cheats, in [0, 1].
        noticed: Mean rating below which its bad service is noticed, in [0, 1].
    """

    threshold: Share = 0.7
    noticed: Share = 0.5

    def cheats(self, view: ProviderView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return whether it is trusted and its bad service is not noticed. See
        `CheatingProvider.cheats`.
        """
        arrived = cast(view.rated, view.trust.dtype).sum(axis=0)
        total = (
            namespace(view.ratings).where(view.rated, view.ratings, 0 * view.ratings).sum(axis=0)
        )
        return (view.trust >= self.threshold) & ~(total < self.noticed * arrived), memory


@checked_dataclass
class ThresholdSurfing(WindowedAttack):
    """Threshold surfing: a provider that serves just well enough to stay above the trust at which
    it is cut off.

    This strategy against admission control (`Scenario.admission`) is not from a paper. It predicts
    its trust as the exponential mean of the quality that it delivers. Its last service is not rated
    yet, so it chooses the quality of the next one such that its trust after both is the threshold
    plus the margin.

    Attributes:
        threshold: Trust below which admission control can cut it off, in [0, 1].
        margin: Distance at which it keeps its trust above the threshold, in [0, 1].
        lam: Weight of the newest round that it assumes for trust, in [0.5, 1).
    """

    threshold: Share = 0.25
    margin: Annotated[Share, SearchRange(0, 0.5)] = 0.05
    lam: Lam = 0.5
    attacks: ClassVar[frozenset[Channel]] = frozenset({"quality"})

    def quality(self, view: ProviderView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return the quality that keeps its trust at the target while active, else 1. See
        `Policy.quality`.
        """
        xp, zero = namespace(view.trust), 0 * view.trust
        predicted = (1 - self.lam) * view.trust + self.lam * view.quality
        needed = (self.threshold + self.margin - (1 - self.lam) * predicted) / self.lam
        return xp.where(self.active(view.round), xp.clip(needed, 0, 1), zero + 1), memory


@checked_dataclass
class ValueImbalance(CheatingProvider):
    """Value imbalance: a provider that is honest on cheap services and cheats on expensive ones.

    Kerr and Cohen (2009), "Smart Cheaters Do Prosper". It needs a scenario with different `values`.
    If all services have the same value, each of them counts as expensive.

    Attributes:
        threshold: Value of a service, as a share of the highest value, above which it cheats, in
            [0, 1].
    """

    threshold: Share = 0.5

    def cheats(self, view: ProviderView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return whether the value is above the threshold. See `CheatingProvider.cheats`."""
        return view.value > self.threshold, memory
