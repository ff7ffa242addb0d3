"""Judges that blend the published trust of a central model with their own experience."""

from functools import cached_property
from typing import Annotated, Any, NamedTuple

from roletrust_env.arrays import namespace
from roletrust_env.parameters import Lam, Ridge, Share, checked_dataclass
from roletrust_env.shapes import PerPair, PerRater
from roletrust_env.trees import SHARES
from roletrust_env.trust.model import Peers, Traits, TrustModel, registry, start_model
from roletrust_env.trust.personal import Evidence, Personal
from roletrust_env.trust.ratings import Ratings


class BlendedState(NamedTuple):
    """Memory of the central model and of the judges.

    Attributes:
        central: State of the central model.
        own: All services that the judges received.
        trust: Trust of each judge in each provider, shape (S, P, ...).
    """

    central: Any
    own: Evidence
    trust: Annotated[PerPair, SHARES]


@checked_dataclass
class Blended(Personal):
    """Blended: the published trust of a central model, and the mean of the judge's own services,
    which counts more with every service.

        T[i, j] = (1 - w[i, j]) ToP[j] + w[i, j] x[i, j],   w[i, j] = n[i, j] / (n[i, j] + prior)

    Judge i received n[i, j] services from provider j, with the mean x[i, j]. The central model sees
    delivered ratings alone. With the same `prior` for all central models, their consumers use
    their own experience to the same extent, so the models can be compared with personal ones.

    Attributes:
        model: Name of the central model.
        lam: Weight of the newest round, for a central model with this parameter.
        initial: Trust before any rating, in [0, 1], for a central model with this parameter.
        prior: Number of own services that count as much as the published trust, at least 0.001.

    Raises:
        ValueError: There is no such model, or it is a personal one.
    """

    model: str = "beta"
    lam: Lam = 0.5
    initial: Share = 0.5
    prior: Ridge = 2.0
    rates_raters = False
    takes_peers = True

    def __post_init__(self) -> None:
        """Refuse a model that is not central, and take over the properties of one that is."""
        traits = Traits.of(self._central)
        if traits.family != "central":
            raise ValueError(f"model must be a central trust model, got {self.model!r}")
        for name in ("rates_raters", "differentiable", "cost"):
            object.__setattr__(self, name, getattr(traits, name))

    @cached_property
    def _central(self) -> TrustModel[Any]:
        offered = {"lam": self.lam, "initial": self.initial}
        return registry.make(self.model, **registry.accepted_parameters(self.model, offered))

    def start(self, like: PerPair, peers: Peers) -> BlendedState:
        """Return the state without experience. See `TrustModel.start`."""
        central, own = start_model(self._central, like, peers), Evidence.none(like)
        return BlendedState(central, own, own.sums + self._central.provider_trust(central))

    def update(self, state: BlendedState, ratings: Ratings) -> BlendedState:
        """Return the state after one round of ratings. See `TrustModel.update`."""
        central = self._central.update(state.central, Ratings(ratings.values, ratings.mask))
        own = state.own.after(ratings.experience)
        sums = self.prior * self._central.provider_trust(central) + own.sums
        trust = namespace(sums).clip(sums / (self.prior + own.counts), 0.0, 1.0)
        return BlendedState(central, own, trust)

    def rater_trust(self, state: BlendedState) -> PerRater:
        """Return the trust of each rater under the central model, shape (S, ...)."""
        return self._central.rater_trust(state.central)
