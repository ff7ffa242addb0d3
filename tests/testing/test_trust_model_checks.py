"""`check_trust_model` refuses a model for each rule that it breaks, in one line that says what to
change."""

from typing import Any, NamedTuple

import numpy as np
import pytest
from refusals import refuses

from roletrust_env.arrays import namespace
from roletrust_env.testing import check_trust_model
from roletrust_env.testing import trust_models as checks
from roletrust_env.trust import PROVIDER, Mean, Ratings, mean, smooth


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
    ("model", "words"),
    [
        (
            WritesToState(),
            ("state",),
        ),
        (WritesToRatings(), ("Model()",)),
        (RemembersInItself(), ("attributes",)),
        (IsRandom(), ("Model()",)),
        (DividesByNothing(), ("provider_trust", "[0, 1]")),
        (
            MixesGames(),
            ("batch",),
        ),
        (ChangesItsShapes(), ("update", "dtype")),
        (CountsInAPythonNumber(), ("0", "NamedTuple")),
        (
            CountsInWholeNumbers(),
            ("smooth", "int64", "float64"),
        ),
        (
            MistakesNone(),
            ("mask", "ratings.weights"),
        ),
    ],
    ids=lambda model: type(model).__name__,
)
def test_each_broken_rule_is_named_in_one_line(model: Any, words: tuple[str, ...]) -> None:
    with refuses((AssertionError, ValueError), *words, "Model()"):
        check_trust_model(model, torch=False)


@pytest.mark.parametrize(
    ("model", "check", "word"),
    [
        (WritesToState(), lambda m: checks.check_purity(m, (3, 3)), "state"),
        (WritesToRatings(), lambda m: checks.check_purity(m, (3, 3)), "arguments"),
        (IsRandom(), lambda m: checks.check_purity(m, (3, 3)), "Model()"),
    ],
    ids=lambda model: type(model).__name__,
)
def test_rules_that_one_round_shows_are_checked_in_every_round(
    model: Any, check: Any, word: str
) -> None:
    with refuses(AssertionError, word):
        check(model)


def test_a_model_that_depends_on_the_order_of_agents_gets_a_hint() -> None:
    with pytest.warns(UserWarning, match=r"Model\(\)"):
        check_trust_model(FavoursTheFirst(), torch=False)


def test_a_model_for_numpy_only_is_told_what_to_change() -> None:
    pytest.importorskip("torch")
    check_trust_model(NumpyOnly(), torch=False)
    with refuses(ValueError, "torch", "float32", "ratings.values"):
        check_trust_model(NumpyOnly())


def test_a_class_and_another_object_are_refused() -> None:
    with refuses(ValueError, "Sound()"):
        check_trust_model(Sound)  # type: ignore[arg-type]
    with refuses(ValueError, "3"):
        check_trust_model(3)  # type: ignore[arg-type]


class Looping(Mean):
    """A model for one game, which loops over providers."""

    def update(self, state, ratings):
        trust = np.zeros(ratings.values.shape[1])
        for provider in range(len(trust)):
            trust[provider] = ratings.values[:, provider].mean()
        return state._replace(top=trust)


def test_a_model_that_loops_over_providers_is_told_the_shape():
    with refuses(ValueError, "Looping", "(3,)", "(3, 1)", "(3, 3, 1)"):
        check_trust_model(Looping())
