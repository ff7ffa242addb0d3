"""Trust models in processes of their own: the same numbers, and no harm to the game."""

import gc
import os
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from refusals import refuses

from roletrust_env import make_scenario, make_trust_model
from roletrust_env.evaluation import isolated
from roletrust_env.evaluation.attackers import Scripted
from roletrust_env.evaluation.isolated import IsolatedModel
from roletrust_env.evaluation.measurement import Scores, exact_task, score
from roletrust_env.evaluation.specs import is_own_model, parse_attacks, parse_trust_model
from roletrust_env.testing.trust_models import play_rounds, random_rounds
from roletrust_env.trust import Ratings
from roletrust_env.trust.model import Traits
from roletrust_env.trust.model_checks import needs_watching
from roletrust_env.trust.random_order import RandomOrder

SCENARIO = make_scenario("market").change(max_cycles=8, lam=0.75)
MODELS = """
import os
from roletrust_env.trust.models.central.means import Mean

class Leaving(Mean):
    def update(self, state, ratings):
        os._exit(3)

class Talking(Mean):
    def update(self, state, ratings):
        print("Let me speak", flush=True)
        return super().update(state, ratings)

class Raising(Mean):
    def update(self, state, ratings):
        raise KeyError("two\\nlines")

class Objects(Mean):
    def provider_trust(self, state):
        import numpy as np
        return np.array([print] * len(super().provider_trust(state)), object)

class Shapeless(Mean):
    def provider_trust(self, state):
        return super().provider_trust(state)[:-1]
"""


@pytest.fixture(scope="module")
def models(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """Module with models that misbehave."""
    folder = tmp_path_factory.mktemp("models")
    (folder / "unruly_models.py").write_text(MODELS)
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(folder))
        yield "unruly_models"


@pytest.fixture(scope="module")
def mean() -> IsolatedModel:
    """A process starts in a second, so tests that need no fresh one share it."""
    return IsolatedModel("mean", SCENARIO)


def scores(model: Any) -> Scores:
    policies = parse_attacks(["sr_0=rank-lies", "sr_1=rank-lies"], SCENARIO)
    task = exact_task(
        {
            "scenario": SCENARIO,
            "trust_model": model,
            "compromised": tuple(policies),
            "objective": "mislead",
            "consumers": "raters",
        }
    )
    return score(task, Scripted(policies), 0, (1, 6)).scores


@pytest.mark.parametrize(("text", "seated"), [("role-trust", False), ("qor:theta=0.9", True)])
def test_a_model_scores_the_same_in_a_process_of_its_own(text: str, seated: bool) -> None:
    inside, apart = parse_trust_model(text, SCENARIO), IsolatedModel(text, SCENARIO)
    assert hasattr(inside, "judge_trust") == hasattr(apart, "judge_trust")
    assert (Traits.of(inside).rates_raters, Traits.of(inside).family) == (
        apart.rates_raters,
        apart.family,
    )
    found = [scores(RandomOrder(model, 3) if seated else model) for model in (inside, apart)]
    for name, values in found[0].items():
        np.testing.assert_array_equal(values, found[1][name])


def test_its_choice_rule_is_that_of_the_model() -> None:
    own, rounds, nobody = (
        make_trust_model("block"),
        random_rounds((4, 3, 2)),
        np.zeros((4, 3), bool),
    )
    isolated = IsolatedModel("block", make_scenario("paper-3x3"))
    plain, state = (
        play_rounds(one, rounds, np.zeros((4, 3, 2)), nobody) for one in (own, isolated)
    )
    noise = np.random.default_rng(0).random((4, 3, 2))
    np.testing.assert_array_equal(isolated.preference(state, noise), own.preference(plain, noise))


def test_it_learns_the_settings_of_the_scenario(mean: IsolatedModel) -> None:
    like, peers = np.zeros((2, 1, 1)), np.zeros((2, 1), bool)
    state = mean.update(mean.start(like, peers), Ratings(like, like == 0))
    assert mean.provider_trust(state) == pytest.approx(0.125)  # a quarter of the initial 0.5


def test_games_go_on_from_the_latest_states_only(mean: IsolatedModel) -> None:
    model, like = mean, np.zeros((2, 1, 2))
    first = state = model.start(like, like[..., 0] > 0)
    for _ in range(7):
        state = model.update(state, Ratings(like, like == 0))
    again = model.update(first, Ratings(like, like == 0))  # the eighth state back
    assert again.top == pytest.approx(0.125)
    with refuses(ValueError, "8"):
        model.update(first, Ratings(like, like == 0))
    with refuses(ValueError, "mean"):
        model.update(state._replace(number=np.array([1, 2])), Ratings(like, like == 0))


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("Leaving", ("unruly_models:Leaving",)),
        ("Raising", ("unruly_models:Raising", "KeyError")),
        ("Objects", ("unruly_models:Objects",)),
        ("Shapeless", ("unruly_models:Shapeless", "provider_trust")),
        ("Nobody", ("unruly_models:Nobody",)),
    ],
)
def test_a_model_that_misbehaves_is_one_clear_error(
    models: str, name: str, words: tuple[str, ...]
) -> None:
    with refuses(ValueError, name, *words):
        scores(IsolatedModel(f"{models}:{name}", SCENARIO))


def test_a_model_may_print(models: str) -> None:
    inside = scores(parse_trust_model("mean", SCENARIO))
    apart = scores(IsolatedModel(f"{models}:Talking", SCENARIO))
    np.testing.assert_array_equal(inside["utility"], apart["utility"])


def test_the_process_ends_with_the_model() -> None:
    model = IsolatedModel("mean", SCENARIO)
    process = Path(f"/proc/{model._process.pid}")
    assert process.exists() or os.name != "posix"
    del model
    gc.collect()
    until = time.monotonic() + 60
    while process.exists() and time.monotonic() < until:
        time.sleep(0.05)
    assert not process.exists()


def test_of_many_batches_the_latest_and_some_earlier_ones_are_played_again() -> None:
    kept = [0] * 200
    for _ in range(40):
        model: Any = object.__new__(IsolatedModel)
        model._traces, model._starts = [], 0
        for number in range(200):
            model._follow(number)
            assert len(model._traces) == min(number + 1, isolated._STARTS)
        assert model._traces[-isolated._LATEST :] == list(range(194, 200))
        for number in model._traces:
            kept[number] += 1
    thirds = [sum(kept[k : k + 64]) for k in (0, 64, 128)]  # 230 each is meant
    assert min(thirds) > 150


@pytest.mark.slow
def test_games_that_branch_are_the_same_alone(mean: IsolatedModel) -> None:
    rng, peers = np.random.default_rng(0), np.zeros((2, 3), bool)
    for batch in ((), (5,), (2, 9)):
        state = mean.start(np.zeros((2, 3, *batch)), peers)
        for _ in range(3):
            values = rng.random((2, 3, *batch))
            mean.update(state, Ratings(values, None))
            state = mean.update(state, Ratings(values, values == values))
    mean.check_alone()


def test_torch_is_refused(mean: IsolatedModel) -> None:
    torch = pytest.importorskip("torch")
    with refuses(ValueError, "NumPy", "Tensor"):
        mean.start(torch.zeros(2, 1), None)


def test_models_of_the_project_are_known_without_an_import(
    models: str, mean: IsolatedModel
) -> None:
    assert is_own_model("role-trust:lam=0.7")
    assert not is_own_model(f"{models}:Talking")
    assert not is_own_model("no-such-model")
    assert needs_watching(mean)
