"""The client against a manager that runs, and what stands between them."""

import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace

import httpx2
import pytest
from fastapi import FastAPI
from refusals import refuses
from running import manager, running

from roletrust_manager.admission.validation import RefusalReason
from roletrust_manager.http import client
from roletrust_manager.http.client import RefusalError, TrustClient, UnreachableError
from roletrust_manager.http.endpoints import make_app
from roletrust_manager.http.tokens import Rating


def test_an_agent_registers_rates_asks_and_leaves(ann, url, tmp_path, clock):
    first = ann.register()
    receipt = ann.rate("bob", 4.6)
    assert receipt.seq > first.seq
    clock.late = 600
    ann.rate("bob", 4.6)
    bob = ann.ask("bob", explanation=True)
    assert (bob.provider.ratings, bob.provider.agents, bob.provider.rank) == (1, 1, 1)
    assert 0 < bob.provider.trust < 1
    assert bob.explanation.provider.reasons[0].agent == "ann"
    with TrustClient(url) as reader:
        assert [one.name for one in reader.agents().agents] == ["bob", "ann"]
        reader.export(tmp_path / "ratings.csv")
        with refuses(ValueError, "name"):
            reader.rate("bob", 4.6)
    assert (tmp_path / "ratings.csv").read_text().splitlines()[1].startswith("ann,bob,4.6,")
    ann.leave()
    with refuses(RefusalError, "ann"):
        ann.rate("bob", 4.6)


def test_ratings_of_one_microsecond_all_count(ann, monkeypatch):
    now = time.time_ns()
    monkeypatch.setattr(time, "time_ns", lambda: now)
    for _ in range(3):
        ann.rate("bob", 4.6)
    assert ann.about().ratings == 3


def test_a_client_whose_clock_was_ahead_goes_on_when_it_is_right(ann, monkeypatch):
    ahead = SimpleNamespace(**vars(time) | {"time_ns": lambda: time.time_ns() + 3600 * 10**9})
    with monkeypatch.context() as wrong:
        wrong.setattr(client, "time", ahead)
        with refuses(RefusalError, "ann"):
            ann.rate("bob", 4.6)
    ann.rate("bob", 4.6)
    assert ann.about().ratings == 1


def test_a_rating_whose_acknowledgement_is_lost_counts_once(ann, between):
    between.before, between.after = [503], [502]
    ann.rate("bob", 4.6)
    assert not between.before + between.after
    assert ann.about().ratings == 1


def test_a_rating_that_was_given_up_counts_once_when_it_is_sent_again(ann, between, clock):
    total = 0
    for side in ("before", "after"):
        for wait in (0, 120):  # within the tolerance, and beyond it
            setattr(between, side, [0.3])
            ann._patience_s = 0.1
            with refuses(UnreachableError, "0.1"):
                ann.rate("bob", 4.6)
            ann._patience_s = 10.0
            time.sleep(0.3)
            clock.late += wait
            ann.rate("bob", 4.6)
            total += 1
            assert ann.about().ratings == total, (side, wait)


def test_the_same_key_in_two_processes_signs_anew(ann, url, tmp_path, monkeypatch):
    with TrustClient(url, "ann", tmp_path / "keys") as other:
        body, late = other._body, [other._body(Rating, [{"sub": "bob", "rating": 2.0}])]
        ann.rate("bob", 4.6)
        monkeypatch.setattr(other, "_body", lambda *asked: late.pop() if late else body(*asked))
        other.rate("bob", 2.0)
        assert not late
        assert ann.about().ratings == 2


def test_threads_take_turns(ann):
    with ThreadPoolExecutor(4) as pool:
        receipts = list(pool.map(lambda _: ann.rate("bob", 3.0), range(12)))
    assert len({one.seq for one in receipts}) == ann.about().ratings == 12


def test_a_restart_is_waited_for(tmp_path, clock):
    path = tmp_path / "trust.sqlite"
    with (
        manager(path, clock) as kept,
        running(make_app(kept)) as url,
        TrustClient(url, "ann", tmp_path / "keys") as ann,
    ):
        ann.register()
    with TrustClient(url, "bob", tmp_path / "keys") as bob, ThreadPoolExecutor() as pool:
        registration = pool.submit(bob.register)
        time.sleep(0.2)
        assert not registration.done()
        with manager(path, clock) as kept, running(make_app(kept), int(url.rpartition(":")[2])):
            assert registration.result().seq == 2
            assert bob.about().agents == 2


@pytest.fixture
def restart(monkeypatch):
    """Make clients of a manager that refuses connections until a time of a fake clock."""

    class Restart:
        """A client whose clock starts at 0, and the times of its requests."""

        def __init__(self, patience_s, until_s):
            self.client = TrustClient("http://127.0.0.1:9", patience_s=patience_s)
            self.until_s, self.now, self.requests = until_s, 0.0, []
            fake = SimpleNamespace(monotonic=lambda: self.now, sleep=self.sleep)
            monkeypatch.setattr(client, "time", fake)
            monkeypatch.setattr(self.client._http, "request", self.request)

        def request(self, *_, **__):
            self.requests.append(self.now)
            if self.now < self.until_s:
                raise httpx2.ConnectError("refused")
            return httpx2.Response(200, json={"refusals": {"replayed": 3}})

        def sleep(self, seconds):
            assert seconds > 0
            self.now += seconds

    return Restart


@pytest.mark.parametrize(
    ("patience_s", "until_s"), [(0.1, 0.05), (3, 2.5), (3, 2.95), (15, 14.5), (50, 49)]
)
def test_a_client_waits_for_its_whole_patience(restart, patience_s, until_s):
    manager = restart(patience_s, until_s)
    with manager.client as reader:
        assert reader.refusals().refusals == {"replayed": 3}
    assert until_s <= manager.now <= patience_s


@pytest.mark.parametrize(("patience_s", "most"), [(0.1, 2), (3, 12), (15, 20), (50, 40)])
def test_a_client_gives_up_when_its_patience_ends(restart, patience_s, most):
    manager = restart(patience_s, float("inf"))
    with manager.client as reader, refuses(UnreachableError, reader.url):
        reader.refusals()
    assert manager.now == pytest.approx(patience_s)
    assert len(manager.requests) <= most


def test_more_work_than_a_client_does_is_refused(ann, monkeypatch):
    about = ann.about().model_copy(update={"work": 40})
    monkeypatch.setattr(ann, "about", lambda: about)
    with refuses(ValueError, "40", "24"):
        ann.register()


def test_refusals_say_why(ann):
    for name, rating, reason, status in (
        ("ann", 4.6, RefusalReason.ITSELF, 422),
        ("carl", 4.6, RefusalReason.UNKNOWN_PROVIDER, 404),
        ("bob", 0.5, RefusalReason.OUT_OF_RANGE, 422),
    ):
        with refuses(RefusalError, reason, "ann", rating) as error:
            ann.rate(name, rating)
        assert (error.value.reason, error.value.status, error.value.at) == (reason, status, 0)
    with refuses(ValueError, "b b"):
        ann.rate("b b", 4.6)
    for name, word in (
        ("carl", "carl"),
        ("..", "'..'"),
        ("", "''"),
    ):
        with refuses(ValueError, word):
            ann.ask(name)


def test_what_is_no_manager_is_said_in_one_line(tmp_path):
    with (
        TrustClient("http://127.0.0.1:9", patience_s=0.2) as client,
        refuses(UnreachableError, "http://127.0.0.1:9"),
    ):
        client.about()
    with running(FastAPI()) as address, TrustClient(address) as client:
        with refuses(UnreachableError, "status", "404"):
            client.about()
        with refuses(UnreachableError, "status", "404"):
            client.export(tmp_path / "ratings.csv")
    assert not list(tmp_path.iterdir())
    with refuses(ValueError, "localhost:8000"):
        TrustClient("localhost:8000")


def test_a_client_replaces_its_key_also_after_it_has_broken_off(ann, url, tmp_path, monkeypatch):
    ann.register()
    before = ann.ask("ann").key
    ann.rotate()
    after = ann.ask("ann").key
    assert after != before
    other = TrustClient(url, "zoe", tmp_path / "zoe")
    other.register()
    ann.rate("zoe", 1)
    monkeypatch.setattr(Path, "replace", lambda *_: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        other.rotate()
    monkeypatch.undo()
    again = TrustClient(url, "zoe", tmp_path / "zoe")
    with refuses(RefusalError, "mis-signed"):
        again.rate("ann", 1)
    again.rotate()
    again.rate("ann", 1)
    assert not list((tmp_path / "zoe" / "next").iterdir())
