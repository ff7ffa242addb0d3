"""A trust model as a service: the same trust as in a game, over both kinds of link, and one error
for bad messages."""

import json
import socket
import sys
import threading
import urllib.error
import urllib.request
from pathlib import Path

import numpy as np
import pytest
from refusals import refuses

from roletrust_env import evaluate, make_trust_model
from roletrust_env.testing.trust_models import play_rounds, random_rounds, read_trust
from roletrust_env.trust import service as services
from roletrust_env.trust.model import registry
from roletrust_env.trust.models.central.means import Mean
from roletrust_env.trust.outside import OutsideModel
from roletrust_env.trust.service import TrustService, http_server

SHAPE = (4, 3)


def message(game=1, round=0, ratings=(), shape=SHAPE, **changes):
    fields = {
        "game": game,
        "round": round,
        "raters": shape[0],
        "providers": shape[1],
        "ratings": list(ratings),
    }
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
        (message(raters=10**9), ("raters",)),
        (message(qualities=[]), ("qualities",)),
        (message(ratings=[[0, 0, 0.5]]), ("ratings",)),
        (message(round=2), ("game", "1")),
        (message(round=1, shape=(3, 3)), ("game", "1")),
        (message(round=1, ratings=[[4, 0, 0.5]]), ("1", "0", "4")),
        (message(round=1, ratings=[[0, -1, 0.5]]), ("ratings",)),
        (message(round=1, ratings=[[0, 0, 1.5]]), ("ratings",)),
        (message(round=1, ratings=[[0, 0, float("nan")]]), ("ratings",)),
        (message(round=True), ("round",)),
        (message(round=1, ratings=[[0, 0, "0.5"]]), ("ratings",)),
        (message(round=1, ratings=[[0, 0, 0.5], [0, 0, 0.7]]), ("1", "0")),
        (message(game=2, raters=100_000, providers=100_000), ("pairs",)),
    ],
)
def test_a_bad_message_is_one_error_and_changes_nothing(line, words):
    service = TrustService(make_trust_model("role-trust"))
    service.answer(message())
    with refuses(ValueError, *words):
        service.answer(line)
    assert "providers" in json.loads(service.answer(message(round=1, ratings=[[0, 0, 0.5]])))


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


def test_a_client_that_waits_holds_up_nobody():
    with http_server(TrustService(make_trust_model("mean")), "127.0.0.1", 0) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        with socket.create_connection(("127.0.0.1", server.server_port)):
            request = urllib.request.urlopen(
                f"http://127.0.0.1:{server.server_port}", message().encode(), timeout=10
            )
            assert "providers" in request.read().decode()
        server.shutdown()


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


def test_the_number_of_games_is_limited(monkeypatch):
    monkeypatch.setattr(services, "MOST_GAMES", 2)
    service = TrustService(make_trust_model("mean"))
    for game in (1, 2, 1):
        service.answer(message(game))
    with refuses(ValueError, "2"):
        service.answer(message(3))


def test_the_service_over_http_is_a_model_like_any_other():
    with http_server(TrustService(make_trust_model("role-trust")), "127.0.0.1", 0) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        address = f"http://127.0.0.1:{server.server_port}"
        found = evaluate(OutsideModel(address), "bad-mouthing", "market", games=3)
        with pytest.raises(urllib.error.HTTPError) as refused:
            urllib.request.urlopen(address, b"nonsense\n")
        assert refused.value.code == 400
        assert "there is no JSON" in refused.value.read().decode()
        server.shutdown()
    own = evaluate(make_trust_model("role-trust"), "bad-mouthing", "market", games=3)
    assert found.utility.mean == pytest.approx(own.utility.mean)


def test_the_command_answers_standard_input():
    program = Path(sys.executable).with_name("roletrust")
    found = evaluate(
        OutsideModel(f"exec:{program} serve beta:keep=0.8"), "bad-mouthing", "market", games=2
    )
    own = evaluate(make_trust_model("beta", keep=0.8), "bad-mouthing", "market", games=2)
    assert found.utility.mean == pytest.approx(own.utility.mean)


def test_a_model_that_fails_is_one_line_of_the_client(capfd):
    class Fails(Mean):
        def start(self, like):
            raise KeyError("lost")

    server = http_server(TrustService(Fails()), "127.0.0.1", 0)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    try:
        with refuses(ValueError, "status", "500"):
            OutsideModel(f"http://127.0.0.1:{server.server_port}").start(np.zeros(SHAPE))
    finally:
        server.shutdown()
        server.server_close()
    assert "Traceback" not in capfd.readouterr().err


def test_names_of_fields_are_escaped():
    with refuses(ValueError, "\\x1b[31m") as error:
        TrustService(Mean()).answer(message(**{"\x1b[31m": 1}))
    assert str(error.value).isprintable()
