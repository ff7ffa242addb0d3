"""A member of a coalition that decides alone, by the coalition's network and by what it sees
itself.
"""

from typing import Any, ClassVar, NamedTuple

from roletrust_agents.learned.deep_set import DeepSet
from roletrust_env.arrays import Array, cast, namespace
from roletrust_env.frozen import Frozen
from roletrust_env.game.accounts import Accounts, account_features
from roletrust_env.game.coalition import CoalitionMemory, lie_ratings, provider_features, to_digits
from roletrust_env.game.policy import Channel, Policy
from roletrust_env.game.views import ProviderView, RaterView
from roletrust_env.randomness import Random


class CoalitionSize(NamedTuple):
    """Size of the game that a coalition was trained for, and its own.

    Attributes:
        providers: Number of providers.
        rater_share: Share of the raters that belong to the coalition.
        max_cycles: Length of the game in rounds.
    """

    providers: int
    rater_share: float
    max_cycles: int


class _MemberMemory(NamedTuple):
    """What the two roles of a member remember; None before the first round, and of a network that
    is not wide.

    `silence` is what the network decided with the last ratings, and `serving` the features and the
    quality with which the provider then treats raters.
    """

    rater: CoalitionMemory | None = None
    provider: CoalitionMemory | None = None
    silence: Array | None = None
    serving: tuple[Array, Array] | None = None


class CoalitionMember(Frozen, Policy):
    """Policy of one member of a trained coalition. The members do not communicate.

    Each member runs the coalition's network, on the same features as `CoalitionAttacker`, from what
    its own view has:

    - A rater sees the published trust of all providers. It perceives only the services that it
      gets, knows only its own ratings, and takes its own ToR for that of the coalition.
    - A provider sees its own trust only, and takes it for that of all providers, as a coalition
      without raters does.

    So raters that see the same lie in the same way. With noise, each has its own estimate of a
    provider, while `CoalitionAttacker` pools them. Identities in reserve are not called. A provider
    keeps accounts of its own.

    Args:
        network: Network of the coalition.
        size: Size of the game in training; it fixes `own_share` and the clock. In a longer game,
            the clock stops.
        accomplices: Indices of the coalition's providers on the provider axis.
        description: Description of this attacker, for its `repr`.
    """

    def __init__(
        self, network: DeepSet, size: CoalitionSize, accomplices: tuple[int, ...], description: str
    ) -> None:
        if not network.architecture.wide:
            self.attacks = self.attacks - {"treatment", "silence"}  # type: ignore[misc]
        self._network, self._size, self._accomplices, self._description = (
            network,
            size,
            accomplices,
            description,
        )

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self._description})"

    def begin(self, random: Random, shape: tuple[int, ...]) -> _MemberMemory:
        """Return an empty memory. See `Policy.begin`."""
        return _MemberMemory()

    def ratings(self, view: RaterView, memory: _MemberMemory, random: Random) -> tuple[Array, Any]:
        """Return the lies that the network chooses. See `Policy.ratings`.

        Raises:
            ValueError: The game has no such accomplice.
        """
        published = to_digits(view.published)
        places = range(published.shape[0])
        if not set(self._accomplices) <= set(places):
            raise ValueError(
                f"{self!r}: accomplices is {self._accomplices}; there are {len(places)} providers"
            )
        before = memory.rater or CoalitionMemory.begin(published)
        known = before.remember(published).perceive(
            view.service[None, ...], view.awaiting[None, ...]
        )
        xp = namespace(published)
        features = self._features(
            view,
            known,
            last_lie=xp.where(view.rated, view.ratings - known.perceived, 0 * published),
            served=cast(view.awaiting, published.dtype),
            accomplices=[place in self._accomplices for place in places],
        )
        decided = self._network.decide(features)
        silence = decided[2] if self._network.architecture.wide else None
        return lie_ratings(known, decided[0]), memory._replace(rater=known, silence=silence)

    def withholds(
        self, view: RaterView, memory: _MemberMemory, random: Random
    ) -> tuple[Array | None, Any]:
        """Return which ratings a wide network withholds. See `Policy.withholds`."""
        return None if memory.silence is None else memory.silence > 0.5, memory

    def quality(
        self, view: ProviderView, memory: _MemberMemory, random: Random
    ) -> tuple[Array, Any]:
        """Return the quality that the network chooses. See `Policy.quality`."""
        xp, own = namespace(view.trust), to_digits(view.trust)
        published = xp.broadcast_to(own[None, ...], (self._size.providers, *own.shape))
        known = (memory.provider or self._begin_serving(published, view)).remember(published)
        mates = len(self._accomplices)  # it comes first; the order of providers has no effect
        features = self._features(
            view,
            known,
            last_lie=0 * published,
            served=0 * published,
            accomplices=[place < mates for place in range(self._size.providers)],
        )
        quality = self._network.decide(features)[1, 0]
        if known.accounts is not None:
            heard = known.accounts.hear(view.ratings[:, None, ...], view.rated[:, None, ...])
            known, memory = (
                known._replace(accounts=heard),
                memory._replace(serving=(features[:, :1, ...], quality)),
            )
        return quality, memory._replace(provider=known)

    def _begin_serving(self, published: Array, view: ProviderView) -> CoalitionMemory:
        """Return the memory of a provider before the first round; one of a wide network keeps
        accounts.
        """
        memory = CoalitionMemory.begin(published)
        if not self._network.architecture.wide:
            return memory
        nothing = 0 * view.ratings[:, None, ...]
        return memory._replace(accounts=Accounts.begin(nothing), given=nothing)

    def treats(
        self, view: ProviderView, memory: _MemberMemory, random: Random
    ) -> tuple[Array | None, Any]:
        """Return how a wide network treats each rater. See `Policy.treats`."""
        known = memory.provider
        if memory.serving is None or known is None or known.accounts is None or known.given is None:
            return None, memory
        xp, given, (features, quality) = namespace(known.given), known.given, memory.serving
        place = xp.arange(given.shape[0], dtype=given.dtype, device=given.device) / max(
            1, given.shape[0] - 1
        )
        accounts = account_features(
            known.accounts,
            best_other=known.published[0, ...],
            given=given,
            ally=0 * given,
            place=place.reshape(-1, *[1] * (given.ndim - 1)),
        )
        treatment = self._network.treatment(accounts, features)
        known = known._replace(given=treatment * quality)
        return treatment[:, 0, ...], memory._replace(provider=known)

    def _features(
        self,
        view: RaterView | ProviderView,
        known: CoalitionMemory,
        *,
        last_lie: Array,
        served: Array,
        accomplices: list[bool],
    ) -> Array:
        """Return the features of the providers, shape (F, P, ...)."""
        xp, like = namespace(known.total), known.total
        return provider_features(
            known,
            last_lie=last_lie,
            accomplice=xp.asarray(accomplices, dtype=like.dtype, device=like.device),
            served=served,
            own_trust=view.trust,
            own_share=self._size.rater_share,
            clock=xp.clip(cast(view.round, like.dtype) / self._size.max_cycles, 0.0, 1.0),
        )


class LyingMember(CoalitionMember):
    """Member of a coalition of raters."""

    attacks: ClassVar[frozenset[Channel]] = frozenset({"ratings", "silence"})


class CheatingMember(CoalitionMember):
    """Member of a coalition of providers."""

    attacks: ClassVar[frozenset[Channel]] = frozenset({"quality", "treatment"})


class FullMember(CoalitionMember):
    """Member of a coalition of raters and providers."""

    attacks: ClassVar[frozenset[Channel]] = frozenset(
        {"quality", "treatment", "ratings", "silence"}
    )


def member_of(
    network: DeepSet,
    size: CoalitionSize,
    accomplices: tuple[int, ...],
    *,
    provides: bool,
    description: str,
) -> CoalitionMember:
    """Return the policy of each member of a coalition.

    Args:
        network: Network of the coalition.
        size: Size of the game in training.
        accomplices: See `CoalitionMember`.
        provides: Whether the coalition was trained with providers.
        description: See `CoalitionMember`.

    Raises:
        ValueError: The coalition was trained with providers and has no accomplices, or the other
            way round.
    """
    if provides and not accomplices:
        raise ValueError(
            f"{description}: the coalition was trained with providers; name those of yours, such "
            "as accomplices=[sp_0]"
        )
    if accomplices and not provides:
        raise ValueError(
            f"{description}: the coalition was trained without providers; it has no accomplices"
        )
    kind = (FullMember if size.rater_share else CheatingMember) if provides else LyingMember
    return kind(network, size, accomplices, description)
