"""What strangers and members send to a trust manager that they want to deceive, to fill or to
stop."""

import base64
import hmac
import json
import resource
import shutil
import socket
import sqlite3
import time
from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager, suppress
from hashlib import sha256
from pathlib import Path
from typing import Any

import httpx2
import pytest
from served import Served, served
from signing_agents import NAME, Agent

from roletrust_experiments import main
from roletrust_manager.http import connections

ANN, BOB, FLO = (Agent(name, time.time) for name in ("ann", "bob", "flo"))
_http = httpx2.Client(timeout=20)
FILES, QUOTA = 300, 20  # that the manager may open; ratings of an agent in a round


def part(content: bytes | str | dict[str, Any]) -> str:
    """A part of a token."""
    text = json.dumps(content) if isinstance(content, dict) else content
    return (
        base64.urlsafe_b64encode(text if isinstance(text, bytes) else text.encode())
        .decode()
        .rstrip("=")
    )


def forged(agent: Agent, claims: bytes | str | dict[str, Any], **header: Any) -> str:
    """Claims that the agent has signed, whatever they are."""
    signed = f"{part({'alg': 'EdDSA', **header})}.{part(claims)}"
    return f"{signed}.{part(agent.key.sign(signed.encode()))}"


def shared_secret(agent: Agent, claims: dict[str, Any], secret: bytes) -> str:
    """Claims that are signed with a secret which everybody knows: the public key."""
    signed = f"{part({'alg': 'HS256'})}.{part(claims)}"
    return f"{signed}.{part(hmac.digest(secret, signed.encode(), sha256))}"


def post(
    manager: Served, path: str, content: bytes, kind: str = "application/json"
) -> httpx2.Response:
    return _http.post(f"{manager.url}{path}", content=content, headers={"Content-Type": kind})


def counts(manager: Served) -> dict[str, int]:
    found: dict[str, int] = _http.get(f"{manager.url}/refusals").json()["refusals"]
    return found


def check_refused(manager: Served, path: str, content: bytes, status: int, reason: str) -> None:
    """Check that a request is refused for a reason, and that this is counted."""
    before = counts(manager)
    answer = post(manager, path, content)
    assert (answer.status_code, answer.json()["reason"]) == (status, reason), (
        content[:200],
        answer.text,
    )
    assert counts(manager) == before | {reason: before.get(reason, 0) + 1}


@pytest.fixture(scope="module")
def manager(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    with served(
        tmp_path_factory.mktemp("m") / "trust.sqlite", "--every", 3600, "--set", f"quota={QUOTA}"
    ) as found:
        resource.prlimit(found.process.pid, resource.RLIMIT_NOFILE, (FILES, FILES))
        for agent in (ANN, BOB, FLO):
            assert post(found, "/agents", body(agent.registration())).status_code == 201
        yield found


def body(*tokens: str) -> bytes:
    return json.dumps({"tokens": tokens, "token": tokens[0]}).encode()


@contextmanager
def served_as_ever(manager: Served) -> Iterator[None]:
    """Check that nothing but one rating of a member counts, and that it is answered at once."""
    before = _http.get(f"{manager.url}/").json()
    yield
    start = time.monotonic()
    assert post(manager, "/ratings", body(ANN.rating(BOB.name, 0.5))).status_code == 201
    assert time.monotonic() - start < 5
    after = _http.get(f"{manager.url}/").json()
    assert (after["ratings"], after["agents"]) == (before["ratings"] + 1, before["agents"])


@pytest.mark.slow
def test_tokens_that_deceive_are_refused_and_counted(manager: Served):
    other, zoe = Agent(ANN.name, time.time, seed=1), Agent("zoe", time.time)

    def claims(**changes: Any) -> dict[str, Any]:
        return {"kind": "rating", **ANN._claims(), "sub": BOB.name, "rating": 0.1, **changes}

    def raw(**changes: str) -> str:
        """Claims in JSON with a number as it is written here."""
        known = claims(**dict.fromkeys(changes, "HERE"))
        return json.dumps(known).replace('"HERE"', next(iter(changes.values())))

    first = ANN.rating(BOB.name, 0.1)
    head, payload, signature = ANN.rating(BOB.name, 0.1).split(".")
    public = ANN.key.public_key().public_bytes_raw()
    key = {"kty": "OKP", "crv": "Ed25519", "x": part(other.key.public_key().public_bytes_raw())}
    assert post(manager, "/ratings", body(first)).status_code == 201
    for status, reason, token in (
        (401, "mis-signed", forged(other, claims())),
        (401, "mis-signed", forged(other, claims(), jwk=key)),  # a key that comes along is no key
        (401, "mis-signed", forged(other, claims(), kid="../../dev/null")),
        (401, "mis-signed", ".".join([head, part(claims(rating=1.0)), signature])),
        (401, "unsigned", f"{head}.{payload}."),
        (401, "garbage", f"{part({'alg': 'none'})}.{payload}."),
        (401, "garbage", f"{part({'alg': 'none'})}.{payload}.{signature}"),
        (401, "garbage", shared_secret(ANN, claims(), public)),
        (401, "garbage", shared_secret(ANN, claims(), part(public).encode())),
        (401, "garbage", forged(ANN, claims(), alg="ES256")),
        (401, "garbage", forged(ANN, claims(), alg=["EdDSA"])),
        (403, "in the wrong place", forged(ANN, claims(aud="other"))),
        (401, "garbage", forged(ANN, claims(aud=[NAME, "other"]))),
        (403, "unknown sender", forged(zoe, claims(iss="zoe"))),
        (404, "unknown provider", forged(ANN, claims(sub="zoe"))),
        (422, "rates itself", forged(ANN, claims(sub=ANN.name))),
        (401, "stamp from the past", forged(ANN, claims(iat=1.0))),
        (401, "stamp from the future", forged(ANN, claims(iat=9e9))),
        *(
            (401, "garbage", forged(ANN, claims(iat=iat)))
            for iat in (-1, 0, 1e300, True, "1", None)
        ),
        *(
            (422, "out of range", forged(ANN, claims(rating=rating)))
            for rating in (1.0000001, -1e-9, 1e308)
        ),
        *(
            (401, "garbage", forged(ANN, claims(rating=rating)))
            for rating in ("0.5", None, True, [0.5])
        ),
        *(
            (401, "garbage", forged(ANN, raw(rating=text)))
            for text in ("NaN", "Infinity", "1e999", "0x1")
        ),
        *((401, "garbage", forged(ANN, raw(iat=text))) for text in ("9" * 2000, "1e999", "-0")),
        *(
            (401, "garbage", forged(ANN, raw(sub=text)))
            for text in ("[" * 1500, "[" * 750 + "]" * 750)
        ),
        *(
            (401, "garbage", forged(ANN, claims(sub=name)))
            for name in (
                "\u0430nn",
                "bob\n",
                "bob\x00",
                "../bob",
                "=1+1",
                "~2",
                f"{BOB.name}~2",
                "b" * 201,
                "",
                " ",
                "1",
            )
        ),
        (401, "garbage", forged(ANN, b"\xff\xfe")),
        (401, "garbage", forged(ANN, "[]")),
        (401, "garbage", ANN.farewell()),
        (401, "garbage", "a.b"),
        (401, "garbage", "...."),
    ):
        check_refused(manager, "/ratings", body(token), status, reason)
    check_refused(
        manager,
        "/ratings",
        body(ANN.rating(FLO.name, 0.2), forged(other, claims())),
        401,
        "mis-signed",
    )
    with served_as_ever(manager):
        pass
    check_refused(manager, "/ratings", body(first), 409, "replayed")
    for _ in range(QUOTA):
        assert post(manager, "/ratings", body(FLO.rating("ann", 0.3))).status_code == 201
    check_refused(manager, "/ratings", body(FLO.rating("ann", 0.3)), 429, "too many messages")
    check_refused(manager, "/agents", body(other.registration()), 409, "name taken")
    check_refused(
        manager, "/agents", body(forged(zoe, {**zoe._claims(), "kind": "register"})), 401, "garbage"
    )
    with served_as_ever(manager):
        pass


@pytest.mark.slow
def test_bodies_and_requests_that_fill_are_refused_and_counted(manager: Served):
    token = b'"' + b"x" * 4000 + b'"'
    with served_as_ever(manager):
        for status, reason, content in (
            (413, "too large", b'{"tokens": [' + b",".join([token] * 1100) + b"]}"),
            (422, "garbage", b'{"tokens": [' + b",".join([b'"x"'] * 1001) + b"]}"),
            (422, "garbage", b'{"tokens": ["' + b"x" * 5000 + b'"]}'),
            (422, "garbage", b"[" * 50_000),
            (422, "garbage", b'{"tokens": ' + b"[" * 50_000 + b"]" * 50_000 + b"}"),
            (422, "garbage", b'{"tokens": [' + b"1" * 50_000 + b"]}"),
            (422, "garbage", b'{"tokens": [NaN, 1e999]}'),
            (422, "garbage", b'{"tokens": ["\\ud800"]}'),
            (422, "garbage", b'\xff\xfe{"tokens": ["x"]}'),
            (422, "garbage", b"null"),
            (422, "garbage", b""),
        ):
            check_refused(manager, "/ratings", content, status, reason)
        check_refused(manager, "/agents", b'{"token": "' + b"x" * 70_000 + b'"}', 413, "too large")
        before = counts(manager)["too large"]
        for n, (start, more) in enumerate(
            (
                (b"GET / HTTP/1.1\r\nX: ", b"x" * 64_000),
                (b"GET / HTTP/1.1\r\n", b"X: x\r\n" * 10_000),
                (b"GET /", b"x" * 64_000),
                (b"", b"GET /agents HTTP/1.1\r\nHost: m\r\n\r\n" * 2000),
            )
        ):
            sent = send(manager.port, start, more)
            assert sent < 30_000_000
            assert counts(manager)["too large"] == before + n + 1
        for content in (
            b"\x16\x03\x01\x02\x00\x01\x00",
            b"POST /ratings HTTP/1.1\r\nHost: m\r\nContent-Length: -1\r\n\r\n",
            b"POST /ratings HTTP/1.1\r\nHost: m\r\nContent-Length: 5\r\nTransfer-Encoding: "
            b"chunked\r\n\r\n0\r\n\r\n",
            b"POST /ratings HTTP/1.1\r\nHost: m\r\nContent-Length: " + b"9" * 30 + b"\r\n\r\n{",
        ):
            with connection(manager.port) as client:
                client.sendall(content)
                assert client.recv(100).startswith(b"HTTP/1.1 400 ")


@contextmanager
def connection(port: int) -> Iterator[socket.socket]:
    with socket.create_connection(("127.0.0.1", port), timeout=10) as client:
        yield client


def send(port: int, start: bytes, more: bytes) -> int:
    """Send without end, and return after how many bytes the connection was cut."""
    sent = 0
    with connection(port) as client, suppress(ConnectionError):
        client.sendall(start)
        while sent < 100_000_000:
            client.sendall(more)
            sent += len(more)
    return sent


@pytest.mark.slow
def test_clients_that_wait_hold_nobody_up(manager: Served):
    """Half requests, listeners that do not read, and more connections than there are files for."""
    half = (
        b"POST /ratings HTTP/1.1\r\nHost: m\r\nContent-Type: "
        b"application/json\r\nContent-Length: 500\r\n\r\n{"
    )
    listen, export = (
        f"GET /{path} HTTP/1.1\r\nHost: m\r\n\r\n".encode() for path in ("events", "ratings")
    )
    with ExitStack() as stack:
        for content in (*[half] * 60, *[listen] * 100, *[export] * 20):
            client = stack.enter_context(connection(manager.port))
            client.sendall(content)
            if content is not half:
                client.recv(1)
        answer = _http.get(f"{manager.url}/events")
        assert (answer.status_code, answer.json()["reason"]) == (503, "busy")
        with served_as_ever(manager):
            pass
    for more in (export, export * 300):  # the second is cut, while the first is answered
        with connection(manager.port) as client:
            client.sendall(listen + more)
            time.sleep(0.1)
    with ExitStack() as stack:
        for _ in range(FILES):
            stack.enter_context(connection(manager.port))
        time.sleep(1)
    with served_as_ever(manager):
        pass


def impatient() -> None:
    """`roletrust`, for which a request has to arrive within half a second."""
    connections._ARRIVAL_S = 0.5
    main()


@pytest.mark.slow
def test_a_request_that_does_not_arrive_is_cut_and_counted(tmp_path: Path):
    with (
        served(tmp_path / "trust.sqlite", function=impatient) as manager,
        ExitStack() as stack,
    ):
        listener = stack.enter_context(connection(manager.port))
        listener.sendall(b"GET /events HTTP/1.1\r\nHost: m\r\n\r\n")
        slow = [stack.enter_context(connection(manager.port)) for _ in range(4)]
        starts = (
            b"",
            b"GET",
            b"GET / HTTP/1.1\r\n",
            b"POST /agents HTTP/1.1\r\nHost: m\r\nContent-Length: 9\r\n\r\n{",
        )
        for client, start in zip(slow, starts, strict=True):
            client.sendall(start)
        for client in slow:
            with suppress(ConnectionResetError):
                assert client.recv(1) == b""
        assert counts(manager)["too large"] == 4
        heard = b""
        while b": rounds" not in heard:
            heard += listener.recv(1000)
        listener.setblocking(False)
        with pytest.raises(BlockingIOError):  # it is still listened to
            listener.recv(1000)


def memory_mb(manager: Served) -> float:
    status = Path(f"/proc/{manager.process.pid}/status").read_text()
    return int(status.partition("VmRSS:")[2].split()[0]) / 1000


@pytest.mark.slow
def test_bodies_and_answers_under_way_are_bounded(tmp_path: Path):
    """100 large bodies that do not end, and 100 readers of a page of 10,000 ratings that do not
    read."""
    ann, others = Agent(ANN.name, time.time), [Agent(f"b{n}", time.time) for n in range(1000)]
    options = "--set", "quota=100000", "--set", "newcomers=2000"
    with served(tmp_path / "s", *options, function=unread) as manager:
        for agent in (ann, *others):
            post(manager, "/agents", body(agent.registration(0)))
        for _ in range(10):
            tokens = [ann.rating(one.name, 0.5) for one in others]
            assert post(manager, "/ratings", body(*tokens)).status_code == 201
        before = memory_mb(manager)
        start = (
            b"POST /ratings HTTP/1.1\r\nHost: m\r\nContent-Type: application/json\r\n"
            b"Content-Length: 4000000\r\n\r\n" + b" " * 3_900_000
        )
        with ExitStack() as stack:
            for _ in range(100):
                client = stack.enter_context(connection(manager.port))
                client.settimeout(0.3)
                with suppress(OSError):
                    client.sendall(start)
            assert memory_mb(manager) - before < 100
            assert post(manager, "/ratings", body(ann.rating("b1", 1))).status_code == 201
        with ExitStack() as stack:
            for _ in range(100):
                client = stack.enter_context(connection(manager.port))
                client.sendall(b"GET /ratings HTTP/1.1\r\nHost: m\r\n\r\n" * 6)
            assert post(manager, "/ratings", body(ann.rating("b1", 1))).status_code == 201
            assert memory_mb(manager) - before < 150
            time.sleep(4)
            answer = _http.get(f"{manager.url}/ratings")  # those that do not read were cut
            assert (answer.status_code, answer.text.count("\n")) == (200, 10_001)


def unread() -> None:
    """`roletrust`, whose answers have to be read within three seconds."""
    connections._READING_S = 3.0
    main()


@pytest.mark.slow
def test_a_flood_of_old_tokens_costs_less_than_what_it_repeats(tmp_path: Path):
    ann, bob = Agent(ANN.name, time.time), Agent(BOB.name, time.time)
    with served(tmp_path / "s", "--set", "quota=100000") as manager:
        for agent in (ann, bob):
            post(manager, "/agents", body(agent.registration()))
        old = [ann.rating(BOB.name, 1) for _ in range(200)]
        for token in old:
            post(manager, "/ratings", body(token))
        spent = manager.cpu_s
        for token in [ann.rating(BOB.name, 1) for _ in range(200)]:
            post(manager, "/ratings", body(token))
        once, content = (manager.cpu_s - spent) / 200, body(*old)
        spent = manager.cpu_s
        for _ in range(200):
            assert post(manager, "/ratings", content).status_code == 409
        assert (manager.cpu_s - spent) / 200 < 3 * once
        answers = {post(manager, "/ratings", content).status_code for _ in range(1500)}
        assert 409 in answers


@pytest.mark.slow
def test_a_store_is_whole_after_an_orderly_end_and_takes_nothing_when_it_is_gone(tmp_path: Path):
    ann, bob = Agent(ANN.name, time.time), Agent(BOB.name, time.time)
    with served(tmp_path / "s") as manager:
        for agent in (ann, bob):
            post(manager, "/agents", body(agent.registration()))
        for _ in range(30):
            post(manager, "/ratings", body(ann.rating(BOB.name, 1)))
    shutil.copy(tmp_path / "s", tmp_path / "copy")
    with closing(sqlite3.connect(tmp_path / "copy")) as copy:
        assert copy.execute("select count(*) from events").fetchone() == (32,)
    with served(tmp_path / "s") as manager:
        for path in tmp_path.glob("s*"):
            path.unlink()
        answer = post(manager, "/ratings", body(ann.rating(BOB.name, 1)))
        assert (answer.status_code, answer.json()["reason"]) == (503, "not stored")
