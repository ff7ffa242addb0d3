"""The trust manager on HTTP: each endpoint, each status, and what is described."""

from collections.abc import Iterator
from pathlib import Path

import jwt
import pytest
from fastapi.testclient import TestClient
from signing_agents import NAME, Agent, Clock, managed

from roletrust_manager.http.endpoints import make_app
from roletrust_manager.journal.checkpoint import read_checkpoint, read_verifier_key
from roletrust_manager.journal.sql import JournalStore, StoreError
from roletrust_manager.journal.verify import (
    HistoryError,
    check_consistent,
    check_export,
    check_receipt,
    event_leaf,
)


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def client(tmp_path: Path, clock: Clock) -> Iterator[TestClient]:
    with managed(tmp_path / "s", clock) as manager:
        app = make_app(manager)
        with TestClient(app) as client:
            yield client


def registered(client: TestClient, clock: Clock, *names: str) -> list[Agent]:
    agents = [Agent(name, clock) for name in names]
    for agent in agents:
        assert client.post("/agents", json={"token": agent.registration()}).status_code == 201
    return agents


def test_agents_register_rate_ask_and_leave(client: TestClient, clock: Clock):
    ann, bob, cec = registered(client, clock, "ann", "bob", "cec")
    together = client.post(
        "/ratings", json={"tokens": [ann.rating("bob", 0.9), cec.rating("bob", 0.7)]}
    ).json()
    assert (together["reason"], together["at"]) == ("in the wrong place", 0)
    for rater, rating in ((ann, 0.9), (cec, 0.7)):
        receipts = client.post("/ratings", json={"tokens": [rater.rating("bob", rating)]}).json()
    assert [one["seq"] for one in receipts["receipts"]] == [5]
    assert client.get("/agents/bob").json()["provider"]["rank"] is None
    clock.now += 61
    client.post("/ratings", json={"tokens": [ann.rating("cec", 0.1)]})
    about, agent = client.get("/").json(), client.get("/agents/bob?explain=true").json()
    assert (about["ratings"], about["counted"], about["rounds"], about["agents"]) == (3, 2, 1, 3)
    assert agent["provider"]["rank"] == agent["provider"]["of"] == 1
    assert agent["provider"]["ratings"] == agent["provider"]["agents"] == 2
    reasons = agent["explanation"]["provider"]["reasons"]
    assert {one["agent"]: one["ratings"] for one in reasons} == {"ann": [0.9], "cec": [0.7]}
    listed = client.get("/agents?limit=2").json()
    assert [one["name"] for one in listed["agents"]] == ["bob", "ann"]
    assert listed["total"] == 3
    lines = client.get("/ratings").text.splitlines()
    assert lines[0] == "rater,ratee,rating,time,token"
    assert [line.split(",")[:3] for line in lines[1:]] == [
        ["ann", "bob", "0.9"],
        ["cec", "bob", "0.7"],
        ["ann", "cec", "0.1"],
    ]
    assert client.get("/ratings?counted=true").text.splitlines() == lines[:3]
    key = jwt.PyJWK({"kty": "OKP", "crv": "Ed25519", "x": client.get("/agents/ann").json()["key"]})
    claims = jwt.decode(
        lines[1].split(",")[4], key, audience=NAME, options={"verify_iat": False}
    )  # whoever reads, checks
    assert (claims["iss"], claims["sub"], claims["rating"]) == ("ann", "bob", 0.9)
    assert (
        client.request("DELETE", "/agents/bob", json={"token": bob.farewell()}).status_code == 200
    )
    assert client.get("/agents/bob").status_code == 404


def test_errors_have_one_form_and_are_counted(
    client: TestClient,
    clock: Clock,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
):
    ann, _ = registered(client, clock, "ann", "bob")
    wrong = Agent("ann", clock, seed=1)
    first = ann.rating("bob", 1)
    client.post("/ratings", json={"tokens": [first]})
    client.post("/ratings", json={"tokens": [ann.rating("bob", 1)]})
    clock.now += 1
    for status, reason, make in (
        (401, "mis-signed", lambda: [wrong.rating("bob", 0)]),
        (403, "unknown sender", lambda: [Agent("zoe", clock).rating("bob", 0)]),
        (403, "in the wrong place", lambda: [ann.rating("bob", 0, aud="other")]),
        (404, "unknown provider", lambda: [ann.rating("zoe", 0)]),
        (409, "replayed", lambda: [first]),
        (413, "too large", lambda: ["x" * 4096] * 1020),
        (401, "garbage", lambda: ["x"]),
        (422, "garbage", lambda: []),
        (422, "garbage", lambda: [7]),
        (422, "out of range", lambda: [ann.rating("bob", 2)]),
    ):
        counts = client.get("/refusals").json()["refusals"]
        answer = client.post("/ratings", json={"tokens": make()})
        assert (answer.status_code, answer.json()["reason"]) == (status, reason)
        assert answer.json()["detail"]
        assert client.get("/refusals").json()["refusals"] == {
            **counts,
            reason: counts.get(reason, 0) + 1,
        }
    assert (
        client.post(
            "/agents", content=b"\xff", headers={"Content-Type": "application/json"}
        ).status_code
        == 422
    )
    assert client.put("/agents").headers["Allow"] == "GET, POST"
    for path in ("/agents/zoe", "/nothing", "/agents?limit=0", "/docs", "/redoc"):
        assert set(client.get(path).json()) == {"reason", "detail", "at"}
    assert client.get("/agents/zoe").json()["reason"] == "unknown agent"
    unknown = client.get("/nothing").json()
    assert unknown["reason"] == "unknown path"
    assert (
        "no /nothing; there are /openapi.json, /, /agents, /agents/{name}, /ratings"
        in unknown["detail"]
    )

    def full(store: JournalStore, *new: object) -> None:
        raise StoreError("/srv/secret is full")

    monkeypatch.setattr(JournalStore, "append", full)
    monkeypatch.setattr(JournalStore, "rows", full)
    for answer in (
        client.post("/ratings", json={"tokens": [ann.rating("bob", 1)]}),
        client.get("/ratings"),
    ):
        assert (answer.status_code, answer.json()["reason"], answer.headers["Retry-After"]) == (
            503,
            "not stored",
            "1",
        )
        assert "secret" not in answer.text
    assert [record.message for record in caplog.records] == ["/srv/secret is full"]


def test_exports_come_in_pages_and_can_be_checked(client: TestClient, clock: Clock):
    """An agent proves with its receipt that an export lacks its rating."""
    ann, _ = registered(client, clock, "ann", "bob")
    for number in range(5):
        client.post("/ratings", json={"tokens": [ann.rating("bob", number / 4)]})
    pages, address = [], "/journal?limit=3"
    while address:
        answer = client.get(address)
        pages.append(answer.text)
        address = answer.links.get("next", {}).get("url")
    assert [len(page.splitlines()) for page in pages] == [4, 3, 1]
    rows = [line.split(",") for line in "".join(pages).splitlines()[1:]]
    assert len(client.get("/ratings?after=5&limit=9").text.splitlines()) == 2
    leaves = [event_leaf(int(seq), int(time.replace(".", "")), token) for seq, time, token in rows]
    about, text = client.get("/").json(), client.get("/checkpoint").text
    key = read_verifier_key(about["key"])
    checkpoint = read_checkpoint(text, key)
    assert (checkpoint.origin, checkpoint.size) == (f"roletrust/{NAME}", 7)
    check_export(leaves, checkpoint)
    proof = client.get("/inclusion?seq=4&size=7").json()["hashes"]
    check_receipt(leaves[3], 3, [bytes.fromhex(node) for node in proof], checkpoint)
    with pytest.raises(HistoryError):
        check_export([*leaves[:3], *leaves[4:], leaves[3]], checkpoint)
    client.post("/ratings", json={"tokens": [ann.rating("bob", 1)]})
    newer = read_checkpoint(client.get("/checkpoint").text, key)
    nodes = client.get("/consistency?old=7&new=8").json()["hashes"]
    check_consistent(checkpoint, newer, [bytes.fromhex(node) for node in nodes])
    for wrong in ("inclusion?seq=9&size=8", "inclusion?seq=1&size=9", "consistency?old=8&new=7"):
        answer = client.get(f"/{wrong}")
        assert (answer.status_code, answer.json()["reason"]) == (404, "unknown event")
