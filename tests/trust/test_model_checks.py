"""A trust model of another package that goes wrong in the middle of a game is named, with the
round."""

from typing import Any, NamedTuple

import numpy as np
import pytest
import torch
from refusals import refuses

import roletrust_env
from roletrust_env import Game, JointPolicy, TrustStream, make_scenario, record
from roletrust_env.trust import PerProvider, PerRater, Ratings
from roletrust_env.trust.model_checks import needs_watching


class Trusts(NamedTuple):
    tor: Any
    top: Any
    rounds: int


class Turncoat:
    """Sound for two rounds, and then something else."""

    rates_raters = True

    def __init__(self, what: Any) -> None:
        self.what = what

    def __repr__(self) -> str:
        return "Turncoat()"

    def start(self, like: Any) -> Trusts:
        return Trusts(0 * like[:, 0] + 0.5, 0 * like[0] + 0.5, 0)

    def update(self, state: Trusts, ratings: Ratings) -> Trusts:
        return state._replace(rounds=state.rounds + 1)

    def rater_trust(self, state: Trusts) -> Any:
        return state.tor

    def provider_trust(self, state: Trusts) -> Any:
        return self.what(state.top) if state.rounds > 2 else state.top


class Broken(Turncoat):
    """Forgets to return its state."""

    def update(self, state: Trusts, ratings: Ratings) -> Any:
        return None


def fail(top: Any) -> Any:
    raise KeyError("lost")


WRONG = pytest.mark.parametrize(
    ("what", "words"),
    [
        (lambda top: top * np.nan, ("provider_trust", "nan")),
        (lambda top: top + 1, ("provider_trust", "1.5", "[0, 1]")),
        (lambda top: top[:1], ("provider_trust",)),
        (
            lambda top: 0.5,
            ("provider_trust", "float"),
        ),
        (lambda top: top > 0, ("provider_trust",)),
        (fail, ("KeyError", "lost")),
    ],
    ids=["nan", "out of range", "shape", "no array", "dtype", "raises"],
)


@WRONG
@pytest.mark.parametrize("like", [np.zeros(()), torch.zeros(())], ids=["numpy", "torch"])
def test_it_is_named_with_the_round(what: Any, words: tuple[str, ...], like: Any) -> None:
    game = Game(make_scenario("paper-3x3"), Turncoat(what), like)
    with refuses(ValueError, "Turncoat()", "2", *words):
        record(JointPolicy(game, {}), game.random(0), (4,))


@WRONG
def test_an_environment_stays_as_it_was(what: Any, words: tuple[str, ...]) -> None:
    env = roletrust_env.parallel_env("paper-3x3", Turncoat(what))
    env.reset(seed=0)
    actions = {agent: env.action_space(agent).sample() for agent in env.agents}
    env.step(actions)
    env.step(actions)
    before = env.state()
    with refuses(ValueError, *words):
        env.step(actions)
    assert np.array_equal(env.state(), before)


class EdgeState(NamedTuple):
    raters: PerRater
    providers: PerProvider


@pytest.mark.parametrize("local", [False, True])
def test_a_stream_names_it_with_the_round(local: bool) -> None:
    class Edges(Turncoat):
        def start(self, like: Any) -> Any:
            return EdgeState(*super().start(like)[:2])

        def update(self, state: Any, ratings: Ratings) -> Any:
            return self.what(state)

        provider_trust = lambda self, state: state.providers  # noqa: E731
        rater_trust = lambda self, state: state.raters  # noqa: E731

    Edges.local = local  # type: ignore[attr-defined]
    for what, words in (
        (fail, ("KeyError", "lost")),
        (lambda state: None, ("AttributeError", "NoneType")),
        (lambda state: EdgeState(state.raters * np.nan, state.providers), ("rater_trust", "nan")),
        (
            lambda state: EdgeState(state.raters, state.providers[1:]),
            ("provider_trust", "(0,)", "1"),
        ),
    ):
        stream = TrustStream(Edges(what))
        with refuses(ValueError, "Turncoat()", "0", *words):
            stream.update(["ann", "bob"], ["shop", "shop"], [0.2, 0.4])


def test_a_model_that_cannot_start_is_named() -> None:
    class Stuck(Turncoat):
        def start(self, like: Any) -> Any:
            raise IndexError("lost")

    with refuses(ValueError, "Turncoat()", "IndexError"):
        TrustStream(Stuck(None), agents=(["ann"], ["shop"]))


def test_a_model_that_cannot_play_at_all_is_refused_at_once() -> None:
    with refuses(ValueError, "AttributeError", "NoneType"):
        Game(make_scenario("paper-3x3"), Broken(None))


class Writer(Turncoat):
    """Sound, but for what it writes to."""

    def update(self, state: Trusts, ratings: Ratings) -> Trusts:
        return self.what(self, state, ratings)


def forget_ratings(self: Any, state: Trusts, ratings: Ratings) -> Trusts:
    ratings.values[0] = 1
    return state


def widen_weights(self: Any, state: Trusts, ratings: Ratings) -> Trusts:
    ratings.weights[...] = 1
    return state


def change_the_state(self: Any, state: Trusts, ratings: Ratings) -> Trusts:
    state.top[...] *= 0.5
    return state


def remember_in_self(self: Any, state: Trusts, ratings: Ratings) -> Trusts:
    self.rounds = getattr(self, "rounds", 0) + 1
    return state._replace(top=0 * state.top + 1 / self.rounds)


@pytest.mark.parametrize("like", [np.zeros(()), torch.zeros(())], ids=["numpy", "torch"])
@pytest.mark.parametrize(
    "what", [forget_ratings, widen_weights, change_the_state, remember_in_self]
)
def test_a_model_that_is_no_function_is_refused_at_once(what: Any, like: Any) -> None:
    with refuses(ValueError, "Turncoat()"):
        Game(make_scenario("paper-3x3"), Writer(what), like)


def spread_over_games(self: Any, state: Trusts, ratings: Ratings) -> Trusts:
    return state._replace(top=0 * state.top + ratings.values[0].mean())


def test_a_model_that_compares_games_is_refused_at_once() -> None:
    with refuses(ValueError, "Turncoat()", "batch"):
        Game(make_scenario("paper-3x3"), Writer(spread_over_games))


@pytest.mark.parametrize("name", ["mask", "present"])
def test_an_update_with_a_third_argument_is_one_clear_error(name: str) -> None:
    namespace: dict[str, Any] = {"Turncoat": Turncoat}
    exec(
        f"class Old(Turncoat):\n    def update(self, state, ratings, {name}): return state",
        namespace,
    )
    with refuses(ValueError, f"update(state, ratings, {name})"):
        Game(make_scenario("paper-3x3"), namespace["Old"](None))


@pytest.mark.parametrize(
    "like", [np.zeros((), np.float32), torch.zeros(())], ids=["numpy", "torch"]
)
def test_a_read_out_in_another_precision_is_refused_at_once(like: Any) -> None:
    class Double(Turncoat):
        def rater_trust(self, state: Trusts) -> Any:
            return (
                np.asarray(state.tor, np.float64)
                if isinstance(like, np.ndarray)
                else state.tor.double()
            )

    with refuses(ValueError, "rater_trust", "float64", "float32"):
        Game(make_scenario("paper-3x3"), Double(None), like)


@pytest.mark.parametrize("read", [None, 0.5, [0.5, 0.5, 0.5]], ids=str)
def test_a_read_out_that_is_no_array_is_refused_at_once(read: Any) -> None:
    class NoArray(Turncoat):
        def rater_trust(self, state: Trusts) -> Any:
            return read

    with refuses(ValueError, "rater_trust", "ndarray", type(read).__name__):
        Game(make_scenario("paper-3x3"), NoArray(None))


def test_models_of_the_package_are_not_watched() -> None:
    assert needs_watching(Turncoat(fail))
    assert not any(
        needs_watching(roletrust_env.make_trust_model(name)) for name in ("role-trust", "mean")
    )
