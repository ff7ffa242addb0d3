"""What a trust model is, and the table of those known by name."""

from typing import Any, Protocol, TypeVar, runtime_checkable

from roletrust_env.arrays import Array, namespace
from roletrust_env.registry import Registry

State = TypeVar("State")


@runtime_checkable
class TrustModel(Protocol[State]):
    """Turns rounds of ratings into trust. It knows nothing of games, names, rewards or files.

    A model is immutable; what it remembers is its state, a NamedTuple of arrays that `update` replaces. Written with
    operators and `roletrust_env.arrays.namespace`, it runs on NumPy and torch, for one game and for a batch.

    Attributes:
        rates_raters: whether the model has a notion of rater trust; if not, `rater_trust` reads 1 for all.
        takes_full_rounds: optional; true of a model whose `update` takes None for a mask that is true everywhere,
            which is quicker. Others are given the mask; so is a class that overrides `update` and does not say it
            anew.
    """

    rates_raters: bool

    def start(self, like: Array) -> State:
        """The state before any rating.

        Args:
            like: an array of shape (S, P, ...) that shows the shapes, the dtype, the device and the array library.
        """
        ...

    def update(self, state: State, ratings: Array, mask: Any) -> State:
        """The state after one more round.

        Args:
            state: the state before the round; it is left as it is.
            ratings: f, shape (S, P, ...), in [0, 1] where the mask is true, anything elsewhere.
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


def check_trust_model(model: TrustModel[Any], n_raters: int, n_providers: int, like: Array) -> None:
    """Try a model on one round in which everybody rates everybody 0.5.

    Args:
        model: to be tried.
        n_raters: S.
        n_providers: P.
        like: an array of the library, dtype and device that it has to work with.

    Raises:
        ValueError: a read-out has the wrong shape, or is not in [0, 1].
    """
    xp = namespace(like)
    ratings = xp.zeros((n_raters, n_providers, 1), dtype=like.dtype, device=like.device) + 0.5
    state = model.update(model.start(ratings), ratings, ratings > 0)
    for what, trust, count in (
        ("rater_trust", model.rater_trust(state), n_raters),
        ("provider_trust", model.provider_trust(state), n_providers),
    ):
        if tuple(trust.shape) != (count, 1):
            raise ValueError(f"{what} of {model!r} has shape {tuple(trust.shape)}; it must be {(count, 1)}")
        if not bool(((trust >= 0) & (trust <= 1)).all()):
            raise ValueError(f"{what} of {model!r} is {trust[:, 0]}; a trust must lie in [0, 1]")


def takes_full_rounds(model: TrustModel[Any]) -> bool:
    """Whether a model takes None for a mask that is true everywhere; what one `update` takes, another need not."""
    said, overridden = "takes_full_rounds", False
    for kind in type(model).__mro__:
        if said in vars(kind):
            break
        overridden |= "update" in vars(kind)
    inherited = overridden and said not in getattr(model, "__dict__", ())
    return not inherited and bool(getattr(model, said, False))


registry: Registry[TrustModel[Any]] = Registry("trust model", "roletrust_env.trust_models", TrustModel)


def register_trust_model(name: str, factory: Any) -> None:
    """Make a trust model known by name; see `Registry.register`.

    Args:
        name: the new name.
        factory: a callable `(lam=..., initial=..., **own parameters) -> TrustModel`, usually the model's class.
    """
    registry.register(name, factory)


def make_trust_model(name: str, **parameters: Any) -> TrustModel[Any]:
    """Make a trust model by name.

    Args:
        name: a registered name or that of an entry point in the group `roletrust_env.trust_models`.
        **parameters: the model's own; every model takes `lam`, the weight of the newest round, and `initial`, the
            trust before any rating.

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
