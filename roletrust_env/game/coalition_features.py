"""Features of providers, and lies about them, for any number of providers: of a coalition or one of its members."""

from typing import NamedTuple, Self

from roletrust_env.arrays import Array, cast, largest, mean_places, namespace

FEATURES = (
    "published",
    "published_rank",
    "published_change",
    "perceived",
    "perceived_rank",
    "published_less_perceived",
    "last_lie",
    "most_trusted",
    "lead",
    "perceived_gap",
    "accomplice",
    "served",
    "own_trust",
    "own_share",
    "clock",
)
"""Names of the features of a provider, see `provider_features`."""

REACH = 1.5
"""Largest distance of a lie from the perceived quality, before it is cut to [0, 1]."""

_STEPS = 10_000.0  # of published trust: providers that are alike tie, whatever the rounding errors
_CHANGES, _LEADS = 5.0, 10.0  # small differences of trust decide; this brings them near the size of other features


class CoalitionMemory(NamedTuple):
    """What a coalition, or a member of it, remembers.

    Attributes:
        total: Sum of the perceived qualities of each provider, over its raters and the rounds, shape (P, ...).
        count: Number of these perceptions, shape (P, ...).
        published: Published trust of each provider as far as it is seen, to four digits, shape (P, ...).
        change: Change of that trust in the last round, shape (P, ...).
    """

    total: Array
    count: Array
    published: Array
    change: Array

    @classmethod
    def begin(cls, published: Array) -> Self:
        """Return the memory before the first round, from the trust at that time, shape (P, ...)."""
        return cls(0 * published, 0 * published, published, 0 * published)

    def remember(self, published: Array) -> Self:
        """Return the memory with the published trust of a round, shape (P, ...). Call it once in every round."""
        return self._replace(published=published, change=published - self.published)

    def perceive(self, service: Array, awaiting: Array) -> Self:
        """Return the memory with the services of a round.

        Args:
            service: Quality that each rater perceives in each service, shape (n, P, ...).
            awaiting: Whether there is such a service, boolean, shape (n, P, ...).
        """
        count = self.count + awaiting.sum(axis=0, dtype=self.total.dtype)
        return self._replace(total=self.total + (service * awaiting).sum(axis=0), count=count)

    @property
    def perceived(self) -> Array:
        """Mean perceived quality of each provider, shape (P, ...); its published trust where there is none."""
        where = namespace(self.total).where
        return where(self.count > 0, self.total / (self.count + (self.count == 0)), self.published)


def to_digits(trust: Array) -> Array:
    """Return published trust to four digits, so that providers that are alike tie."""
    return namespace(trust).round(_STEPS * trust) / _STEPS


def provider_features(
    memory: CoalitionMemory,
    *,
    last_lie: Array,
    accomplice: Array,
    served: Array,
    own_trust: Array,
    own_share: float,
    clock: Array,
) -> Array:
    """Return the features of each provider, shape (F, P, ...), in [-1, 1], in the order of `FEATURES`.

    - `published`, `published_rank`: its published trust to four digits, and the rank of that, 0 for the highest and
      1 for the lowest; `published_change`: five times the change in the last round.
    - `perceived`, `perceived_rank`: its mean perceived quality, see `CoalitionMemory`, and the rank of that.
    - `published_less_perceived`: the difference of the two.
    - `last_lie`: rating of it that arrived in the last round, less the perceived quality.
    - `most_trusted`: 1 for a provider with the highest published trust, to which consumers go, else 0; `lead`: ten
      times its published trust less the highest one of the others, cut to [-1, 1].
    - `perceived_gap`: distance to the best perceived quality.
    - `accomplice`: 1 for a provider of the coalition, else 0.
    - `served`: 1 if its service awaits a rating, else 0.
    - `own_trust`, `own_share`, `clock`: the same for all providers, see the arguments.

    Args:
        memory: Memory with what is seen in this round.
        last_lie: See above, shape (P, ...).
        accomplice: See above, shape (P,) or (P, 1, ...).
        served: See above, shape (P, ...).
        own_trust: Trust of the own agents, shape (...).
        own_share: Share of the raters that belong to the coalition.
        clock: Share of the game that is over, shape (...).
    """
    xp, published, perceived = namespace(memory.total), memory.published, memory.perceived
    nothing = 0 * published
    rows = (
        published,
        _rank(published),
        xp.clip(_CHANGES * memory.change, -1.0, 1.0),
        perceived,
        _rank(perceived),
        published - perceived,
        last_lie,
        cast(published == largest(published), published.dtype),
        xp.clip(_LEADS * (published - _best_other(published)), -1.0, 1.0),
        largest(perceived) - perceived,
        nothing + accomplice.reshape(-1, *[1] * (published.ndim - 1)),
        served,
        nothing + own_trust,
        nothing + own_share,
        nothing + clock,
    )
    return xp.stack(rows)


def lie_ratings(memory: CoalitionMemory, lie: Array) -> Array:
    """Return the ratings that tell a lie: the perceived quality plus `REACH` times (2 x - 1), cut to [0, 1].

    Args:
        memory: Memory with what is seen in this round.
        lie: Lie about each provider, x, shape (P, ...), in [0, 1]; 0.5 is the truth without noise.
    """
    return namespace(lie).clip(memory.perceived + REACH * (2 * lie - 1), 0.0, 1.0)


def _best_other(values: Array) -> Array:
    """Return the highest of the other values for each value along the first axis; the value itself if it is alone."""
    xp, top = namespace(values), largest(values)
    highest = values == top
    if values.shape[0] == 1:
        return values
    second = largest(xp.where(highest, xp.min(values, axis=0), values))
    alone = highest.sum(axis=0) == 1
    return xp.where(highest & alone, second, top)


def _rank(values: Array) -> Array:
    """Return the rank of each value along the first axis: 0 for the highest, 1 for the lowest; ties share the mean."""
    return mean_places(values) / max(1, values.shape[0] - 1)
