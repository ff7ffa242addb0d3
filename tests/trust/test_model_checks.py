"""A trust model of another package that goes wrong in the middle of a game is named, with the
round."""

from typing import Any, NamedTuple

import numpy as np
import pytest
import torch

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
    ("what", "complaint"),
    [
        (lambda top: top * np.nan, "provider_trust holds nan"),
        (lambda top: top + 1, r"provider_trust holds 1\.5; a trust must lie in \[0, 1\]"),
        (lambda top: top[:1], r"provider_trust has shape \(1,.*\); it must be \(3,"),
        (
            lambda top: 0.5,
            "provider_trust is of type float; it must be a (ndarray|Tensor) of shape",
        ),
        (lambda top: top > 0, r"provider_trust is of dtype .*bool; it must be .*float"),
        (fail, "KeyError: 'lost'"),
    ],
    ids=["nan", "out of range", "shape", "no array", "dtype", "raises"],
)


@WRONG
@pytest.mark.parametrize("like", [np.zeros(()), torch.zeros(())], ids=["numpy", "torch"])
def test_it_is_named_with_the_round(what: Any, complaint: str, like: Any) -> None:
    game = Game(make_scenario("paper-3x3"), Turncoat(what), like)
    with pytest.raises(ValueError, match=rf"trust model Turncoat\(\), round 2: {complaint}"):
        record(JointPolicy(game, {}), game.random(0), (4,))


@WRONG
def test_an_environment_stays_as_it_was(what: Any, complaint: str) -> None:
    env = roletrust_env.parallel_env("paper-3x3", Turncoat(what))
    env.reset(seed=0)
    actions = {agent: env.action_space(agent).sample() for agent in env.agents}
    env.step(actions)
    env.step(actions)
    before = env.state()
    with pytest.raises(ValueError, match=complaint):
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
    for what, complaint in (
        (fail, "KeyError: 'lost'"),
        (lambda state: None, "AttributeError: 'NoneType'"),
        (lambda state: EdgeState(state.raters * np.nan, state.providers), "rater_trust holds nan"),
        (
            lambda state: EdgeState(state.raters, state.providers[1:]),
            r"provider_trust has shape \(0,\); it must be \(1,",
        ),
    ):
        stream = TrustStream(Edges(what))
        with pytest.raises(ValueError, match=rf"trust model Turncoat\(\), round 0: {complaint}"):
            stream.update(["ann", "bob"], ["shop", "shop"], [0.2, 0.4])


def test_a_model_that_cannot_start_is_named() -> None:
    class Stuck(Turncoat):
        def start(self, like: Any) -> Any:
            raise IndexError("lost")

    with pytest.raises(
        ValueError, match=r"trust model Turncoat\(\) cannot start: IndexError: lost"
    ):
        TrustStream(Stuck(None), agents=(["ann"], ["shop"]))


def test_a_model_that_cannot_play_at_all_is_refused_at_once() -> None:
    with pytest.raises(ValueError, match="cannot play one round: AttributeError: 'NoneType'"):
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
    ("what", "complaint"),
    [
        (forget_ratings, "writes to the ratings or to the mask"),
        (widen_weights, "writes to the ratings or to the mask"),
        (change_the_state, "twice alike: it changes the state it is given"),
        (remember_in_self, "twice alike: it changes itself"),
    ],
)
def test_a_model_that_is_no_function_is_refused_at_once(
    what: Any, complaint: str, like: Any
) -> None:
    with pytest.raises(
        ValueError, match=rf"trust model Turncoat\(\) cannot play one round.*{complaint}"
    ):
        Game(make_scenario("paper-3x3"), Writer(what), like)


def spread_over_games(self: Any, state: Trusts, ratings: Ratings) -> Trusts:
    return state._replace(top=0 * state.top + ratings.values[0].mean())


def test_a_model_that_compares_games_is_refused_at_once() -> None:
    with pytest.raises(ValueError, match="a game in a batch differs from the same game alone"):
        Game(make_scenario("paper-3x3"), Writer(spread_over_games))


@pytest.mark.parametrize("name", ["mask", "present"])
def test_an_update_with_a_third_argument_is_one_clear_error(name: str) -> None:
    namespace: dict[str, Any] = {"Turncoat": Turncoat}
    exec(
        f"class Old(Turncoat):\n    def update(self, state, ratings, {name}): return state",
        namespace,
    )
    wanted = rf"has update\(state, ratings, {name}\); it must be update\(state, ratings\)"
    with pytest.raises(ValueError, match=wanted) as error:
        Game(make_scenario("paper-3x3"), namespace["Old"](None))
    assert "\n" not in str(error.value)


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

    with pytest.raises(
        ValueError, match=r"rater_trust is of dtype .*float64; it must be .*float32"
    ):
        Game(make_scenario("paper-3x3"), Double(None), like)


@pytest.mark.parametrize("read", [None, 0.5, [0.5, 0.5, 0.5]], ids=str)
def test_a_read_out_that_is_no_array_is_refused_at_once(read: Any) -> None:
    class NoArray(Turncoat):
        def rater_trust(self, state: Trusts) -> Any:
            return read

    with pytest.raises(
        ValueError, match=f"rater_trust is of type {type(read).__name__}; it must be a ndarray"
    ):
        Game(make_scenario("paper-3x3"), NoArray(None))


def test_models_of_the_package_are_not_watched() -> None:
    assert needs_watching(Turncoat(fail))
    assert not any(
        needs_watching(roletrust_env.make_trust_model(name)) for name in ("role-trust", "mean")
    )
