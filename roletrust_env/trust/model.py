"""The interface of trust models, and their registry."""

from typing import (
    Annotated,
    Any,
    Literal,
    NamedTuple,
    Protocol,
    TypeAlias,
    TypeVar,
    runtime_checkable,
)

from roletrust_env.arrays import Array
from roletrust_env.registry import Registry
from roletrust_env.shapes import PerPair, PerProvider, PerRater, Shape
from roletrust_env.trust.ratings import Ratings

State = TypeVar("State")

Peers: TypeAlias = Annotated[Array, Shape("S P", "bool")]
"""Whether a rater and a provider are one agent, for each pair, boolean, shape (S, P)."""


@runtime_checkable
class TrustModel(Protocol[State]):
    """A function from rounds of ratings to trust, which knows nothing of games, names, rewards or
    files.

    A personal model may have a method `judge_trust(state)` that returns the trust of each rater in
    each provider, shape (S, P, ...), where `provider_trust` returns what is published. The services
    that the raters received are in `ratings.experience`: row i is known to rater i alone.

    A model may have a choice rule of its own, for scenarios in which `Choice.by` is `model`:
    `preference(state, noise)` returns how much each rater wants each provider, shape (S, P, ...),
    of which the largest are chosen. The noise is uniform in [0, 1), of the same shape. Row i may
    depend on what rater i knows alone.

    A model is immutable. Its memory is a state, a NamedTuple of arrays that `update` replaces. A
    model written with operators and `roletrust_env.arrays.namespace` runs on NumPy and torch, for
    one game and for a batch. A central model that is written with the operations of `Ratings`, and
    whose state says by `PerRater`, `PerProvider`, `PerPair` and `PairAge` what each array is about,
    runs on a list of edges, too.

    Class attributes describe the model, see `Traits`. All of them but `rates_raters` are optional.

    Attributes:
        rates_raters: Whether the model has a notion of rater trust; if not, `rater_trust` reads 1
            for all.
    """

    rates_raters: bool

    def start(self, like: PerPair) -> State:
        """Return the state before any rating.

        A model with `takes_peers` has a second argument: `peers`, shape (S, P), boolean, true where
        a rater and a provider are one agent.

        Args:
            like: Array of shape (S, P, ...) that shows shapes, dtype, device and array library.
        """

    def update(self, state: State, ratings: Ratings) -> State:
        """Return the state after one more round.

        Args:
            state: State before the round, which must not be changed.
            ratings: Ratings of the round. On a grid, its `values` are f, shape (S, P, ...), in [0,
                1] where rater i rated provider j and 0 elsewhere, and its `weights` are 1 there and
                0 elsewhere. The state may keep them: they are not written to afterwards. Edges come
                only to a central model that runs on them.
        """

    def rater_trust(self, state: State) -> PerRater:
        """Return the trust of each rater, shape (S, ...), in [0, 1]."""

    def provider_trust(self, state: State) -> PerProvider:
        """Return the trust of each provider, shape (P, ...), in [0, 1]."""


class Traits(NamedTuple):
    """Properties of a trust model, from its class attributes of the same names; here with the
    default values.

    Attributes:
        rates_raters: Whether it has a notion of rater trust.
        family: Point of view: `"central"` sees all ratings as a manager does; in `"personal"` every
            rater is a judge, which remembers the services that it received.
        source: Paper that describes it.
        differentiable: Whether trust follows ratings without jumps, so that gradients are of use.
        cost: Growth of time and memory with S raters and P providers, such as `"S P"` or `"S^2 P"`.
        local: Whether a round changes only agents and pairs with ratings in it, and takes nothing
            from others. Then a log of many agents is played in the time that its ratings take.
        takes_peers: Whether `start` takes a second argument, `peers`, see `TrustModel.start`.
    """

    rates_raters: bool = True
    family: Literal["central", "personal"] = "central"
    source: str = ""
    differentiable: bool = True
    cost: str = "S P"
    local: bool = False
    takes_peers: bool = False

    @classmethod
    def of(cls, model: Any) -> "Traits":
        """Return the properties of a model, or of a model class."""
        return cls(**{name: getattr(model, name) for name in cls._fields if hasattr(model, name)})


def start_model(model: TrustModel[State], like: PerPair, peers: Peers) -> State:
    """Return the state of a model before any rating.

    Args:
        model: Trust model, with or without `takes_peers`.
        like: Example array, see `TrustModel.start`.
        peers: Pairs, shape (S, P), boolean, true where a rater and a provider are one agent.
    """
    made: State = model.start(like, peers) if Traits.of(model).takes_peers else model.start(like)  # type: ignore[call-arg]
    return made


registry: Registry[TrustModel[Any]] = Registry(
    "trust model", "roletrust_env.trust_models", TrustModel
)


register_trust_model = registry.register
"""Register the class of a trust model under a name, see `Registry.register`.

In a game, `lam` and `initial` come from the scenario if it takes them.
"""


def make_trust_model(name: str, **parameters: Any) -> TrustModel[Any]:
    """Make a trust model by name.

    Args:
        name: Registered name, or name of an entry point in the group `roletrust_env.trust_models`.
        **parameters: Parameters of the model; most take `lam`, the weight of the newest round, and
            `initial`, the trust before any rating.

    Raises:
        ValueError: If the name is unknown, the model has no such parameter, or a value is outside
            its range.

    Example:
        >>> make_trust_model("role-trust", lam=0.7)
        RoleTrust(lam=0.7, initial=0.5)
    """
    return registry.make(name, **parameters)


def trust_models() -> dict[str, str]:
    """Return the known trust models: name and one-line description."""
    return registry.describe()
