"""The store of a trust manager: damage, locks, backups, snapshots, and checks by others."""

import base64
import json
import shutil
import sqlite3
import tempfile
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest
from refusals import refuses
from signing_agents import (
    QUICK,
    Agent,
    Clock,
    joined,
    managed,
    refused,
    standings,
)

from roletrust_env.trust.models.central.means import Mean
from roletrust_manager.admission.validation import RefusalReason
from roletrust_manager.http import manager as managers
from roletrust_manager.http.requests import RefusedError, Request, make_settings
from roletrust_manager.http.store_check import check_store
from roletrust_manager.http.tokens import (
    Rating,
    Rotation,
    key_as_text,
)
from roletrust_manager.journal.backup import back_up
from roletrust_manager.journal.merkle import MerkleTree, leaf_hash
from roletrust_manager.journal.sql import JournalStore, StoreError
from roletrust_manager.journal.verify import event_leaf


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ("update events set time = 'x' where seq = 5", ("5", "x")),
        ("update events set rating = 9e999 where seq = 4", ("4", "inf")),
        ("update events set rating = 0.25 where seq = 4", ("4", "ann")),
        ("update events set provider = 'ann', rating = 1.0 where seq = 1", ("1", "ann")),
        ("delete from events where seq = 5", ("5",)),
        ("update events set time = time + 1 where seq = 5", ("5",)),
        ("update meta set value = '5 00' where name = 'head'", ("5",)),
        ("update meta set value = '00' where name = 'key'", ("key",)),
        ("update events set kind = 'told' where seq = 4", ("4", "told")),
        (
            "update events set time = 0 where seq = 5",
            ("event", "5"),
        ),
        ("delete from events where seq = 2", ("event", "2")),
        (
            "update events set sender = 'zoe' where seq = 4",
            ("zoe",),
        ),
        (
            "update events set provider = sender where seq = 4",
            ("ann",),
        ),
        (
            "update events set provider = 'zoe' where seq = 4",
            ("ann",),
        ),
        ("update events set stamp = 1 where seq = 5", ("ann",)),
        (
            "update events set kind = 'leave' where seq = 1",
            ("ann",),
        ),
        (
            "update events set sender = 'ann~2' where seq = 1",
            ("ann~2",),
        ),
        ("update events set token = '' where seq = 2", ("bob",)),
        ("update meta set value = 'a b' where name = 'manager'", ("a b",)),
        ("delete from meta where name = 'manager'", ("s",)),
        ("delete from meta", ("s",)),
        ("drop table events", ("s",)),
        ("drop table meta", ("s",)),
        (
            "update meta set value = '1' where name = 'schema'",
            ("format", "1", "2"),
        ),
        ("create table t (a)", ("t",)),
    ],
)
def test_a_store_that_was_changed_is_refused_and_stays_as_it_is(
    tmp_path: Path, change: str, words: tuple[str, ...]
):
    path = tmp_path / "s"
    with managed(path, clock := Clock()) as manager:
        ann, bob = joined(manager, clock, "ann", "bob")
        clock.now += 1
        for agent, other in ((bob, "ann"), (ann, "bob"), (ann, "bob")):
            manager.rate([agent.rating(other, 0.5)])
    with closing(sqlite3.connect(path)) as connection:
        connection.execute(change)
        connection.commit()
        connection.execute("pragma wal_checkpoint(truncate)")
    before = path.read_bytes()
    with refuses((StoreError, ValueError), *words), managed(path, clock):
        pass
    assert path.read_bytes() == before


def test_a_store_has_one_manager_and_one_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    JournalStore(":memory:").open()  # is a file, as any other text
    assert (tmp_path / ":memory:").is_file()
    with (
        managed(tmp_path / "s", Clock()),
        refuses(StoreError, "s"),
    ):
        JournalStore(str(tmp_path / "s")).open()
    with refuses(ValueError, "m", "n"):
        JournalStore(str(tmp_path / "s"), "n").open()
    with sqlite3.connect(tmp_path / "s") as connection:
        connection.execute("update meta set value = '1' where name = 'schema'")
    with refuses(ValueError, "format", "1", "2"):
        JournalStore(str(tmp_path / "s")).open()
    with sqlite3.connect(tmp_path / "s") as connection:
        connection.execute("delete from meta where name = 'schema'")
    (tmp_path / "text").write_text("no database" * 1000)
    for address, words in (
        (str(tmp_path / "s"), ("None", "2")),
        ("", ("postgresql",)),
        (f"sqlite:///{tmp_path}/new", ("SQLite",)),  # whose lock would be another
        ("mysql://x/y", ("SQLite",)),
        (str(tmp_path / "text"), ("text",)),
    ):
        with refuses((ValueError, StoreError), *words):
            JournalStore(address).open()
    for change in ({"every": float("inf")}, {"tolerance": float("nan")}, {"tolerance": -1.0}):
        with refuses(ValueError, *change, *change.values()):
            make_settings(**change)
    with refuses(ValueError, "a b"):
        JournalStore(str(tmp_path / "new"), "a b")
    assert not (tmp_path / "new").exists()


def test_a_store_that_was_deleted_or_replaced_takes_nothing(tmp_path: Path):
    clock, path = Clock(), tmp_path / "s"
    with managed(path, clock) as manager:
        ann, _ = joined(manager, clock, "ann", "bob")
        for change in (path.unlink, path.touch):
            change()
            with refuses(StoreError, str(path)):
                manager.rate([ann.rating("bob", 1)])
        assert manager.about()["ratings"] == 0


def test_a_store_has_one_manager_under_all_its_names(tmp_path: Path):
    with managed(tmp_path / "a", Clock()):
        (tmp_path / "b").hardlink_to(tmp_path / "a")
        with refuses(StoreError, "b"):
            JournalStore(str(tmp_path / "b")).open()


def test_a_closed_store_is_one_file_and_a_running_one_can_be_copied(tmp_path: Path):
    clock, path = Clock(), tmp_path / "s"
    with managed(path, clock) as manager:
        ann, _ = joined(manager, clock, "ann", "bob")
        manager.rate([ann.rating("bob", 1)])
        back_up(path, tmp_path / "copy")
        with refuses(FileExistsError, "copy"):
            back_up(path, tmp_path / "copy")
    assert {file.name for file in tmp_path.iterdir()} == {"s", "copy"}
    assert {file.stat().st_mode & 0o777 for file in tmp_path.iterdir()} == {0o600}
    for name in ("s", "copy"):
        with closing(sqlite3.connect(tmp_path / name)) as connection:
            assert connection.execute("select max(seq) from events").fetchone() == (3,)
    with managed(tmp_path / "copy", clock) as manager:
        assert manager.about()["ratings"] == 1


@pytest.mark.parametrize("model", ["role-trust", "travos"])
def test_a_start_with_a_snapshot_is_as_one_without(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, model: str
):
    """And what was altered since is found; `travos` is played anew at each start."""
    monkeypatch.setattr(managers, "_FEW", 1)
    clock, path = Clock(), tmp_path / "s"
    with managed(path, clock, model=model) as manager:
        ann, bob = joined(manager, clock, "ann", "bob")
        for _ in range(3):
            manager.rate([ann.rating("bob", 0.75)])
            manager.rate([bob.rating("ann", 0.25, jti="one")])
            clock.now += QUICK.every
    kept = (tmp_path / "s.snapshot").read_bytes()
    with managed(path, clock, model=model) as manager:
        last = ann.rating("bob", 0.5)
        (receipt,) = manager.rate([last])
        clock.now += QUICK.every
        manager.advance()
        found = manager.about(), standings(manager), manager.checkpoint()
    for content in (kept, b"", kept[:-9], None):
        (tmp_path / "s.snapshot").unlink()
        if content is not None:
            (tmp_path / "s.snapshot").write_bytes(content)
        with managed(path, clock, model=model) as manager:
            assert (manager.about(), standings(manager), manager.checkpoint()) == found
            assert manager.rate([last]) == [receipt]
            refused(manager, RefusalReason.TAKEN, "register", Agent("bob", clock, 7).registration())
    (tmp_path / "s.snapshot").write_bytes(kept)
    for change, seq in (
        ("update events set token = cast(token as blob) where seq = 3", 3),
        ("update events set provider = 'ann', rating = 1.0 where seq = 1", 1),
        ("update events set rating = 0.5 where seq = 4", 4),
    ):
        altered = tmp_path / f"altered-{seq}"
        shutil.copy(path, altered)
        altered.with_name(f"{altered.name}.snapshot").write_bytes(kept)
        with closing(sqlite3.connect(altered)) as connection:
            connection.execute(change)
            connection.commit()
        with refuses(StoreError, seq), managed(altered, clock, model=model):
            pass
    monkeypatch.setattr(managers, "getfile", lambda _: str(tmp_path / "nowhere"))
    with managed(path, clock, model=model) as manager:  # as of a class of a notebook
        assert manager.checkpoint() == found[2]
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "nowhere"))
    with managed(path, clock, model=model) as manager:
        assert manager.checkpoint() == found[2]


def test_a_key_is_replaced_by_the_old_one_and_the_recovery_key(tmp_path: Path):
    clock, path = Clock(), tmp_path / "s"
    owner = Agent("owner", clock)
    with managed(path, clock) as manager:
        ann, bob = Agent("ann", clock), Agent("bob", clock)
        ann.recovery = key_as_text(owner.key.public_key())
        for agent in (ann, bob):
            manager.register(agent.registration())
        own, bob.recovery = bob.recovery, ann.recovery
        refused(manager, RefusalReason.TAKEN, "register", bob.registration())
        bob.recovery = own
        first = ann.rating("bob", 0.25)
        manager.rate([first])
        for wrong in (ann.rotation(seed=1), ann.rotation(seed=1, recovery=bob.key)):
            refused(manager, RefusalReason.MIS_SIGNED, "rotate", "ann", wrong)
        thief, clock.now = Agent("ann", clock, seed=9), clock.now + 1
        refused(manager, RefusalReason.MIS_SIGNED, "rotate", "ann", thief.rotation(1, owner.key))
        late = manager.check(Request(Rating, [ann.rating("bob", 0.75)]))
        token = ann.rotation(seed=1, recovery=owner.key)
        (receipt,) = manager.take([manager.check(Request(Rotation, [token], "ann"))])[0]
        assert manager.rotate("ann", token) == receipt
        assert isinstance(manager.take([late])[0], RefusedError)
        refused(manager, RefusalReason.MIS_SIGNED, "rate", [ann.rating("bob", 0.5)])
        ann.key = Agent("ann", clock, seed=1).key
        manager.rate([ann.rating("bob", 0.5)])
        manager.rotate("bob", bob.rotation(seed=2))
        assert manager.member("bob").key == key_as_text(Agent("bob", clock, 2).key.public_key())
    settings = replace(QUICK, every=1.0)
    with managed(path, clock, settings, "mean") as manager:
        manager.rate([ann.rating("bob", 1)])
        refused(manager, RefusalReason.TAKEN, "register", thief.registration())
        clock.now += 10
        manager.advance()
        trust = manager.standings(manager.member("bob"))[0].trust
    found = check_store(path, Mean(), settings, {"bob": Agent("bob", clock).key.public_key()})
    assert (found.events, found.rankings["ratee"].names) == (7, ["bob"])
    assert found.rankings["ratee"].trust["bob"] == trust
    check_store(path, Mean(), settings, {"ann": ann.key.public_key()})
    with refuses(StoreError, "2", "bob"):
        check_store(path, Mean(), settings, {"bob": ann.key.public_key()})


def test_a_forged_store_is_found_by_signatures(tmp_path: Path):
    """Whoever writes the store can make a root hash that fits, but no signature."""
    clock, path = Clock(), tmp_path / "s"
    with managed(path, clock) as manager:
        ann, *_ = joined(manager, clock, "ann", "bob")
        token = ann.rating("bob", 1)
        manager.rate([token])
        at = manager.checkpoint()
    head, _, signature = token.split(".")
    claims = json.loads(base64.urlsafe_b64decode(token.split(".")[1] + "=="))
    claims["rating"] = 0.0
    payload = base64.urlsafe_b64encode(json.dumps(claims).encode()).decode().rstrip("=")
    forged = f"{head}.{payload}.{signature}"
    with closing(sqlite3.connect(path)) as connection:
        connection.execute("update events set rating = 0.0, token = ? where seq = 3", (forged,))
        rows = connection.execute("select seq, time, token from events order by seq")
        root = MerkleTree(b"".join(leaf_hash(event_leaf(*row)) for row in rows)).root()
        connection.execute("update meta set value = ? where name = 'head'", (f"3 {root.hex()}",))
        connection.commit()
    with managed(path, clock) as manager:
        assert manager.about()["ratings"] == 1
        assert manager.checkpoint() != at
    with refuses(StoreError, "3", "ann"):
        check_store(path, Mean(), QUICK)
