"""The attacker's side of a game: the compromised agents and their identities."""

from collections.abc import Sequence
from functools import reduce

from roletrust_env.arrays import Array, mean_or_zero, namespace
from roletrust_env.frozen import Frozen
from roletrust_env.game.state import Actions
from roletrust_env.shapes import GameFlags, PerGame, PerProvider, PerRater, ProviderFlags
from roletrust_env.world.presence import PRESENT, WAITING, Phases
from roletrust_env.world.roster import Roster, places


class AttackerSide(Frozen):
    """The compromised agents and their identities.

    Args:
        roster: Agents of the game.
        compromised: Names of the agents that the attacker controls, without identities in reserve.
        honest: Names of agents without a scripted attack; those of this side are left out.
        like: Array of the game's library, dtype and device.

    Attributes:
        identities: Names of the compromised agents, each followed by its identities in reserve.
        honest_raters: Indices of the honest raters on the rater axis.
        honest_providers: Indices of the honest providers on the provider axis.
    """

    def __init__(
        self, roster: Roster, compromised: Sequence[str], honest: Sequence[str], like: Array
    ) -> None:
        owned = [
            [name for name, owner in roster.owners.items() if owner == agent]
            for agent in compromised
        ]
        self.identities = tuple(name for names in owned for name in names)
        others = [name for name in honest if name not in self.identities]
        self._raters = places(self.identities, roster.rater_names)
        self._providers = places(self.identities, roster.provider_names)
        self.honest_raters = places(others, roster.rater_names)
        self.honest_providers = places(others, roster.provider_names)
        self._sellers = [
            owned_places
            for names in owned
            if (owned_places := places(names, roster.provider_names))
        ]
        self._agents = places(self.identities, roster.names)
        rows = [
            name
            for axis in (roster.rater_names, roster.provider_names)
            for name in self.identities
            if name in axis
        ]
        self._in_gap = places(rows, roster.names)
        self._reserve = self._mask(
            like, [roster.identity_index[place] > 0 for place in self._in_gap]
        )
        of_agent = [[k for k, name in enumerate(rows) if name in names] for names in owned]
        longest = max(map(len, of_agent))
        self._columns = [[own[min(k, len(own) - 1)] for own in of_agent] for k in range(longest)]
        masks = (
            [name in self.identities for name in axis]
            for axis in (roster.rater_names, roster.provider_names)
        )
        self._rates, self._provides = (self._mask(like, mask) for mask in masks)
        self._is = self._mask(like, [name in self.identities for name in roster.names])

    def joint(self, others: Actions, own: Actions) -> Actions:
        """Return the actions of all agents: `own` for the attacker's identities, `others` for
        everybody else.
        """
        xp = namespace(own.quality)
        rates, provides, is_ours = (
            mask.reshape(-1, *[1] * (own.quality.ndim - 1))
            for mask in (self._rates, self._provides, self._is)
        )

        def choose(
            mine: Array, ours: Array | None, theirs: Array | None, usual: Array
        ) -> Array | None:
            if ours is None and theirs is None:
                return None
            return xp.where(
                mine, usual if ours is None else ours, usual if theirs is None else theirs
            )

        return Actions(
            quality=xp.where(provides, own.quality, others.quality),
            ratings=xp.where(rates[:, None, ...], own.ratings, others.ratings),
            presence=None
            if own.presence is None
            else xp.where(is_ours, own.presence, others.presence),
            withheld=choose(rates[:, None, ...], own.withheld, others.withheld, own.ratings < 0),
            treatment=choose(
                provides[None, ...], own.treatment, others.treatment, 0 * own.ratings + 1
            ),
            claims=choose(rates[:, None, ...], own.claims, others.claims, 0 * own.ratings),
        )

    def gone(self, phase: Phases) -> GameFlags:
        """Return whether all identities are gone for good, shape (...); an identity in reserve is
        not.
        """
        return (phase[self._agents, ...] > PRESENT).all(axis=0)

    def mean_of_sellers(self, values: PerProvider, present: ProviderFlags | None) -> PerGame:
        """Return the mean over the agents that provide; the value of an agent is the mean of its
        present identities.
        """
        if present is None or all(len(own) == 1 for own in self._sellers):
            return values[[place for own in self._sellers for place in own], ...].mean(axis=0)
        means = [mean_or_zero(values[own, ...], present[own, ...]) for own in self._sellers]
        return namespace(values).stack(means).mean(axis=0)

    def gap(
        self,
        trust: tuple[PerRater, PerProvider],
        present: tuple[Array | None, Array | None],
        phase: Phases | None,
        tolerance: float,
    ) -> Array:
        """Return the trust gap of each compromised agent to the honest agents of its role, shape
        (n, ...).

        The largest gap of its roles and identities counts. An identity in reserve has no gap, and
        an identity that is gone keeps its gap.

        Args:
            trust: ToR, shape (S, ...), and ToP, shape (P, ...).
            present: Whether each rater and each provider is present; None where all always are.
            phase: Phases of all agents, see `Population`; None where all are always present.
            tolerance: Gap that is subtracted, as it costs nothing.
        """
        gaps = []
        sides = (self.honest_raters, self._raters), (self.honest_providers, self._providers)
        for values, present_agents, (honest, mine) in zip(trust, present, sides, strict=True):
            if mine:
                own = values[mine, ...]
                gaps.append(
                    mean_of(values, honest, present_agents) - own - tolerance if honest else 0 * own
                )
        xp = namespace(gaps[0])
        gap = xp.concat(gaps) if len(gaps) > 1 else gaps[0]
        if phase is not None:
            unseen = self._reserve.reshape(-1, *[1] * (gap.ndim - 1)) & (
                phase[self._in_gap, ...] == WAITING
            )
            gap = xp.where(unseen, 0 * gap, gap)
        return (
            gap
            if len(self._columns) == 1
            else reduce(xp.maximum, (gap[column, ...] for column in self._columns))
        )

    @staticmethod
    def _mask(like: Array, flags: Sequence[bool]) -> Array:
        return namespace(like).asarray(list(flags), device=like.device)


def mean_of(values: Array, places: list[int], present: Array | None) -> PerGame:
    """Return the mean of some rows over those that are present; 0 if none is."""
    rows = values[places, ...]
    return rows.mean(axis=0) if present is None else mean_or_zero(rows, present[places, ...])
