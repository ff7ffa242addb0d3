"""`check_trust_model` refuses a model for each rule that it breaks, in one line that says what to
change."""

from typing import Any, NamedTuple

import numpy as np
import pytest

from roletrust_env.arrays import namespace
from roletrust_env.testing import check_trust_model
from roletrust_env.testing import trust_models as checks
from roletrust_env.trust import PROVIDER, Ratings, mean, smooth


class Means(NamedTuple):
    top: Any
    tor: Any


class Sound:
    """The mean rating of this round, where there is one."""

    rates_raters = False

    def __repr__(self) -> str:
        return "Model()"

    def start(self, like: Any) -> Any:
        return Means(
            0 * namespace(like).ones_like(like[0]) + 0.5,
            0 * namespace(like).ones_like(like[:, 0]) + 1,
        )

    def update(self, state: Any, ratings: Ratings) -> Any:
        top = mean(ratings, ratings.values, PROVIDER)
        return Means(namespace(top).where(ratings.rated(PROVIDER), top, state.top), state.tor)

    def rater_trust(self, state: Any) -> Any:
        return state.tor

    def provider_trust(self, state: Any) -> Any:
        return state.top


class WritesToState(Sound):
    def update(self, state: Any, ratings: Ratings) -> Any:
        after = super().update(state, ratings)
        state.top[...] = after.top
        return state


class WritesToRatings(Sound):
    def update(self, state: Any, ratings: Ratings) -> Any:
        after = super().update(state, ratings)
        ratings.values[...] = 0
        return after


class RemembersInItself(Sound):
    rounds = 0

    def update(self, state: Any, ratings: Ratings) -> Any:
        self.rounds += 1
        return super().update(state, ratings)


class IsRandom(Sound):
    def __init__(self) -> None:
        self.random = np.random.default_rng(0).random

    def update(self, state: Any, ratings: Ratings) -> Any:
        after = super().update(state, ratings)
        return after._replace(top=0.5 * after.top + 0.5 * self.random())


class DividesByNothing(Sound):
    def update(self, state: Any, ratings: Ratings) -> Any:
        with np.errstate(all="ignore"):
            return Means(ratings.values.sum(axis=0) / ratings.weights.sum(axis=0), state.tor)


class MixesGames(Sound):
    def update(self, state: Any, ratings: Ratings) -> Any:
        after = super().update(state, ratings)
        return after._replace(top=0.5 * after.top + 0.5 * after.top.mean())


class ChangesItsShapes(Sound):
    """Remembers one round more each time."""

    def update(self, state: Any, ratings: Ratings) -> Any:
        return (
            super()
            .update(state, ratings)
            ._replace(tor=namespace(state.tor).concat([state.tor, state.tor[:1]]))
        )

    def rater_trust(self, state: Any) -> Any:
        return state.tor[: 3 if len(state.tor) > 3 else None]


class CountsInAPythonNumber(Sound):
    def start(self, like: Any) -> Any:
        return (super().start(like), 0)

    def update(self, state: Any, ratings: Ratings) -> Any:
        return (super().update(state[0], ratings), state[1] + 1)

    def rater_trust(self, state: Any) -> Any:
        return state[0].tor

    def provider_trust(self, state: Any) -> Any:
        return state[0].top


class FavoursTheFirst(Sound):
    def update(self, state: Any, ratings: Ratings) -> Any:
        after = super().update(state, ratings)
        top = 1 * after.top
        top[0] = 1
        return after._replace(top=top)


class MistakesNone(Sound):
    def update(self, state: Any, ratings: Ratings) -> Any:
        return (
            super().update(state, ratings)
            if ratings.mask is not None
            else state._replace(top=0 * state.top + 0.1)
        )


class CountsInWholeNumbers(Sound):
    def update(self, state: Any, ratings: Ratings) -> Any:
        count = (ratings.weights > 0).sum(axis=0)
        return state._replace(
            top=smooth(mean(ratings, ratings.values, PROVIDER), state.top, 0.5, count)
        )


class NumpyOnly(Sound):
    def update(self, state: Any, ratings: Ratings) -> Any:
        top = np.where(ratings.rated(PROVIDER), np.array(ratings.values).max(axis=0), state.top)
        return Means(top.astype(ratings.values.dtype), state.tor)


def test_a_sound_model_passes() -> None:
    check_trust_model(Sound())


@pytest.mark.parametrize(
    ("model", "what"),
    [
        (
            WritesToState(),
            "changes the state it is given|changes the state that it is given; return a new one",
        ),
        (WritesToRatings(), "writes to the ratings|writes to its arguments; copy them"),
        (RemembersInItself(), "changes its own attributes; keep all memory in the state"),
        (IsRandom(), "it changes itself|two results"),
        (DividesByNothing(), r"outside \[0, 1\]"),
        (
            MixesGames(),
            "a game in a batch differs from the same game alone; reduce over axes 0 and 1 only",
        ),
        (ChangesItsShapes(), "update changes the shape or dtype of its state; keep both"),
        (CountsInAPythonNumber(), "the state holds 0; a state is a NamedTuple of arrays"),
        (
            CountsInWholeNumbers(),
            "smooth has a count of dtype int64; it must be float64, as the mean so far",
        ),
        (
            MistakesNone(),
            "a round without a mask differs from one with a mask that is true everywhere",
        ),
    ],
    ids=lambda model: type(model).__name__,
)
def test_each_broken_rule_is_named_in_one_line(model: Any, what: str) -> None:
    with pytest.raises((AssertionError, ValueError), match=what) as error:
        check_trust_model(model, torch=False)
    assert "\n" not in str(error.value)
    assert "Model()" in str(error.value)


@pytest.mark.parametrize(
    ("model", "check", "what"),
    [
        (WritesToState(), lambda m: checks.check_purity(m, (3, 3)), "changes the state"),
        (WritesToRatings(), lambda m: checks.check_purity(m, (3, 3)), "writes to its arguments"),
        (IsRandom(), lambda m: checks.check_purity(m, (3, 3)), "two results"),
    ],
    ids=lambda model: type(model).__name__,
)
def test_rules_that_one_round_shows_are_checked_in_every_round(
    model: Any, check: Any, what: str
) -> None:
    with pytest.raises(AssertionError, match=what):
        check(model)


def test_a_model_that_depends_on_the_order_of_agents_gets_a_hint() -> None:
    with pytest.warns(UserWarning, match="the order of the agents counts"):
        check_trust_model(FavoursTheFirst(), torch=False)


def test_a_model_for_numpy_only_is_told_what_to_change() -> None:
    pytest.importorskip("torch")
    check_trust_model(NumpyOnly(), torch=False)
    with pytest.raises(
        ValueError,
        match=r"game runs on torch float32: .*namespace\(ratings\.values\) in place of those of numpy",  # noqa: E501
    ):
        check_trust_model(NumpyOnly())


def test_a_class_and_another_object_are_refused() -> None:
    with pytest.raises(ValueError, match=r"is a class; check an object: Sound\(\)"):
        check_trust_model(Sound)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="is no trust model"):
        check_trust_model(3)  # type: ignore[arg-type]
