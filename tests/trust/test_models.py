"""Trust models by name: the registry, and what a game makes of what a model says of itself."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pytest
from refusals import refuses

from roletrust_env import Game, JointPolicy, make_scenario, record
from roletrust_env.evaluation.specs import parse_trust_model
from roletrust_env.trust import (
    Mean,
    Ratings,
    RoleTrust,
    Traits,
    TrustModel,
    make_trust_model,
    register_trust_model,
    trust_models,
)
from roletrust_env.trust.model import registry

# --- the registry ---------------------------------------------------------------------------------


class Doubt(Mean):
    """Trust nobody.

    A model from user code; only its first line is a description.
    """

    def provider_trust(self, state: Any) -> Any:
        return super().provider_trust(state) * 0


def test_built_in_models_are_listed_with_one_line_each() -> None:
    models = trust_models()
    assert {"role-trust", "mean"} <= set(models)
    for description in models.values():
        assert description.strip()
        assert "\n" not in description


def test_a_model_from_user_code_is_known_by_name() -> None:
    register_trust_model("doubt", Doubt)
    assert trust_models()["doubt"] == "Trust nobody."
    model: TrustModel[Any] = make_trust_model("doubt", lam=0.9, initial=0.7)
    assert isinstance(model, Doubt)
    assert np.all(model.provider_trust(model.start(np.ones((2, 3)))) == 0)


def test_a_name_is_given_once() -> None:
    register_trust_model("doubt", Doubt)
    for taken in ("doubt", "role-trust"):
        with refuses(ValueError, taken):
            register_trust_model(taken, Mean)
    assert isinstance(make_trust_model("doubt"), Doubt)


def test_an_unknown_name_is_answered_with_the_known_ones() -> None:
    register_trust_model("doubt", Doubt)
    with refuses(ValueError, "role-trsut", "role-trust", "mean", "doubt"):
        make_trust_model("role-trsut")


def test_models_of_installed_packages_are_found(install: Callable[..., None]) -> None:
    install(
        "elsewhere",
        "roletrust_env.trust_models",
        "from roletrust_env.trust import Mean\nclass Model(Mean): 'Made elsewhere.'",
        "elsewhere-model = elsewhere:Model",
    )
    assert {"role-trust", "mean", "elsewhere-model"} <= set(trust_models())
    model = make_trust_model("elsewhere-model", lam=0.9)
    assert type(model).__module__ == "elsewhere"
    assert model.lam == 0.9


def test_a_broken_package_harms_only_who_asks_for_it(install: Callable[..., None]) -> None:
    install(
        "broken",
        "roletrust_env.trust_models",
        "raise RuntimeError('half installed')",
        "broken-model = broken:Model",
    )
    assert trust_models()["broken-model"]
    assert make_trust_model("role-trust")
    with refuses(ValueError, "broken-model") as error:
        make_trust_model("broken-model")
    assert isinstance(error.value.__cause__, RuntimeError)


# --- what a model is fit for ----------------------------------------------------------------------


def test_a_full_round_has_no_mask() -> None:
    seen: list[Any] = []

    class Curious(Mean):
        def update(self, state: Any, ratings: Ratings) -> Any:
            seen.append(ratings.mask)
            return super().update(state, ratings)

    game = Game(make_scenario("paper-3x3").change(max_cycles=5), Curious())
    seen.clear()
    record(JointPolicy(game, {}), game.random(0))
    assert not seen[0].any()  # nothing has been served yet
    assert all(mask is None for mask in seen[1:])


class Neighbours(NamedTuple):
    """What `Sociable` remembers."""

    top: Any
    tor: Any


class Sociable:
    """A model that trusts a provider as far as it rates, too, and takes no parameters."""

    rates_raters = False
    takes_peers = True

    def start(self, like: Any, peers: Any) -> Neighbours:
        return Neighbours(
            0 * like[0] + peers.sum(axis=0).reshape(-1, *[1] * (like.ndim - 2)), 0 * like[:, 0] + 1
        )

    def update(self, state: Neighbours, ratings: Ratings) -> Neighbours:
        return state

    def rater_trust(self, state: Neighbours) -> Any:
        return state.tor

    def provider_trust(self, state: Neighbours) -> Any:
        return state.top


def test_a_model_may_ask_who_is_who_and_take_no_parameters(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(registry, "_factories", {**registry._factories, "sociable": Sociable})
    game = Game(make_scenario("robots-that-move"), "sociable")
    top = game.published(game.start(game.draw(game.random(0), start=True)))[1]
    assert top.tolist() == [0, 0, 0, 0, 1, 1]  # the last two rate, too
    assert parse_trust_model("sociable", game.scenario) is not None


def test_traits_have_usual_values() -> None:
    assert Traits.of(Sociable) == Traits(rates_raters=False, takes_peers=True)
    assert Traits.of(make_trust_model("role-trust")).source.startswith("Su")


def test_a_model_may_drop_ratings_before_another_takes_them() -> None:
    class Deaf(RoleTrust):
        def update(self, state: Any, ratings: Ratings) -> Any:
            return super().update(
                state, Ratings(ratings.values, (ratings.weights > 0) & (ratings.values > 0.1))
            )

    rules = make_scenario("paper-3x3").change(max_cycles=5, noise=0.0, perturbations=[])
    deaf, plain = (
        record(JointPolicy(game, {}), game.random(0)) for game in (Game(rules, Deaf()), Game(rules))
    )
    np.testing.assert_allclose(deaf.top, plain.top, rtol=0, atol=1e-12)
