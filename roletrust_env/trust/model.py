"""What a trust model is, and the table of those known by name."""

from typing import Any, Literal, NamedTuple, Protocol, TypeVar, runtime_checkable

from roletrust_env.arrays import Array
from roletrust_env.registry import Registry

State = TypeVar("State")


@runtime_checkable
class TrustModel(Protocol[State]):
    """Turns rounds of ratings into trust. It knows nothing of games, names, rewards or files.

    A model is immutable; what it remembers is its state, a NamedTuple of arrays that `update` replaces. Written with
    operators and `roletrust_env.arrays.namespace`, it runs on NumPy and torch, for one game and for a batch.

    What a model is fit for it says in class attributes, of which all but `rates_raters` may be left out; see `Traits`.

    Attributes:
        rates_raters: whether the model has a notion of rater trust; if not, `rater_trust` reads 1 for all.
    """

    rates_raters: bool

    def start(self, like: Array) -> State:
        """The state before any rating.

        A model with `takes_peers` has a second argument: `peers`, shape (S, P), boolean, true where a rater and a
        provider are one agent.

        Args:
            like: an array of shape (S, P, ...) that shows the shapes, the dtype, the device and the array library.
        """
        ...

    def update(self, state: State, ratings: Array, mask: Any) -> State:
        """The state after one more round.

        Args:
            state: the state before the round; it is left as it is.
            ratings: f, shape (S, P, ...), in [0, 1] where the mask is true, anything elsewhere. The state may keep
                them: nobody writes to them afterwards.
            mask: m, shape (S, P, ...), boolean, true where rater i rated provider j in this round; or None, where
                all did, for a model with `takes_full_rounds`.
        """
        ...

    def rater_trust(self, state: State) -> Array:
        """The trust of each rater, shape (S, ...), in [0, 1]."""
        ...

    def provider_trust(self, state: State) -> Array:
        """The trust of each provider, shape (P, ...), in [0, 1]."""
        ...


class Traits(NamedTuple):
    """What a trust model is fit for, as its class attributes of the same names say; here with their usual values.

    Attributes:
        rates_raters: whether it has a notion of rater trust.
        family: `"central"`: it sees all ratings as a manager does; `"personal"`: every rater is a judge of its own.
        source: the paper that it comes from.
        differentiable: Whether trust follows ratings without jumps, so that gradients are of use.
        cost: how time and memory grow with S raters and P providers, such as `"S P"` or `"S^2 P"`.
        takes_full_rounds: whether its `update` takes None for a mask that is true everywhere, which is quicker. A class
            that overrides `update` has to say it anew.
        takes_peers: whether its `start` has to know which rater and which provider are one agent.
    """

    rates_raters: bool = True
    family: Literal["central", "personal"] = "central"
    source: str = ""
    differentiable: bool = True
    cost: str = "S P"
    takes_full_rounds: bool = False
    takes_peers: bool = False

    @classmethod
    def of(cls, model: Any) -> "Traits":
        """The traits of a model, or of its class."""
        said = {name: getattr(model, name) for name in cls._fields if hasattr(model, name)}
        for kind in (model if isinstance(model, type) else type(model)).__mro__:
            if "takes_full_rounds" in {**vars(kind), **getattr(model, "__dict__", {})}:
                break
            if "update" in vars(kind):  # what one takes, another that overrides it need not
                said.pop("takes_full_rounds", None)
                break
        return cls()._replace(**said)


def start_model(model: TrustModel[State], like: Array, peers: Array) -> State:
    """The state of a model before any rating.

    Args:
        model: of which kind soever.
        like: see `TrustModel.start`.
        peers: shape (S, P), boolean, true where a rater and a provider are one agent.
    """
    made: State = model.start(like, peers) if Traits.of(model).takes_peers else model.start(like)  # type: ignore[call-arg]
    return made


registry: Registry[TrustModel[Any]] = Registry("trust model", "roletrust_env.trust_models", TrustModel)


def register_trust_model(name: str, factory: Any) -> None:
    """Make a trust model known by name; see `Registry.register`.

    Args:
        name: the new name.
        factory: a callable `(**parameters) -> TrustModel`, usually the model's class. In a game, `lam` and `initial`
            are those of the scenario, if it takes them.
    """
    registry.register(name, factory)


def make_trust_model(name: str, **parameters: Any) -> TrustModel[Any]:
    """Make a trust model by name.

    Args:
        name: a registered name or that of an entry point in the group `roletrust_env.trust_models`.
        **parameters: the model's own; most take `lam`, the weight of the newest round, and `initial`, the trust before
            any rating.

    Raises:
        ValueError: the name is unknown, the parameters are not the model's, or a value is outside its range.

    Example:
        >>> make_trust_model("role-trust", lam=0.7)
        RoleTrust(lam=0.7, initial=0.5)
    """
    return registry.make(name, **parameters)


def trust_models() -> dict[str, str]:
    """The known trust models: name and one line of description."""
    return registry.describe()
