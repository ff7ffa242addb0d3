"""The trust manager without HTTP: what counts, what is refused, and trust as `roletrust rate` has
it."""

import random
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import jwt
import numpy as np
import pytest
from cryptography.exceptions import InvalidSignature
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey
from postgres import postgres
from refusals import refuses
from signing_agents import (
    NAME,
    QUICK,
    START,
    Agent,
    Clock,
    OneByOne,
    joined,
    managed,
    refused,
    standings,
)
from sqlalchemy import text

from roletrust_env.logs import TrustStream, read
from roletrust_env.logs.rate import ROLES, rate
from roletrust_env.logs.rounds import MOST
from roletrust_manager.admission.validation import RefusalReason
from roletrust_manager.http import checks, journal_trust
from roletrust_manager.http.manager import TrustManager
from roletrust_manager.http.requests import RefusedError, Request
from roletrust_manager.http.tokens import (
    Leave,
    Rating,
    Registration,
    key_as_text,
    read_token,
    sign_token,
)
from roletrust_manager.journal.sql import JournalStore, StoreError


def as_rated(manager: OneByOne, path: Path, model: str) -> None:
    """Check that trust is that of `roletrust rate` on the export."""
    path.write_text(manager.export(counted=True)[0])
    settings = manager.settings
    log = read(path, scale=settings.scale, same_agents=settings.same_agents)
    rated = rate(log, model=model, every=settings.every)
    for role in ROLES:
        wanted = rated.evidence(role)
        found, order = manager._trust.rankings[role], wanted.ranked()
        assert found.names == list(wanted.names.at(order))
        for name, one, other in zip(wanted._fields[1:], wanted[1:], found._columns, strict=True):
            one, other = (np.asarray(each).astype(float) for each in (one[order], other))
            np.testing.assert_allclose(other, one, rtol=0, atol=1e-12, err_msg=name)


def test_a_rating_after_more_silence_than_a_stream_takes_is_not_acknowledged(tmp_path: Path):
    """And the store is played again as it stands."""
    clock = Clock()
    with managed(str(tmp_path / "s"), clock, replace(QUICK, every=1.0, tolerance=1e6)) as manager:
        ann, _ = joined(manager, clock, "ann", "bob")
        manager.rate([ann.rating("bob", 1)])
        clock.now += MOST - 3
        manager.rate([ann.rating("bob", 0)])
        clock.now += MOST + 3
        with refuses(StoreError, "--every"):
            manager.rate([ann.rating("bob", 1)])
        before = standings(manager)
    with managed(str(tmp_path / "s"), clock, replace(QUICK, every=1.0, tolerance=1e6)) as manager:
        assert standings(manager) == before
        assert before["bob"][0].ratings == 2


@pytest.mark.parametrize(
    ("model", "same_agents"),
    [("role-trust", True), pytest.param("first-hand", False, marks=pytest.mark.slow)],
)
def test_trust_is_that_of_rate_on_the_export(tmp_path: Path, model: str, same_agents: bool):
    check_trust(str(tmp_path / "s"), tmp_path, model, same_agents=same_agents)


@pytest.mark.slow
def test_postgresql_keeps_the_same(tmp_path: Path):
    with postgres() as address:
        check_trust(address, tmp_path, "leave-one-out")
        with managed(
            address, clock := Clock(START + 10_000), replace(QUICK, scale=(1.0, 5.0))
        ) as manager:
            with refuses(StoreError, "postgres"):
                JournalStore(address).open()
            ann, _ = joined(manager, clock, "ann", "bob")
            check_failures(manager, ann)
            break_connection(manager)
            one = ann.rating("bob", 1)
            assert isinstance(manager.take([manager.check(Request(Rating, [one]))])[0], StoreError)
            assert manager.rate([one])


def break_connection(manager: OneByOne) -> None:
    """Let the connection on which the store is written end, as when the server is started anew."""
    with manager._store._engine.connect() as other:
        own = manager._store._writer().connection.driver_connection.info.backend_pid
        other.execute(text("select pg_terminate_backend(:own)"), {"own": own})


def check_trust(address: str, tmp_path: Path, model: str, *, same_agents: bool = True) -> None:
    """Check trust also after the clock went back, agents left and came back, rounds were silent,
    and each restart."""
    clock, draw = Clock(), random.Random(7)
    settings = replace(QUICK, every=10.0, scale=(1.0, 5.0), same_agents=same_agents, tolerance=1e6)
    with managed(address, clock, settings, model) as manager:
        agents = joined(manager, clock, "null", "NaN", "true", "_1", "did:web:x.y@z+a-b", "f")
    for restart in range(2):
        with managed(address, clock, settings, model) as manager:
            for _ in range(25):
                rater, *rated = draw.sample(agents, 3)
                manager.rate([rater.rating(one.name, draw.choice([1, 2.5, 4, 5])) for one in rated])
                clock.now += draw.choice([0, 0.1, 3, 3, -2, 47])
            manager.leave("f", agents[5].farewell())
            manager.register(agents[5].registration())
            clock.now += 20
            manager.rate([agents[5].rating("null", 3)])  # in a round that has not ended
            assert [one.ratings for one in standings(manager)["f"]] == [0, 0]
            as_rated(manager, tmp_path / f"{restart}.csv", model)
            before = standings(manager)
        with managed(address, clock, settings, model) as manager:
            assert standings(manager) == before
            clock.now += 20
            assert manager.advance()
            as_rated(manager, tmp_path / f"{restart}.csv", model)
            assert manager.about()["counted"] == manager.about()["ratings"]
    other = replace(settings, every=25.0)
    clock.now += 50
    with managed(
        address, clock, other, "beta"
    ) as manager:  # another model and length of a round: a replay
        as_rated(manager, tmp_path / "other.csv", "beta")


@pytest.mark.parametrize("model", ["role-trust", "travos"])
def test_a_round_is_told_of_once_its_trust_is_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, model: str
):
    """Other threads read the state while the round is played."""
    clock, seen, ranking = Clock(), [], journal_trust.Ranking

    def looked(*evidence: Any) -> Any:
        seen.append(manager.about())
        return ranking(*evidence)

    with managed(tmp_path / "s", clock, model=model) as manager:
        ann, _ = joined(manager, clock, "ann", "bob")
        manager.rate([ann.rating("bob", 1)])
        monkeypatch.setattr(journal_trust, "Ranking", looked)
        clock.now += 2 * QUICK.every
        manager.advance()
        states = [(about["rounds"], about["counted"]) for about in (*seen, manager.about())]
    assert states == [(0, 0), (0, 0), (1, 1)]


def test_what_is_not_valid_is_refused_and_counted(tmp_path: Path):
    clock = Clock()
    with managed(tmp_path / "s", clock, replace(QUICK, quota=4, newcomers=5)) as manager:
        ann, bob, _ = joined(manager, clock, "ann", "bob", "cec")
        eve, stranger = Agent("ann", clock, seed=1), Agent("zoe", clock)
        first = ann.rating("bob", 0.5)
        manager.rate([first])
        clock.now += 1
        manager.rate([ann.rating("bob", 0.5)])
        for reason, make in (
            (RefusalReason.GARBAGE, lambda: "x.y.z"),
            (RefusalReason.GARBAGE, lambda: ann.farewell()),
            (RefusalReason.UNKNOWN, lambda: stranger.rating("ann", 0.1)),
            (RefusalReason.MIS_SIGNED, lambda: eve.rating("bob", 0.1, iat=clock.now + 2)),
            (RefusalReason.MIS_SIGNED, lambda: altered(ann.rating("bob", 0.1))),
            (RefusalReason.UNSIGNED, lambda: ann.rating("bob", 0.1).rpartition(".")[0] + "."),
            (RefusalReason.REPLAYED, lambda: first),
            (RefusalReason.ELSEWHERE, lambda: ann.rating("bob", 0.1, aud="other")),
            (RefusalReason.ITSELF, lambda: ann.rating("ann", 1)),
            (RefusalReason.UNKNOWN_PROVIDER, lambda: ann.rating("zoe", 1)),
            (RefusalReason.OUT_OF_RANGE, lambda: ann.rating("bob", 1.5)),
            (RefusalReason.PAST, lambda: ann.rating("bob", 1, iat=clock.now - 100)),
            (RefusalReason.FUTURE, lambda: ann.rating("bob", 1, iat=clock.now + 100)),
        ):
            error = refused(manager, reason, "rate", [ann.rating("cec", 0.2), make()])
            assert error.at == 1
            assert error.detail
        refused(
            manager, RefusalReason.DOUBLED, "rate", [ann.rating("bob", 0.2), ann.rating("bob", 0.3)]
        )
        manager.rate([ann.rating(name, 0.1) for name in ("bob", "cec")])
        refused(manager, RefusalReason.FLOOD, "rate", [ann.rating("bob", 0.1)])
        refused(manager, RefusalReason.TAKEN, "register", eve.registration())
        refused(manager, RefusalReason.NO_WORK, "register", lazy(stranger))
        refused(manager, RefusalReason.ELSEWHERE, "leave", "bob", ann.farewell())
        assert manager.register(ann.registration()).seq == 1  # registered already
        joined(manager, clock, "x", "y")
        refused(manager, RefusalReason.CROWDED, "register", stranger.registration())
        clock.now += 60
        manager.register(stranger.registration())
        manager.rate([ann.rating("bob", 0.1)])
        manager.leave("bob", bob.farewell())
        refused(manager, RefusalReason.UNKNOWN, "rate", [bob.rating("ann", 1)])
        refused(manager, RefusalReason.UNKNOWN_PROVIDER, "rate", [ann.rating("bob", 1)])
        refused(
            manager, RefusalReason.TAKEN, "register", Agent("bob", clock, seed=1).registration()
        )


def test_equals_are_ranked_by_name_as_rate_does(tmp_path: Path):
    """Not by the order in which they came, which is another one where rounds are played one by
    one."""
    with managed(tmp_path / "s", clock := Clock(), model="mean") as manager:
        r, y, x, _ = joined(manager, clock, "r", "y", "x", "z")
        manager.rate([r.rating("y", 0.5)])
        clock.now += 100
        manager.rate([r.rating("x", 0.5)])
        manager.rate([x.rating("z", 0.5)])
        manager.rate([y.rating("z", 0.5)])
        clock.now += 100
        manager.advance()
        as_rated(manager, tmp_path / "e.csv", "mean")
        assert manager._trust.rankings["ratee"].names == ["z", "x", "y"]


def test_limits_of_a_round_go_on_after_a_restart(tmp_path: Path):
    clock, settings = Clock(), replace(QUICK, every=10.0, quota=2, newcomers=3)
    with managed(tmp_path / "s", clock, settings) as manager:
        ann, bob = joined(manager, clock, "ann", "bob")
        manager.rate([ann.rating("bob", 1)])
        clock.now += 12  # the round of this rating is over
        manager.rate([ann.rating("bob", 1)])
        manager.leave("ann", ann.farewell())
        manager.register(ann.registration())  # as ann~2, which is the same agent for a quota
        manager.rate([ann.rating("bob", 1)])
        joined(manager, clock, "cec", "dan")
    with managed(tmp_path / "s", clock, settings) as manager:
        refused(manager, RefusalReason.FLOOD, "rate", [ann.rating("bob", 1)])
        refused(manager, RefusalReason.CROWDED, "register", Agent("eve", clock).registration())
        manager.rate([bob.rating("ann", 1)])


@pytest.mark.parametrize("restarts", [False, True], ids=["running", "restarted"])
def test_rounds_go_on_when_the_clock_was_ahead(
    tmp_path: Path, restarts: bool, caplog: pytest.LogCaptureFixture
):
    clock, settings = Clock(), replace(QUICK, every=10.0, quota=1)
    with managed(tmp_path / "s", clock, settings) as manager:
        ann, _ = joined(manager, clock, "ann", "bob")
        clock.now += 3600
        _, cec = joined(manager, clock, "dan", "cec")
        if not restarts:
            clock.now -= 3600
            rounds_in_their_time(manager, clock, ann)
    if restarts:
        clock.now -= 3600
        with managed(tmp_path / "s", clock, settings) as manager:
            rounds_in_their_time(manager, clock, ann)
            refused(manager, RefusalReason.FUTURE, "rate", [cec.rating("bob", 1)])
    assert len(caplog.records) == 1


def rounds_in_their_time(manager: OneByOne, clock: Clock, rater: Agent) -> None:
    """Rate once in each of three rounds, which take ten seconds."""
    manager.rate([rater.rating("bob", 1)])
    for number in (1, 2, 3):
        clock.now, clock.passed = clock.now + 9, clock.passed + 9
        refused(manager, RefusalReason.FLOOD, "rate", [rater.rating("bob", 1)])
        clock.now, clock.passed = clock.now + 1, clock.passed + 1
        manager.rate([rater.rating("bob", 1)])
        assert manager.rounds == number


@pytest.mark.parametrize(
    "point",
    [
        f"01{'00' * 31}",
        f"ec{'ff' * 30}7f",
        "00" * 32,
        f"{'00' * 31}80",
        "26e8958fc2b227b045c3f489f2ef98f0d5dfac05d3c63339b13802886d53fc05",
        "26e8958fc2b227b045c3f489f2ef98f0d5dfac05d3c63339b13802886d53fc85",
        "c7176a703d4dd84fba3c0b760d10670f2a2053fa2c39ccc64ec7fd7792ac037a",
        "c7176a703d4dd84fba3c0b760d10670f2a2053fa2c39ccc64ec7fd7792ac03fa",
        f"ed{'ff' * 30}7f",  # the same as 0 and 1, not canonical
        f"ee{'ff' * 30}7f",
    ],
)
def test_a_key_with_which_everybody_signs_is_refused(tmp_path: Path, point: str):
    """The eight points of small order: a signature without a secret is valid for one in eight
    texts, or for each."""
    key, ann = Ed25519PublicKey.from_public_bytes(bytes.fromhex(point)), Agent("ann", Clock())
    for work in range(1000):
        claims = Registration(iss="eve", aud=NAME, iat=START, key=key_as_text(key), work=work)
        signed = sign_token(claims, ann.key).rpartition(".")[0]
        with suppress(InvalidSignature):
            key.verify(bytes([1]) + bytes(63), signed.encode())
            break
    with managed(tmp_path / "s", Clock(), replace(QUICK, work=0)) as manager:
        refused(manager, RefusalReason.GARBAGE, "register", f"{signed}.AQ{'A' * 84}")
        written_otherwise = Registration(
            **ann._claims(), key=key_as_text(ann.key.public_key())[:-1] + "F"
        )
        refused(manager, RefusalReason.GARBAGE, "register", sign_token(written_otherwise, ann.key))


def altered(token: str) -> str:
    head, claims, signature = token.split(".")
    return ".".join([head, claims, ("B" if signature[0] == "A" else "A") + signature[1:]])


def lazy(agent: Agent) -> str:
    return next(token for _ in iter(int, 1) if not has_luck(token := agent.registration(0)))


def has_luck(token: str) -> bool:
    from roletrust_manager.http.tokens import Registration, has_work, read_token

    return has_work(read_token(token, Registration)[0], QUICK.work)


def test_the_last_request_may_be_sent_again(tmp_path: Path):
    """Also after a restart and when its stamps are old; it counts once."""
    clock = Clock()
    with managed(tmp_path / "s", clock) as manager:
        ann, *_ = joined(manager, clock, "ann", "bob", "cec")
        tokens = [ann.rating(name, 0.5) for name in ("bob", "cec")]
        receipts = manager.rate(tokens)
        assert manager.rate(tokens) == receipts
        refused(manager, RefusalReason.REPLAYED, "rate", tokens[:1])
        last = ann.rating("bob", 0.1)
        same = manager.take([manager.check(Request(Rating, [last]))] * 2)
        assert same[0] == same[1]
    with managed(tmp_path / "s", clock) as manager:
        clock.now += 1000
        assert manager.rate([last]) == same[0]
        refused(manager, RefusalReason.PAST, "rate", [tokens[0]])
        assert manager.about()["ratings"] == 3


def test_what_cannot_be_stored_counts_for_nothing(tmp_path: Path):
    clock = Clock()
    with managed(tmp_path / "s", clock) as manager:
        ann, _ = joined(manager, clock, "ann", "bob")
        check_failures(manager, ann)
        clock.now = START + 100
        manager.advance()
        as_rated(manager, tmp_path / "e.csv", "role-trust")


def test_a_model_that_fails_ends_the_taking_of_ratings(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """What was acknowledged is kept, and another model begins with it."""
    clock = Clock()
    with managed(tmp_path / "s", clock) as manager:
        ann, _ = joined(manager, clock, "ann", "bob")
        manager.rate([ann.rating("bob", 1)])
        clock.now += 100
        with monkeypatch.context() as patch:
            patch.setattr(TrustStream, "update", lambda *_: int("no number"))
            with refuses(StoreError, "role-trust", "no number"):
                manager.advance()
        for _ in range(2):
            with refuses(StoreError, "role-trust"):
                manager.rate([ann.rating("bob", 1)])
    with managed(tmp_path / "s", clock, model="mean") as manager:
        assert manager.about()["counted"] == manager.about()["ratings"] == 1


def check_failures(manager: OneByOne, ann: Agent) -> None:
    """Check that nothing counts if the disk is full, nor if the store does not say whether it has
    written."""
    append = JournalStore.append
    for written in (False, True):

        def failing(store: JournalStore, *new: object, written: bool = written) -> None:
            if written:
                append(store, *new)
            raise StoreError("disk full")

        before = manager.about()
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(JournalStore, "append", failing)
            one = ann.rating("bob", 1)
            (stored,) = manager.take([manager.check(Request(Rating, [one]))])
            assert isinstance(stored, StoreError)
            assert {**manager.about(), "time": 0} == {**before, "time": 0}
        manager.rate([one])  # the same token counts once, now or already
        assert manager.about()["ratings"] == before["ratings"] + 1


def test_a_batch_that_breaks_leaves_nothing_behind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    with managed(tmp_path / "s", clock := Clock()) as manager:
        ann, bob = joined(manager, clock, "ann", "bob")
        new, other = Agent("new", clock), bob.rating("ann", 1)
        with monkeypatch.context() as patch:
            for broken in ("_registered", "_note"):
                patch.setattr(TrustManager, broken, lambda *_: 1 / 0)
                checked = manager.check(Request(Rating, [ann.rating("bob", 1)]))
                newcomer = manager.check(Request(Registration, [new.registration()]))
                with pytest.raises(ZeroDivisionError):
                    manager.take([checked, newcomer] if broken == "_registered" else [checked])
                patch.undo()
        manager.rate([other])
        lines = manager.export()[0].splitlines()[1:]
        assert [line[:11] for line in lines] == ["ann,bob,1.0", "ann,bob,1.0", "bob,ann,1.0"]
        assert manager.about()["ratings"] == 3  # what was written counts, though nobody was told


def test_requests_of_a_batch_that_depend_on_one_another_are_taken_in_order(tmp_path: Path):
    clock = Clock()
    with managed(tmp_path / "s", clock) as manager:
        ann, bob, cec = joined(manager, clock, "ann", "bob", "cec")
        leaves, rates = Request(Leave, [bob.farewell()], "bob"), [ann.rating("bob", 1)]
        new = Agent("new", clock)
        batch = [leaves, Request(Rating, rates), Request(Registration, [new.registration()])]
        checked = [manager.check(request) for request in batch]
        _, refused_one, _ = manager.take(checked)
        assert isinstance(refused_one, RefusedError)
        assert refused_one.reason is RefusalReason.UNKNOWN_PROVIDER
        first, second = ([cec.rating("new", 1)], [cec.rating("ann", 1)])
        taken = manager.take([manager.check(Request(Rating, one)) for one in (first, second)])
        assert [receipts[0].seq for receipts in taken] == [6, 7]
    with managed(tmp_path / "s", clock) as manager:
        assert manager.about()["ratings"] == 2


def test_a_token_is_read_by_one_rule(tmp_path: Path):
    """What the rule of a start would not take is refused, and not written."""
    clock, wide = Clock(), replace(QUICK, scale=(0.0, 1e17))
    with managed(tmp_path / "s", clock, wide) as manager:
        ann, _ = joined(manager, clock, "ann", "bob")
        clock.now += 1
        claims = {"iss": "ann", "aud": NAME, "iat": clock.now, "sub": "bob", "rating": 1}
        kind = {"kind": "rating"}
        for change in (claims, claims | {"kind": "leave"}):
            refused(manager, RefusalReason.GARBAGE, "rate", [jwt.encode(change, ann.key, "EdDSA")])
        exact = claims | kind | {"rating": 2**53 + 1, "aud": [NAME]}
        manager.rate([jwt.encode(exact, ann.key, "EdDSA")])
    with managed(tmp_path / "s", clock, wide) as manager:
        assert manager.about()["ratings"] == 1


def test_registered_claims_are_honoured(tmp_path: Path):
    """`exp`, `nbf`, and `jti` for libraries that sign in whole seconds; also after a restart."""
    clock = Clock()
    with managed(tmp_path / "s", clock) as manager:
        ann, *_ = joined(manager, clock, "ann", "bob", "cec")
        now = clock.now + 5
        clock.now = now
        for claims, reason in (
            ({"exp": now}, RefusalReason.PAST),
            ({"exp": now - 1.5}, RefusalReason.PAST),
            ({"nbf": now + QUICK.tolerance + 1}, RefusalReason.FUTURE),
            ({"aud": "other"}, RefusalReason.ELSEWHERE),
        ):
            refused(manager, reason, "rate", [ann.rating("bob", 1, **claims)])
        second = int(now) + 1
        tokens = [
            ann.rating(name, 1, iat=second, jti=jti)
            for name, jti in (("bob", "a"), ("cec", "b"), ("bob", "c"), ("cec", "c"))
        ]
        manager.rate(tokens[:2])
        manager.rate([ann.rating("bob", 1, exp=now + 9, nbf=now, iat=second, jti="d")])
        refused(manager, RefusalReason.REPLAYED, "rate", tokens[:1])
        refused(manager, RefusalReason.REPLAYED, "rate", tokens[2:])
        refused(manager, RefusalReason.REPLAYED, "rate", [ann.rating("bob", 1, iat=second)])
    with managed(tmp_path / "s", clock) as manager:
        refused(manager, RefusalReason.REPLAYED, "rate", tokens[:1])
        manager.rate(tokens[2:3])
        assert manager.about()["ratings"] == 4


def test_a_request_of_old_tokens_is_refused_by_its_last_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    clock, read = Clock(), []
    with managed(tmp_path / "s", clock) as manager:
        ann, *_ = joined(manager, clock, "ann", "bob", "cec")
        tokens = [ann.rating("bob", 1) for _ in range(20)]
        for token in tokens:
            manager.rate([token])
        monkeypatch.setattr(checks, "read_token", lambda *a: read.append(a) or read_token(*a))
        monkeypatch.setattr(checks, "is_genuine", lambda *_: 1 / 0)
        refused(manager, RefusalReason.REPLAYED, "rate", tokens[:-1])
        assert len(read) == 1
