"""Trust models in other processes: programs, services, our models and those of other packages."""

import copy
import gc
import json
import pickle
import shutil
import sys
import threading
from functools import partial
from http.server import HTTPServer
from typing import Any

import numpy as np
import pytest
from pages import HOUSE, blocks
from refusals import refuses

from roletrust_env import evaluate, make_scenario, make_trust_model
from roletrust_env.benchmarking.sources import hashes
from roletrust_env.evaluation.attackers import Scripted
from roletrust_env.evaluation.measurement import exact_task, score
from roletrust_env.evaluation.specs import (
    check_installed,
    is_own_model,
    named_factory,
    offered_parameters,
    parse_attacks,
    parse_trust_model,
)
from roletrust_env.testing import trust_models as checks
from roletrust_env.testing.trust_models import RoundRatings, play_rounds, random_rounds, read_trust
from roletrust_env.trust import Ratings, links, remote
from roletrust_env.trust.model import Traits, registry
from roletrust_env.trust.model_checks import needs_watching, try_trust_model
from roletrust_env.trust.random_order import RandomOrder
from roletrust_env.trust.remote import (
    IsolatedModel,
    RemoteModel,
)

PAGE = HOUSE / "docs/guide/outside.md"

ECHO = """
import json, sys
for line in sys.stdin:
    message = json.loads(line)
    if "over" not in message:
        print(json.dumps({answer}), flush=True)
"""


def program(folder, text):
    """The address of a Python program."""
    path = folder / "program.py"
    path.write_text(text)
    return f"exec:{sys.executable} {path}"


def echo(folder, answer):
    """The address of a program that answers every message with an expression."""
    return program(folder, ECHO.format(answer=answer))


def played(address, ratings=0.8, raters=2, providers=2):
    """The model and its state after one round of equal ratings."""
    model = RemoteModel(address)
    rounds = np.full((raters, providers, 3), ratings)
    return model, model.update(model.start(np.zeros(rounds.shape)), Ratings(rounds, rounds > 0))


@pytest.fixture(scope="module")
def service():
    """The address of the service on the page, in a thread."""
    names = {"__name__": "service"}
    exec(compile(blocks(PAGE, "python")[0], "service", "exec"), names)
    server = HTTPServer(("127.0.0.1", 0), names["Service"])
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{server.server_port}"
    server.shutdown()


@pytest.fixture
def script(tmp_path):
    """The address of the program in JavaScript on the page."""
    if not shutil.which("node"):
        pytest.skip("there is no Node.js")
    (tmp_path / "mean.js").write_text(blocks(PAGE, "javascript")[0])
    return f"exec:node {tmp_path / 'mean.js'}"


@pytest.fixture(params=["service", "script"])
def address(request):
    return request.getfixturevalue(request.param)


def test_the_examples_have_the_numbers_of_the_model_inside(address):
    outside, inside = (
        evaluate(model, "bad-mouthing", "market", games=3) for model in (address, "mean")
    )
    for one, other in zip(
        outside[:4], inside[:4], strict=True
    ):  # but the mean rates no raters, and so has no AUC
        assert one[:2] == pytest.approx(other[:2], abs=1e-9)


def test_they_keep_to_the_contract(service):
    model = RemoteModel(service)
    for shape in ((3, 3), (2, 5, 6)):
        checks.check_kinds(model, shape, np.float32)
        checks.check_silence(model, shape)
        checks.check_batch(model, (*shape[:2], 3))
    checks.check_permutation(model)
    checks.check_torch(model, (3, 4))


def test_the_model_gets_ratings_and_nothing_else(tmp_path):
    log = tmp_path / "log"
    text = f"import sys, json\nlog = open({str(log)!r}, 'w')\n" + ECHO.replace(
        "    message =", "    print(line, end='', file=log, flush=True)\n    message ="
    ).format(answer="{'providers': [0.5] * message['providers']}")
    model = RemoteModel(program(tmp_path, text))
    ratings = np.array([[0.25, 0.5], [0.75, 1.0]])
    model.update(
        model.start(np.zeros((2, 2))), Ratings(ratings, np.array([[True, False], [True, True]]))
    )
    *begun, round = map(json.loads, log.read_text().splitlines())
    number = begun[-1]["game"]
    for message in begun:
        del message["game"]
        assert message == {"round": 0, "raters": 2, "providers": 2, "ratings": []}
    listed = [[0, 0, 0.25], [1, 0, 0.75], [1, 1, 1.0]]
    assert round == {"game": number, "round": 1, "raters": 2, "providers": 2, "ratings": listed}


def test_the_messages_on_the_page_are_those_of_the_protocol(tmp_path):
    message, answer = map(json.loads, blocks(PAGE, "json"))
    shape, ratings = (message["raters"], message["providers"]), np.full((4, 2), np.nan)
    for rater, provider, rating in message["ratings"]:
        ratings[rater, provider] = rating
    assert (
        json.loads(remote._line(message["game"], message["round"], shape, message["ratings"]))
        == message
    )
    model = RemoteModel(echo(tmp_path, repr(answer)))
    state = model.update(model.start(np.zeros(shape)), Ratings(ratings, ratings == ratings))
    assert model.provider_trust(state).tolist() == answer["providers"]
    assert model.rater_trust(state).tolist() == answer["raters"]


def test_the_service_in_python_on_the_page_answers():
    names: dict[str, Any] = {}
    exec(compile(blocks(PAGE, "python")[1], "page", "exec"), names)
    before, after = map(json.loads, names["answers"])
    assert before["providers"] == [0.5]
    assert after["providers"][0] > 0.5


def test_trust_of_raters_is_there_if_the_model_has_it(tmp_path):
    providers = "[0.2, 0.3][:message['providers']]"
    without, _ = played(echo(tmp_path, f"{{'providers': {providers}}}"))
    assert not without.rates_raters
    raters = "[0.6, 1][:message['raters']]"
    with_raters, state = played(echo(tmp_path, f"{{'providers': {providers}, 'raters': {raters}}}"))
    assert with_raters.rates_raters
    np.testing.assert_array_equal(with_raters.rater_trust(state), [[0.6] * 3, [1] * 3])
    np.testing.assert_array_equal(with_raters.provider_trust(state), [[0.2] * 3, [0.3] * 3])


@pytest.mark.parametrize(
    ("answer", "words"),
    [
        ("{'raters': [1, 1]}", ("(2, 0)",)),
        ("[0.5, 0.5]", ("[0.5, 0.5]",)),
        ("{'providers': [0.5]}", ("(2, 1)",)),
        ("{'providers': [0.5, 1.5]}", ("providers",)),
        ("{'providers': [0.5, True]}", ("providers",)),
        ("{'providers': [0.5, float('nan')]}", ("providers",)),
        ("{'providers': [0.5, 0.5], 'raters': 'all'}", ("raters", "'all'")),
        ("{'providers': [0.5, 0.5], 'raters': [0.5]}", ("(1, 2)",)),
        ("{'error': 'two\\nlines'}", ("two\\nlines",)),
        ("exit(3)", ("3",)),
        ("1 / 0", ("1", "ZeroDivisionError")),
        ("print('trust')", ("trust",)),
    ],
)
def test_a_wrong_answer_is_one_clear_error(tmp_path, answer, words):
    with refuses(ValueError, *words):
        played(echo(tmp_path, answer))


@pytest.mark.parametrize(
    ("address", "word"),
    [
        ("exec:./not-there", "RemoteModel('exec:./not-there')"),
        ("exec:'", 'RemoteModel("exec:\'")'),
        ("http://127.0.0.1:9", "refused"),
        ("exec:", "exec:COMMAND"),
        ("http://", "exec:COMMAND"),
        ("ftp:there", "exec:COMMAND"),
    ],
)
def test_what_is_not_there_is_one_clear_error(address, word):
    with refuses(ValueError, word):
        played(address)


def test_a_game_does_not_go_back(service):
    model = RemoteModel(service)
    start = model.start(np.zeros((2, 2)))
    ratings = np.full((2, 2), 0.9)
    first = model.update(start, Ratings(ratings, ratings > 0))
    again = model.update(
        start, Ratings(ratings, ratings > 0)
    )  # a game without ratings begins again
    assert (model.provider_trust(first) == model.provider_trust(again)).all()
    model.update(first, Ratings(ratings, ratings > 0))
    with refuses(ValueError, "round", "1"):
        model.update(first, Ratings(ratings, ratings > 0))


def test_old_games_are_forgotten(service, monkeypatch):
    monkeypatch.setattr(remote, "MOST_GAMES", 4)
    model, ratings = RemoteModel(service), np.full((2, 2, 3), 0.9)
    play = partial(model.update, ratings=Ratings(ratings, ratings > 0))
    old = play(model.start(ratings))
    play(model.start(ratings))
    with refuses(ValueError, "round", "1"):
        play(old)


def test_the_process_ends_with_the_model(tmp_path):
    model, _ = played(echo(tmp_path, "{'providers': [0.2, 0.3]}"))
    process = model._link._process
    assert process.poll() is None
    del model
    assert process.wait(60) is not None


def test_a_copy_has_a_process_of_its_own(tmp_path):
    model, _ = played(echo(tmp_path, "{'providers': [0.2, 0.3]}"))
    for other in (copy.deepcopy(model), pickle.loads(pickle.dumps(model))):
        assert other.address == model.address
        assert other._link is not model._link


def test_the_hash_follows_the_program(tmp_path):
    address = echo(tmp_path, "{}")
    before = hashes({"model": named_factory(registry, address)})
    assert before == hashes({"model": named_factory(registry, address)})
    echo(tmp_path, "[]")
    assert before != hashes({"model": named_factory(registry, address)})


def test_a_file_may_not_name_a_program():
    with refuses(ValueError, "exec:rm -r results", "--allow-code"):
        check_installed(registry, ["exec:rm -r results"])


def test_an_address_is_a_model_wherever_a_name_is(service):
    scenario = make_scenario("paper-3x3")
    assert parse_trust_model(service, scenario).address == service
    with refuses(ValueError, "exec"):
        make_trust_model("exec")


# --- models in processes of their own

SCENARIO = make_scenario("market").change(max_cycles=8, lam=0.75)
OFFERED = offered_parameters(SCENARIO)
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

class Hanging(Mean):
    def update(self, state, ratings):
        import time
        time.sleep(60)

class NotNumbers(Mean):
    def provider_trust(self, state):
        return super().provider_trust(state) * float("nan")

class Comparing(Mean):
    # Checks before a game have three games in a batch.
    def update(self, state, ratings):
        after = super().update(state, ratings)
        return after._replace(top=after.top * (0.5 if after.top[0].size > 3 else 1))

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
    return IsolatedModel("mean", OFFERED)


def scores(model: Any) -> Any:
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
    inside, apart = parse_trust_model(text, SCENARIO), IsolatedModel(text, OFFERED)
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
    isolated = IsolatedModel("block", {"lam": 0.7, "initial": 0.5})
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
        model.update(state._replace(number=state.number + np.arange(2)), Ratings(like, like == 0))


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("Leaving", ("unruly_models:Leaving",)),
        ("Raising", ("unruly_models:Raising", "KeyError")),
        ("Objects", ("unruly_models:Objects",)),
        ("Shapeless", ("unruly_models:Shapeless", "provider_trust")),
        ("NotNumbers", ("unruly_models:NotNumbers", "nan")),
        ("Comparing", ("unruly_models:Comparing", "alone")),
        ("Nobody", ("unruly_models:Nobody",)),
    ],
)
def test_a_model_that_misbehaves_is_one_clear_error(
    models: str, name: str, words: tuple[str, ...]
) -> None:
    with refuses(ValueError, name, *words):
        scores(IsolatedModel(f"{models}:{name}", OFFERED))


def test_a_model_that_hangs_is_one_clear_error(models: str, monkeypatch: Any) -> None:
    model = IsolatedModel(f"{models}:Hanging", OFFERED)
    monkeypatch.setattr(links, "LIMIT_S", 0.5)
    with refuses(ValueError, "Hanging", "0.5"):
        scores(model)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_floats_come_back_exactly(mean: IsolatedModel, dtype: Any) -> None:
    own, rng = make_trust_model("mean", **OFFERED), np.random.default_rng(0)
    rounds = [
        RoundRatings(rng.random((4, 3, 5)).astype(dtype), rng.random((4, 3, 5)) < 0.5)
        for _ in range(3)
    ]
    like, nobody = np.zeros((4, 3, 5), dtype), np.zeros((4, 3), bool)
    trusts = [read_trust(model, play_rounds(model, rounds, like, nobody)) for model in (own, mean)]
    for inside, apart in zip(*trusts, strict=True):
        assert inside.dtype == apart.dtype == dtype
        np.testing.assert_array_equal(inside, apart)


def test_a_model_may_print(models: str) -> None:
    inside = scores(parse_trust_model("mean", SCENARIO))
    apart = scores(IsolatedModel(f"{models}:Talking", OFFERED))
    np.testing.assert_array_equal(inside["utility"], apart["utility"])


def test_both_processes_end_with_the_model() -> None:
    model = IsolatedModel("mean", OFFERED)
    processes = [one._link._process for one in (model, model._second)]
    assert [process.poll() for process in processes] == [None, None]
    del model
    gc.collect()
    assert None not in [process.wait(60) for process in processes]


def test_games_that_branch_are_the_same_alone(mean: IsolatedModel) -> None:
    rng, peers = np.random.default_rng(0), np.zeros((2, 3), bool)
    for batch in ((), (5,), (2, 9)):
        state = mean.start(np.zeros((2, 3, *batch)), peers)
        for _ in range(3):
            values = rng.random((2, 3, *batch))
            mean.update(state, Ratings(values, None))
            state = mean.update(state, Ratings(values, values == values))


def test_torch_is_refused(mean: IsolatedModel) -> None:
    torch = pytest.importorskip("torch")
    with refuses(ValueError, "ndarray", "Tensor"):
        try_trust_model(mean, np.zeros((2, 1), bool), torch.zeros(2, 1, 1, dtype=torch.float64))


def test_models_of_the_project_are_known_without_an_import(
    models: str, mean: IsolatedModel
) -> None:
    assert is_own_model("role-trust:lam=0.7")
    assert not is_own_model(f"{models}:Talking")
    assert not is_own_model("no-such-model")
    assert needs_watching(mean)
