"""The other side for models in Python: the trust of a game, and one error for a bad message."""

import json
import sys

import numpy as np
import pytest
from refusals import refuses

from roletrust_env import evaluate, make_trust_model
from roletrust_env.testing.trust_models import play_rounds, random_rounds, read_trust
from roletrust_env.trust.model import registry
from roletrust_env.trust.models.central.means import Mean
from roletrust_env.trust.remote import RemoteModel, TrustService

SHAPE = (4, 3)


def message(game=1, round=0, ratings=(), shape=SHAPE, **changes):
    agents = dict(zip(("raters", "providers"), shape, strict=True))
    fields = {"game": game, "round": round, **agents, "ratings": list(ratings)}
    return json.dumps({**fields, **changes})


@pytest.mark.parametrize("name", registry.names())
def test_every_model_gives_the_trust_of_a_game(name):
    model, rounds = make_trust_model(name), list(random_rounds(SHAPE))
    service = TrustService(model)
    service.answer(message())
    for k, (ratings, mask) in enumerate(rounds, 1):
        given = [
            [int(i), int(j), float(ratings[i, j])] for i, j in zip(*np.nonzero(mask), strict=True)
        ]
        answer = json.loads(service.answer(message(round=k, ratings=given)))
    tor, top = read_trust(model, play_rounds(model, rounds, np.zeros(SHAPE), np.zeros(SHAPE, bool)))
    assert answer["providers"] == top.tolist()
    assert answer.get("raters") == (tor.tolist() if model.rates_raters else None)


def test_games_are_apart_and_can_end():
    service = TrustService(make_trust_model("role-trust"))
    for game in (1, 2):
        service.answer(message(game))
    service.answer(message(1, 1, [[0, 0, 1.0]]))
    first = service.answer(message(2, 1, [[0, 0, 0.0]]))
    assert service.answer(json.dumps({"over": [2, 3]})) is None
    with refuses(ValueError, "game", "2"):
        service.answer(message(2, 2))
    service.answer(message(2))
    assert service.answer(message(2, 1, [[0, 0, 0.0]])) == first


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("nonsense", ("JSON",)),
        ("[" * 100_000, ("JSON",)),
        ("[]", ("table",)),
        ('{"over": 3}', ("over", "3")),
        (message(game="x"), ("game",)),
        (message(round=-1), ("round",)),
        (message(raters=0), ("raters",)),
        (message(qualities=[]), ("qualities",)),
        (message(ratings=[[0, 0, 0.5]]), ("game", "1", "ratings")),
        (message(round=2), ("game 1", "round 2")),
        (message(game=2, round=1), ("game 2",)),
        (message(round=1, shape=(3, 3)), ("game 1", "4", "round 1", "3")),
        (message(round=1, ratings=[[4, 0, 0.5]]), ("game 1", "5", "4")),
        (message(round=1, ratings=[[0, -1, 0.5]]), ("ratings",)),
        (message(round=1, ratings=[[0, 0, 1.5]]), ("ratings",)),
        (message(round=1, ratings=[[0, 0, float("nan")]]), ("ratings",)),
        (message(round=True), ("round",)),
        (message(round=1, ratings=[[0, 0, "0.5"]]), ("ratings",)),
    ],
)
def test_a_bad_message_is_one_error_and_changes_nothing(line, words):
    service = TrustService(make_trust_model("role-trust"))
    service.answer(message())
    with refuses(ValueError, *words):
        service.answer(line)
    assert "providers" in json.loads(service.answer(message(round=1, ratings=[[0, 0, 0.5]])))


@pytest.mark.parametrize("shape", [(10**9, 3), (100_000, 100_000)])
def test_a_game_that_does_not_fit_is_refused(shape):
    service = TrustService(make_trust_model("role-trust"))
    service.answer(message())
    with refuses(MemoryError, f"{shape[0]:,}"):
        service.answer(message(shape=shape))
    with refuses(MemoryError, f"{shape[0] + 1:,}"):
        service.answer(message(round=1, ratings=[[shape[0], shape[1], 0.5]]))


def test_ratings_of_one_pair_count_as_their_mean():
    answers = set()
    for ratings in ([[0, 0, 0.5], [0, 0, 0.75]], [[0, 0, 0.625]]):
        service = TrustService(make_trust_model("role-trust"))
        service.answer(message())
        answers.add(service.answer(message(round=1, ratings=ratings)))
    assert len(answers) == 1


class Broken(Mean):
    def provider_trust(self, state):
        return super().provider_trust(state) + (2 if (state.top > 0.6).any() else 0)

    def update(self, state, ratings):
        if (ratings.values == 0.25).any():
            raise RuntimeError("a quarter")
        return super().update(state, ratings)


def test_a_model_that_fails_is_one_error():
    service = TrustService(Broken())
    service.answer(message())
    with refuses(ValueError, "0", "RuntimeError"):
        service.answer(message(round=1, ratings=[[0, 0, 0.25]]))
    with refuses(ValueError, "provider_trust", "2.75"):
        service.answer(message(round=1, ratings=[[0, 0, 1.0]]))
    assert "providers" in json.loads(service.answer(message(round=1, ratings=[[0, 0, 0.5]])))


def test_a_copy_of_a_game_goes_on_apart_from_it():
    service = TrustService(make_trust_model("mean"))
    assert json.loads(service.answer(message()))["copies"] is True
    service.answer(message(round=1, ratings=[[0, 0, 1.0]]))
    before = json.loads(service.answer(json.dumps({"game": 9, "copy": 1})))
    apart = json.loads(service.answer(message(9, round=2, ratings=[[0, 0, 0.0]])))
    assert before["providers"][0] > apart["providers"][0]
    assert json.loads(service.answer(json.dumps({"game": 8, "copy": 1}))) == before
    with refuses(ValueError, "game", "77"):
        service.answer(json.dumps({"game": 9, "copy": 77}))


def test_a_message_may_be_a_round_of_a_copy():
    service = TrustService(make_trust_model("mean"))
    service.answer(message())
    for game, rating in ((8, 1.0), (9, 0.0)):
        answer = json.loads(service.answer(message(game, 1, [[0, 0, rating]], copy=1)))
        assert (answer["providers"][0] > 0.5) == (rating > 0.5)


def served(folder, text, name):
    """A model of a module in a process of its own, as a program."""
    (folder / "their_own.py").write_text(text)
    code = f"import sys; sys.path.append({str(folder)!r}); "
    code += "from roletrust_env.trust.remote import main; main(sys.argv[1])"
    return RemoteModel(f"exec:{sys.executable} -c {code!r} their_own:{name}")


def test_the_service_answers_standard_input():
    address = f"exec:{sys.executable} -m roletrust_env.trust.remote beta:keep=0.8"
    apart, own = (
        evaluate(model, "bad-mouthing", "market", games=2)
        for model in (RemoteModel(address), make_trust_model("beta", keep=0.8))
    )
    assert apart.utility.mean == own.utility.mean


def test_a_model_that_fails_at_the_start_is_one_line_of_the_client(tmp_path):
    text = "from roletrust_env.trust.models.central.means import Mean\n"
    text += "class Fails(Mean):\n    def start(self, like):\n        raise KeyError('lost')\n"
    with refuses(ValueError, "KeyError", "lost"):
        served(tmp_path, text, "Fails").start(np.zeros(SHAPE))


def test_a_model_that_is_not_known_is_one_line_of_the_client(tmp_path):
    with refuses(ValueError, "Nobody", "1"):
        served(tmp_path, "", "Nobody").start(np.zeros(SHAPE))


def test_names_of_fields_are_escaped():
    with refuses(ValueError, "\\x1b[31m") as error:
        TrustService(Mean()).answer(message(**{"\x1b[31m": 1}))
    assert str(error.value).isprintable()
