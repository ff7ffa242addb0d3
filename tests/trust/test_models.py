"""Trust models by name: the protocol that both built-in models keep, what each computes, and the registry."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
import torch

from experiments.commands.attacks import parse_trust_model
from roletrust_env import Cast, Game, make_scenario, record
from roletrust_env.trust import (
    Mean,
    RoleTrust,
    Traits,
    TrustModel,
    make_trust_model,
    provider_trust,
    rater_trust,
    register_trust_model,
    trust_models,
)
from roletrust_env.trust.model import registry

BUILT_IN = pytest.mark.parametrize("name", ["role-trust", "mean"])
NAMESPACES = pytest.mark.parametrize("asarray", [np.asarray, torch.asarray], ids=["numpy", "torch"])
SHAPES = pytest.mark.parametrize("shape", [(3, 3), (1, 4), (2, 5, 6), (4, 2, 3, 2)], ids=str)

Round = tuple[np.ndarray, np.ndarray]


def random_rounds(shape: tuple[int, ...], count: int = 30) -> list[Round]:
    """Ratings and masks in which about half of the pairs meet, so that the time between ratings varies."""
    rng = np.random.default_rng(0)
    return [(rng.random(shape), rng.random(shape) < 0.5) for _ in range(count)]


def per_rater(shape: tuple[int, ...]) -> tuple[int, ...]:
    return (shape[0], *shape[2:])


def per_provider(shape: tuple[int, ...]) -> tuple[int, ...]:
    return shape[1:]


# --- the protocol ---------------------------------------------------------------------------------


@BUILT_IN
@SHAPES
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@NAMESPACES
def test_read_outs_keep_shape_dtype_and_library(
    name: str, shape: tuple[int, ...], dtype: type, asarray: Callable
) -> None:
    model = make_trust_model(name, lam=0.7, initial=0.3)
    like = asarray(np.full(shape, np.nan, dtype))  # only its kind counts
    state = model.start(like)
    assert isinstance(state, tuple)
    assert np.all(np.asarray(model.provider_trust(state)) == dtype(0.3))
    assert np.all(np.asarray(model.rater_trust(state)) == dtype(0.3 if model.rates_raters else 1))
    for ratings, mask in random_rounds(shape):
        state = model.update(state, asarray(ratings.astype(dtype)), asarray(mask))
        for trust, wanted in (
            (model.rater_trust(state), per_rater(shape)),
            (model.provider_trust(state), per_provider(shape)),
        ):
            assert isinstance(trust, type(like))
            assert (tuple(trust.shape), trust.dtype) == (wanted, like.dtype)
            assert np.all((np.asarray(trust) >= 0) & (np.asarray(trust) <= 1))


@BUILT_IN
@NAMESPACES
def test_update_leaves_its_inputs_alone(name: str, asarray: Callable) -> None:
    model = make_trust_model(name)
    state = model.start(asarray(np.zeros((3, 2, 4))))
    for ratings, mask in random_rounds((3, 2, 4), count=3):
        before = [np.asarray(array).copy() for array in state]
        given = asarray(ratings.copy()), asarray(mask.copy())
        after = model.update(state, *given)
        assert all(map(np.array_equal, before, map(np.asarray, state)))
        assert all(map(np.array_equal, (ratings, mask), map(np.asarray, given)))
        state = after


@BUILT_IN
def test_torch_follows_numpy_and_a_batch_its_games(name: str) -> None:
    model = make_trust_model(name)
    together = model.start(np.zeros((3, 2, 4)))
    tensors = model.start(torch.zeros((3, 2, 4), dtype=torch.float64))
    alone = [model.start(np.zeros((3, 2))) for _ in range(4)]
    for ratings, mask in random_rounds((3, 2, 4)):
        together = model.update(together, ratings, mask)
        tensors = model.update(tensors, torch.asarray(ratings), torch.asarray(mask))
        alone = [model.update(state, ratings[..., e], mask[..., e]) for e, state in enumerate(alone)]
        for read in (model.rater_trust, model.provider_trust):
            np.testing.assert_allclose(np.asarray(read(tensors)), read(together), rtol=0, atol=1e-12)
            np.testing.assert_allclose(
                np.stack([read(state) for state in alone], -1), read(together), rtol=0, atol=1e-12
            )


# --- what the two models compute ------------------------------------------------------------------


@SHAPES
def test_role_trust_is_the_two_algorithms_and_their_memory(shape: tuple[int, ...]) -> None:
    model = make_trust_model("role-trust", lam=0.6, initial=0.4)
    assert model.rates_raters
    state = model.start(np.zeros(shape))
    tor, top = np.full(per_rater(shape), 0.4), np.full(per_provider(shape), 0.4)
    last, when = np.zeros(shape), np.full(shape, -1)
    for now, (ratings, mask) in enumerate(random_rounds(shape)):
        state = model.update(state, ratings, mask)
        elapsed = np.where(when < 0, 0, now - when)
        tor = rater_trust(ratings, mask, previous=tor, lam=0.6)
        top = provider_trust(ratings, mask, tor=tor, previous=top, lam=0.6, last_ratings=last, elapsed=elapsed)
        last, when = np.where(mask, ratings, last), np.where(mask, now, when)
        np.testing.assert_allclose(model.rater_trust(state), tor, rtol=0, atol=1e-12)
        np.testing.assert_allclose(model.provider_trust(state), top, rtol=0, atol=1e-12)


def test_mean_is_an_exponential_mean_of_the_average_rating() -> None:
    model = make_trust_model("mean", lam=0.75, initial=0.2)
    assert not model.rates_raters
    state = model.start(np.zeros((3, 2)))
    ratings = np.array([[1.0, 0.9], [0.5, 0.8], [0.0, 0.7]])
    mask = np.array([[True, False], [True, False], [False, False]])
    state = model.update(state, ratings, mask)
    assert model.provider_trust(state) == pytest.approx([0.75 * 0.75 + 0.25 * 0.2, 0.2])
    state = model.update(state, ratings, ~mask)
    assert model.provider_trust(state) == pytest.approx([0.25 * (0.75 * 0.75 + 0.25 * 0.2), 0.75 * 0.8 + 0.05])
    assert np.array_equal(model.rater_trust(state), np.ones(3))


# --- the registry ---------------------------------------------------------------------------------


class Doubt(Mean):
    """Trust nobody.

    A model from user code; only its first line is a description.
    """

    def provider_trust(self, state: Any) -> Any:
        return super().provider_trust(state) * 0


@pytest.fixture
def clean_registry(monkeypatch: pytest.MonkeyPatch) -> None:
    """Names that the test registers are gone after it."""
    monkeypatch.setattr(registry, "_factories", dict(registry._factories))


@pytest.fixture
def install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[str, str], None]:
    """Put a package with one module and one entry point, `<module>-model`, where Python finds packages."""
    monkeypatch.syspath_prepend(tmp_path)

    def install(module: str, code: str) -> None:
        (tmp_path / f"{module}.py").write_text(code)
        about = tmp_path / f"{module}-1.0.dist-info"
        about.mkdir()
        (about / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {module}\nVersion: 1.0\n")
        (about / "entry_points.txt").write_text(f"[roletrust_env.trust_models]\n{module}-model = {module}:Model\n")

    return install


def test_built_in_models_are_listed_with_one_line_each() -> None:
    models = trust_models()
    assert {"role-trust", "mean"} <= set(models)
    for description in models.values():
        assert description.strip()
        assert "\n" not in description


@pytest.mark.usefixtures("clean_registry")
def test_a_model_from_user_code_is_known_by_name() -> None:
    register_trust_model("doubt", Doubt)
    assert trust_models()["doubt"] == "Trust nobody."
    model: TrustModel[Any] = make_trust_model("doubt", lam=0.9, initial=0.7)
    assert isinstance(model, Doubt)
    assert np.all(model.provider_trust(model.start(np.ones((2, 3)))) == 0)


@pytest.mark.usefixtures("clean_registry")
def test_a_name_is_given_once() -> None:
    register_trust_model("doubt", Doubt)
    for taken in ("doubt", "role-trust"):
        with pytest.raises(ValueError, match=taken):
            register_trust_model(taken, Mean)
    assert isinstance(make_trust_model("doubt"), Doubt)


@pytest.mark.usefixtures("clean_registry")
def test_an_unknown_name_is_answered_with_the_known_ones() -> None:
    register_trust_model("doubt", Doubt)
    with pytest.raises(ValueError, match="role-trsut") as error:
        make_trust_model("role-trsut")
    assert all(name in str(error.value) for name in ("role-trust", "mean", "doubt"))


def test_models_of_installed_packages_are_found(install: Callable[[str, str], None]) -> None:
    install("elsewhere", "from roletrust_env.trust import Mean\nclass Model(Mean): 'Made elsewhere.'")
    assert {"role-trust", "mean", "elsewhere-model"} <= set(trust_models())
    model = make_trust_model("elsewhere-model", lam=0.9)
    assert type(model).__module__ == "elsewhere"
    assert model.lam == 0.9


def test_a_broken_package_harms_only_who_asks_for_it(install: Callable[[str, str], None]) -> None:
    install("broken", "raise RuntimeError('half installed')")
    assert trust_models()["broken-model"]
    assert make_trust_model("role-trust")
    with pytest.raises(ValueError, match=r"broken-model.*half installed") as error:
        make_trust_model("broken-model")
    assert isinstance(error.value.__cause__, RuntimeError)


@BUILT_IN
@pytest.mark.parametrize(
    ("field", "value", "allowed"),
    [("lam", value, "[0.5, 1)") for value in (-1.0, 0.49, 1.0, 2.0, float("nan"))]
    + [("initial", value, "[0, 1]") for value in (-0.01, 1.01, float("nan"))],
)
def test_parameters_out_of_range_are_refused(name: str, field: str, value: float, allowed: str) -> None:
    with pytest.raises(ValueError, match=field) as error:
        make_trust_model(name, **{field: value})
    assert str(value) in str(error.value)
    assert allowed in str(error.value)


@BUILT_IN
def test_parameters_at_the_edge_are_taken(name: str) -> None:
    for lam, initial in ((0.5, 0), (0.999, 1)):
        assert make_trust_model(name, lam=lam, initial=initial)


@BUILT_IN
def test_unknown_parameters_are_refused(name: str) -> None:
    with pytest.raises(ValueError, match="lambda"):
        make_trust_model(name, **{"lambda": 0.5})


# --- rounds in which everybody rates everybody ------------------------------------------------------


@BUILT_IN
@NAMESPACES
@pytest.mark.parametrize("shape", [(3, 3), (1, 1), (2, 5, 6)], ids=str)
def test_no_mask_is_a_mask_that_is_true_everywhere(name: str, shape: tuple[int, ...], asarray: Callable) -> None:
    """In any order of full and partial rounds, so that the time since a rating is 1 here and more there."""
    model, rng = make_trust_model(name, lam=0.7), np.random.default_rng(1)
    assert model.takes_full_rounds
    state = masked = model.start(asarray(np.zeros(shape)))
    for ratings, mask in random_rounds(shape, 60):
        full = rng.random() < 0.6
        mask = np.ones(shape, bool) if full else mask
        state = model.update(state, asarray(ratings), None if full else asarray(mask))
        masked = model.update(masked, asarray(ratings), asarray(mask))
        for one, other in zip(state[:4], masked[:4], strict=True):
            assert one.shape == other.shape
            np.testing.assert_allclose(np.asarray(one), np.asarray(other), rtol=0, atol=1e-12)


@pytest.mark.parametrize("takes", [False, True])
def test_a_model_is_spared_the_mask_only_if_it_says_that_it_takes_none(takes: bool) -> None:
    seen: list[Any] = []

    class Curious(Mean):
        takes_full_rounds = takes

        def update(self, state: Any, ratings: Any, mask: Any) -> Any:
            seen.append(mask)
            return super().update(state, ratings, mask)

    game = Game(make_scenario("paper-3x3").change(max_cycles=5), Curious())
    seen.clear()
    record(Cast(game, {}), game.random(0))
    assert not seen[0].any()  # nothing has been served yet
    assert all(mask is None if takes else mask.all() for mask in seen[1:])


# --- what a model is fit for ----------------------------------------------------------------------


class Neighbours(NamedTuple):
    """What `Sociable` remembers."""

    top: Any
    tor: Any


class Sociable:
    """A model that trusts a provider as far as it rates, too, and takes no parameters."""

    rates_raters = False
    takes_peers = True

    def start(self, like: Any, peers: Any) -> Neighbours:
        return Neighbours(0 * like[0] + peers.sum(axis=0).reshape(-1, *[1] * (like.ndim - 2)), 0 * like[:, 0] + 1)

    def update(self, state: Neighbours, ratings: Any, mask: Any) -> Neighbours:
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


def test_a_model_that_overrides_the_update_of_another_is_given_the_mask() -> None:
    """It has not said that its own takes None."""

    class Deaf(RoleTrust):
        def update(self, state: Any, ratings: Any, mask: Any) -> Any:
            return super().update(state, ratings, mask & (ratings > 0.1))

    class Renamed(RoleTrust):
        pass

    rules = make_scenario("paper-3x3").change(max_cycles=5, noise=0.0, perturbations=[])
    deaf, plain = (record(Cast(game, {}), game.random(0)) for game in (Game(rules, Deaf()), Game(rules)))
    np.testing.assert_allclose(deaf.top, plain.top, rtol=0, atol=1e-12)
    assert Traits.of(Renamed()).takes_full_rounds
    assert not Traits.of(Deaf).takes_full_rounds
