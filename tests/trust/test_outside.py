"""Trust models outside the process: programs, services, their errors, and what they cannot do."""

import copy
import json
import pickle
import shutil
import socket
import sys
import threading
import time
from contextlib import suppress
from http.server import HTTPServer

import numpy as np
import pytest
from pages import HOUSE, blocks
from refusals import refuses

import roletrust_env
from roletrust_env import evaluate, make_scenario
from roletrust_env.benchmarking.sources import hashes
from roletrust_env.evaluation.specs import check_installed, named_factory, parse_trust_model
from roletrust_env.testing import trust_models as checks
from roletrust_env.trust import Ratings, outside
from roletrust_env.trust.model import registry
from roletrust_env.trust.outside import HttpLink, LinkError, OutsideModel, ProcessLink

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
    model = OutsideModel(address)
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
    model = OutsideModel(service)
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
    model = OutsideModel(program(tmp_path, text))
    ratings = np.array([[0.25, 0.5], [0.75, 1.0]])
    model.update(
        model.start(np.zeros((2, 2))), Ratings(ratings, np.array([[True, False], [True, True]]))
    )
    begun, round = map(json.loads, log.read_text().splitlines())
    number = begun.pop("game")
    assert begun == {"round": 0, "raters": 2, "providers": 2, "ratings": []}
    listed = [[0, 0, 0.25], [1, 0, 0.75], [1, 1, 1.0]]
    assert round == {"game": number, "round": 1, "raters": 2, "providers": 2, "ratings": listed}


def test_the_messages_on_the_page_are_those_of_the_protocol(tmp_path):
    message, answer = map(json.loads, blocks(PAGE, "json"))
    shape, ratings = (message["raters"], message["providers"]), np.full((4, 2), np.nan)
    for rater, provider, rating in message["ratings"]:
        ratings[rater, provider] = rating
    sent = outside._request(message["game"], message["round"], shape, message["ratings"])
    assert json.loads(sent) == message
    model = OutsideModel(echo(tmp_path, repr(answer)))
    state = model.update(model.start(np.zeros(shape)), Ratings(ratings, ratings == ratings))
    assert model.provider_trust(state).tolist() == answer["providers"]
    assert model.rater_trust(state).tolist() == answer["raters"]


def test_trust_of_raters_is_there_if_the_model_has_it(tmp_path):
    without, _ = played(echo(tmp_path, "{'providers': [0.2, 0.3]}"))
    assert not without.rates_raters
    with_raters, state = played(echo(tmp_path, "{'providers': [0.2, 0.3], 'raters': [0.6, 1]}"))
    assert with_raters.rates_raters
    np.testing.assert_array_equal(with_raters.rater_trust(state), [[0.6] * 3, [1] * 3])
    np.testing.assert_array_equal(with_raters.provider_trust(state), [[0.2] * 3, [0.3] * 3])


@pytest.mark.parametrize(
    ("answer", "words"),
    [
        ("{'raters': [1, 1]}", ("providers",)),
        ("[0.5, 0.5]", ("providers",)),
        ("{'providers': [0.5]}", ("'providers' is", "2")),
        ("{'providers': [0.5, 1.5]}", ("providers",)),
        ("{'providers': [0.5, True]}", ("providers",)),
        ("{'providers': [0.5, float('nan')]}", ("providers",)),
        ("{'providers': [0.5, 0.5], 'raters': 'all'}", ("'raters' is", "2")),
        ("exit(3)", ("3",)),
        ("1 / 0", ("1", "ZeroDivisionError")),
        ("print('trust')", ("JSON",)),
    ],
)
def test_a_wrong_answer_is_one_clear_error(tmp_path, answer, words):
    with refuses(ValueError, *words):
        played(echo(tmp_path, answer))


def test_who_does_not_answer_is_ended(tmp_path):
    link = ProcessLink(
        program(tmp_path, "import sys\nsys.stdin.read()").removeprefix("exec:"), limit_s=0.2
    )
    with refuses(ValueError, "0.2"):
        link.ask(["{}"])
    assert link._process.poll() is not None


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("import os, time; os.close(1); time.sleep(60)", ()),
        (
            "import sys; print('no \\x1b[2J\\a', file=sys.stderr); exit(3)",
            ("3", "\\x1b[2J\\x07"),
        ),
    ],
)
def test_a_process_that_stops_to_answer_is_one_line_at_once(tmp_path, monkeypatch, text, words):
    monkeypatch.setattr(outside, "_ENDS_S", 0.1)
    link, began = ProcessLink(program(tmp_path, text).removeprefix("exec:")), time.monotonic()
    for _ in range(2):
        with refuses(ValueError, *words):
            link.ask(["{}"])
    assert time.monotonic() - began < 30


def test_a_process_that_does_not_listen_holds_nobody_up(tmp_path):
    link = ProcessLink(
        program(tmp_path, "import time; time.sleep(60)").removeprefix("exec:"), limit_s=0.2
    )
    link.tell("1" * 1_000_000)
    with refuses(ValueError, "0.2"):
        link.ask(["{}"])


@pytest.fixture
def peer():
    """A function from what a peer sends, part by part, to a link to it."""
    sockets = []

    def start(parts, limit_s=60.0):
        listener = socket.create_server(("127.0.0.1", 0))

        def serve():
            with suppress(OSError):
                connection, _ = listener.accept()
                sockets.append(connection)
                connection.recv(65536)
                for part in parts:
                    connection.sendall(part)
                connection.shutdown(socket.SHUT_WR)

        sockets.append(listener)
        threading.Thread(target=serve, daemon=True).start()
        return HttpLink(f"http://127.0.0.1:{listener.getsockname()[1]}", limit_s)

    yield start
    for one in sockets:
        one.close()


OK = b"HTTP/1.1 200 OK\r\n"


@pytest.mark.parametrize(
    ("answer", "words"),
    [
        (b"\x1b[31mI am no server\r\n\r\n", ("HTTP",)),
        (b"", ("reached",)),
        (OK + b"Transfer-Encoding: chunked\r\n\r\nzz\r\n{}", ("HTTP",)),
        (OK + b"Content-Length: 100\r\n\r\n{}", ("answer",)),
        (OK + b"X: y\r\n" * 101 + b"\r\n", ("HTTP",)),
        (OK + b"X: " + b"y" * 70_000 + b"\r\n\r\n", ("HTTP",)),
        (
            b"HTTP/1.1 500 \x1b[31mred\x07\r\nContent-Length: 0\r\n\r\n",
            ("500", "\\x1b[31mred\\x07"),
        ),
        (b"HTTP/1.1 302 Go\r\nLocation: file:///etc/passwd\r\n\r\n", ("status", "302")),
        (OK + b"Content-Length: 6\r\n\r\n{}\n{}\n", ("2", "1")),
    ],
)
def test_what_is_no_answer_is_one_printable_line(peer, answer, words):
    with refuses(LinkError, *words) as error:
        peer([answer]).ask(["{}"])
    assert str(error.value).isprintable()
    assert len(str(error.value)) < 600


def test_a_service_has_one_deadline_for_its_whole_answer(peer):
    def drip():
        yield OK
        while True:
            time.sleep(0.02)
            yield b"X: y\r\n"[:1]

    with refuses(LinkError, "0.3"):
        peer(drip(), limit_s=0.3).ask(["{}"])


@pytest.mark.parametrize(
    ("address", "word"),
    [
        ("exec:./not-there", "address"),
        ("exec:'", "address"),
        ("http://127.0.0.1:9", "reached"),
        ("exec:", "exec:COMMAND"),
        ("http://", "exec:COMMAND"),
        ("ftp:there", "exec:COMMAND"),
    ],
)
def test_what_is_not_there_is_one_clear_error(address, word):
    with refuses(ValueError, word):
        played(address)


def test_a_game_does_not_go_back(service):
    model = OutsideModel(service)
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
    monkeypatch.setattr(outside, "MOST_GAMES", 4)
    model = OutsideModel(service)
    ratings = np.full((2, 2, 3), 0.9)
    old = model.update(model.start(ratings), Ratings(ratings, ratings > 0))
    model.start(ratings)
    with refuses(ValueError, "round", "1"):
        model.update(old, Ratings(ratings, ratings > 0))


def test_the_process_ends_with_the_model(tmp_path):
    model, _ = played(echo(tmp_path, "{'providers': [0.2, 0.3]}"))
    process = model._sessions().link._process
    assert process.poll() is None
    del model
    assert process.wait(60) is not None


def test_a_copy_has_a_process_of_its_own(tmp_path):
    model, _ = played(echo(tmp_path, "{'providers': [0.2, 0.3]}"))
    for other in (copy.deepcopy(model), pickle.loads(pickle.dumps(model))):
        assert other.address == model.address
        assert other._sessions() is not model._sessions()


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
        roletrust_env.make_trust_model("exec")
