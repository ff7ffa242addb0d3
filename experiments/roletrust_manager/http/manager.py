"""The trust manager of agents that report ratings: who may rate, what is acknowledged, and how far
each agent can be trusted.
"""

import logging
import time
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import asdict
from functools import partial
from hashlib import sha256
from importlib.metadata import version
from inspect import getfile
from pathlib import Path
from secrets import token_hex
from typing import Any

from sqlalchemy import select

from roletrust_env.evaluation.specs import parse_named
from roletrust_env.logs.evidence import Role
from roletrust_env.logs.explain import Explanation
from roletrust_env.parameters import truth_value
from roletrust_env.trust.model import TrustModel, registry
from roletrust_manager.admission.validation import Admission, RefusalReason
from roletrust_manager.http.checks import RequestChecks
from roletrust_manager.http.journal_trust import JournalTrust, RoundEnd, Standing
from roletrust_manager.http.members import Members, name_of
from roletrust_manager.http.requests import (
    MICROSECONDS,
    Checked,
    Member,
    Receipt,
    RefusedError,
    Request,
    Settings,
    Signed,
    refusal,
)
from roletrust_manager.http.snapshot import Snapshot, read_snapshot, write_snapshot
from roletrust_manager.http.tokens import Rating, Registration
from roletrust_manager.journal.checkpoint import Checkpoint, sign_checkpoint, verifier_key
from roletrust_manager.journal.merkle import MerkleTree
from roletrust_manager.journal.sql import BLOCK, Event, JournalStore, StoreError, events
from roletrust_manager.journal.verify import event_leaf

MOST_ROWS = 10_000
"""Number of rows in a page of an export."""

_log = logging.getLogger(__name__)
_VERSION = version("roletrust-env")
_AHEAD_S = 10.0  # of which the operator is told
_KEPT_EVERY, _FEW = 50_000, 10_000  # events; a replay of a few takes no time


class TrustManager:
    """Takes signed ratings, keeps them, and computes trust.

    What it has acknowledged is in the store. All else follows from the store by a replay at the
    start, so that another model, scale or length of a round is another start; a snapshot next to
    the store makes it short. Requests are taken by one thread. Any thread may use what only reads:
    `check`, `about`, `member`, `members`, `standings`, `explain`, `export`, and proofs.

    Args:
        store: Journal, which is opened.
        model: Name of the trust model, such as `roletrust list models` has it.
        settings: Settings.
        clock: Function that returns the time, seconds since 1970. If it is set back, rounds go on
            as if it was not.
        monotonic: Function that returns the time by a clock that nobody sets, seconds.
        make: Function that makes the trust model of a name.

    Attributes:
        refusals: Number of refusals by agent and reason, see `Admission`.
        tell: Function that is called at the end of each round.

    Raises:
        ValueError: The model or a setting is not allowed.
        StoreError: The store cannot be read, or the model cannot go on with its ratings.
    """

    def __init__(
        self,
        store: JournalStore,
        model: str,
        settings: Settings = Settings(),  # noqa: B008 - immutable
        clock: Callable[[], float] = time.time,
        make: Callable[[str], TrustModel[Any]] = partial(parse_named, registry),  # noqa: B008 - immutable
        monotonic: Callable[[], float] = time.monotonic,
    ) -> None:
        self._store, self._model, self.settings = store, model, settings
        self._clock, self._monotonic, self._read_at = clock, monotonic, monotonic()
        self._made = make(model)
        self._new: list[Event] = []  # of the requests that are being taken
        self._is_ahead = False  # whether the journal is ahead of the clock
        self._in_doubt = False  # whether the store may have more than is known
        self._failure = ""  # of the model, for good
        self.refusals: Counter[tuple[str, RefusalReason]] = Counter()
        self.tell: Callable[[RoundEnd], object] = lambda end: None
        self._time = 0
        self._trust: JournalTrust
        self._replay()

    def _replay(self) -> None:
        """Begin with what the store has, and end the round whose time is over. The store is opened
        once all that can be checked without it has been. Nothing changes if it cannot be read.
        """
        settings, store = self.settings, self._store
        trust = JournalTrust(store, self._made, settings)
        store.open()
        members, tree = Members(settings, store.name), MerkleTree()
        members.admission.refusals = self.refusals
        seq = last = ratings = 0
        digests = list[str]()
        snapshot = read_snapshot(store, self._about)
        if snapshot is not None and trust.load(snapshot.trust):
            seq, last, ratings, _, tree, _, digests = snapshot
            members.load(snapshot.members)
        kept = seq
        for event in store.history(seq, last):
            if (claims := members.fits(event)) is None:
                raise self._damaged(event)
            members.follow(event, claims)
            tree.append(event_leaf(event.seq, event.time, event.token))
            seq, last = event.seq, event.time
            if event.kind == "rating":
                trust.expect(last / MICROSECONDS)
                ratings += 1
        store.check_head(seq, tree.root())
        self._sent = self._count_sent(trust)
        self._checks = RequestChecks(store.name, settings, members, self._clock, self._n_sent)
        self._trust, self._members, self._tree = trust, members, tree
        self._seq, self._time, self._ratings = seq, max(last, self._time), ratings
        self._kept, self._digests = kept, digests
        self.advance()
        self._sent = self._count_sent(trust)

    def _count_sent(self, trust: JournalTrust) -> Counter[str]:
        """Return the number of ratings of each agent that do not count yet."""
        waiting = events.c.kind == "rating", events.c.seq > trust.counted
        rows = self._store.rows(select(events.c.sender).where(*waiting))
        return Counter(name_of(sender) for (sender,) in rows)

    def _damaged(self, event: Event) -> StoreError:
        return self._store.damaged(
            event.seq, f"{event.sender!r} cannot have sent this {event.kind}"
        )

    def _note(self, event: Event, claims: dict[str, Any]) -> None:
        """Take an event into account that is in the store, with its claims."""
        self._members.follow(event, claims)
        self._seq, self._time = event.seq, max(event.time, self._time)
        if event.kind == "rating":
            self._trust.expect(event.time / MICROSECONDS)
            self._ratings += 1
            self._sent[name_of(event.sender)] += 1

    @property
    def _about(self) -> dict[str, Any]:
        """Settings on which a snapshot depends."""
        settings = self.settings
        about = {
            "model": repr(self._made),
            "every": settings.every,
            "scale": list(settings.scale),
            "same_agents": settings.same_agents,
        }
        try:
            code = sha256(Path(getfile(type(self._made))).read_bytes()).hexdigest()
        except (OSError, TypeError):  # a class without a file, whose snapshots never fit
            code = token_hex()
        return {**about, "version": _VERSION, "code": code}

    def _keep(self) -> None:
        """Write a snapshot, if the store is a file and the disk has room; without it a restart
        takes longer.
        """
        if self._store.path is None:
            return
        at, members = (self._seq, self._time, self._ratings), self._members.save()
        known = self._digests[: self._kept // BLOCK]
        with suppress(OSError):
            self._digests = self._store.digests(self._seq, known)
            self._kept = self._seq
            snapshot = Snapshot(*at, members, self._tree, self._trust.save(), self._digests)
            write_snapshot(self._store.path, self._about, snapshot)

    # --- requests
    # -----------------------------------------------------------------------------------

    def check(self, request: Request) -> Checked:
        """Return a request whose tokens were checked as far as they can be without a turn. Any
        thread may call it.

        Raises:
            RefusedError: The request is refused, which is counted.
        """
        return self._checks.check(request)

    def _n_sent(self, name: str) -> int:
        """Return the number of ratings of an agent in the running round."""
        return 0 if self._trust.is_over(self._now()) else self._sent[name]

    def take(self, requests: Sequence[Checked]) -> list[list[Receipt] | RefusedError | StoreError]:
        """Return the answer to each request. Those that are acknowledged are in the store, by one
        transaction.

        A request counts as a whole. The last request of an agent may be sent again, and is
        acknowledged again. Refusals are counted, and change nothing else.
        """
        try:
            if self._in_doubt:
                self._tree.truncate(self._seq)
                if self._store.last() != self._seq:
                    self._replay()
            self._in_doubt = False
            self.advance()
        except StoreError as error:
            return [error] * len(requests)
        self._new.clear()  # of requests at which something has broken
        answers, names = list[list[Receipt] | RefusedError | StoreError](), set[str]()
        for request in requests:
            joins = any(not isinstance(one.claims, Rating) for one in request.signed)
            if joins or request.name in names:  # what others depend on is written for itself
                self._write(answers)
                names.clear()
            names.add(request.name)
            answers.append(self._answer(request))
            if joins:
                self._write(answers)
        self._write(answers)
        return answers

    def _write(self, answers: list[list[Receipt] | RefusedError | StoreError]) -> None:
        """Write the events of some requests, and only then take them into account. If they cannot
        be written, the answers that acknowledge them become the error.
        """
        new, self._new = self._new, []
        if not new:
            return
        try:
            if self._in_doubt:
                raise StoreError("the store is in doubt")
            said = list[dict[str, Any]]()
            for event in new:
                if (claims := self._members.fits(event)) is None:
                    raise self._damaged(event)  # rather than a store that cannot be read again
                said.append(claims)
            self._in_doubt = True
            for event in new:
                self._tree.append(event_leaf(event.seq, event.time, event.token))
            self._store.append(new, self._tree.root())
        except StoreError as error:
            for at, answer in enumerate(answers):
                if isinstance(answer, list) and answer[-1].seq > self._seq:
                    answers[at] = error
            return
        for event, claims in zip(new, said, strict=True):
            self._note(event, claims)
        self._in_doubt = False

    def _now(self) -> int:
        """Return the time, microseconds, which never goes back."""
        elapsed = self._monotonic() - self._read_at
        return max(round(self._clock() * MICROSECONDS), self._time + round(elapsed * MICROSECONDS))

    def advance(self) -> RoundEnd | None:
        """End the round whose time is over, if there is one, and return what has changed, by name.

        Raises:
            StoreError: The store cannot be read, or the model fails, now or before. Trust stays as
                it is then.
        """
        self._time, self._read_at = self._now(), self._monotonic()
        ahead = self._time / MICROSECONDS - self._clock()
        if ahead > _AHEAD_S and not self._is_ahead:
            _log.warning("the clock is %.0f s behind the journal", ahead)
        self._is_ahead = ahead > _AHEAD_S
        if self._failure:
            raise StoreError(self._failure)
        try:
            end = self._trust.advance(self._time / MICROSECONDS)
        except (ValueError, MemoryError) as error:
            self._failure = (
                f"{self._model} cannot go on, so start with another model or scale: {error}"
            )
            raise StoreError(self._failure) from None
        if end is None:
            return None
        self._sent.clear()
        here = {member.identity: member.name for member in self._members.by_name.values()}
        provider, rater = (
            {here[identity]: trust for identity, trust in side.items() if identity in here}
            for side in (end.provider, end.rater)
        )
        end = end._replace(provider=provider, rater=rater)
        if self._seq - self._kept >= _KEPT_EVERY and not self._new:
            self._keep()
        self.tell(end)
        return end

    def _answer(self, request: Checked) -> list[Receipt] | RefusedError | StoreError:
        """Return the receipts of a request, whose events are not in the store yet, or why there are
        none.
        """
        self._time += 1
        try:
            last = self._members.latest.get(request.name)
            if last is not None and last.digest == request.digest:
                return last.receipts
            if not request.signed:  # it was the last request when it was checked
                hint = f"{request.name} has sent another one"
                raise RefusedError(RefusalReason.REPLAYED, hint, 0, request.name)
            if isinstance(request.signed[0].claims, Registration):
                return self._registered(request.signed[0])
            new = self._events(request)
        except RefusedError as refused:
            self._members.admission.refuse(refused.sender, refused.reason)
            return refused
        except StoreError as error:
            return error
        self._new += new
        return [Receipt(event.seq, event.time / MICROSECONDS) for event in new]

    def _events(self, request: Checked) -> list[Event]:
        """Return the events of a member's request, which is checked again as far as something may
        have changed.

        Raises:
            RefusedError: A token is refused.
            StoreError: There have been too many rounds without a rating.
        """
        members, claims = self._members, request.signed[0].claims
        member = members.by_name.get(request.name)
        if member is None:
            raise refusal(RefusalReason.UNKNOWN, claims, 0, "register it first")
        if request.key != members.keys[request.name]:  # which was replaced since
            raise refusal(RefusalReason.MIS_SIGNED, claims, 0, "sign it with the new key")
        self._checks.check_order(request.signed)
        if isinstance(claims, Rating) and not self._trust.has_round(self._time / MICROSECONDS):
            raise StoreError(
                "there have been too many rounds without a rating; start with a longer --every"
            )
        return [self._event(one, at, member.identity) for at, one in enumerate(request.signed)]

    def _registered(self, signed: Signed) -> list[Receipt]:
        """Return the receipt of a registration.

        Raises:
            RefusedError: It is refused.
        """
        claims, members = signed.claims, self._members
        self._checks.check_registration(signed)
        if claims.iss in members.by_name:
            return [members.by_name[claims.iss].receipt]
        hint = ""
        if not members.limit.has_room(self._time * 1000):
            hint = f"{self.settings.newcomers:,} in a round are allowed"
        elif not self._trust.fits(members.begun + 1):
            hint = f"{self._model} has no room for more agents"
        if hint:
            raise refusal(RefusalReason.CROWDED, claims, 0, hint)
        event = self._event(signed, 0, members.next_identity(claims.iss))
        self._new.append(event)
        return [Receipt(event.seq, event.time / MICROSECONDS)]

    def _event(self, signed: Signed, at: int, sender: str) -> Event:
        """Return the event of a token, which has a place in its request."""
        claims, provider, rating = signed.claims, None, None
        if isinstance(claims, Rating):
            provider, rating = self._members.by_name[claims.sub].identity, claims.rating
        seq = self._seq + len(self._new) + at + 1
        what = (claims.kind, self._time, sender, claims.stamp, provider, rating)
        return Event(seq, *what, signed.token)

    # --- what only reads
    # ----------------------------------------------------------------------------

    @property
    def name(self) -> str:
        """Name of the manager."""
        return self._store.name

    @property
    def takes_long(self) -> bool:
        """True if `take` would wait for more than a file: a round is over, the store has to be read
        again, or it is on a server.
        """
        return self._in_doubt or self._store.path is None or self._trust.is_over(self._now())

    @property
    def admission(self) -> Admission:
        """Counts refusals."""
        return self._members.admission

    @property
    def rounds(self) -> int:
        """Number of rounds that have ended."""
        return self._trust.rounds

    @property
    def time(self) -> float:
        """Time of the last request or end of a round, seconds."""
        return self._time / MICROSECONDS

    def about(self) -> dict[str, Any]:
        """Return what this manager is, and its state, by the fields of `About`."""
        return {
            "name": self.name,
            "key": verifier_key(self._store.origin, self._store.key.public_key()),
            "model": self._model,
            **asdict(self.settings),
            "version": _VERSION,
            "agents": len(self._members.by_name),
            "ratings": self._ratings,
            "rounds": self.rounds,
            "counted": self._trust.n_counted,
            "time": self.time,
        }

    def member(self, name: str) -> Member | None:
        """Return a registered agent; None if there is none of that name."""
        return self._members.by_name.get(name)

    def members(self) -> list[Member]:
        """Return the registered agents, the best provider first, and those without ratings last."""
        members = list(self._members.by_name.values())
        order = self._trust.rankings["ratee"]
        return sorted(members, key=lambda member: order.place(member.identity))

    @property
    def rates_raters(self) -> bool:
        """True if the model has trust in raters."""
        return self._trust.rates_raters

    def standings(self, member: Member) -> tuple[Standing, Standing]:
        """Return the trust in an agent as a provider and as a rater."""
        return self._trust.standing(member.identity, "ratee"), self._trust.standing(
            member.identity, "rater"
        )

    def explain(self, member: Member, role: Role) -> Explanation | None:
        """Return what makes the trust in an agent, see `JournalTrust.explain`."""
        return self._trust.explain(member.identity, role)

    def export(
        self, after: int = 0, limit: int = MOST_ROWS, *, counted: bool = False
    ) -> tuple[str, int | None]:
        """Return a page of ratings as CSV, which `roletrust rate` reads, and where the next page
        begins; None if there is none.

        Args:
            after: Number of the event after which the page begins.
            limit: Number of ratings, at most `MOST_ROWS`.
            counted: Whether to leave out those that do not count yet.
        """
        until = self._trust.counted if truth_value("counted", counted) else self._seq
        rows, following = self._page(after, limit, until, events.c.kind == "rating")
        lines = [
            f"{row.sender},{row.provider},{row.rating!r},{_decimal(row.time)},{row.token}\n"
            for row in rows
        ]
        return "".join(["" if after else "rater,ratee,rating,time,token\n", *lines]), following

    def journal(self, after: int = 0, limit: int = MOST_ROWS) -> tuple[str, int | None]:
        """Return a page of all events as CSV, of which anybody can compute the root hash, see
        `export` and `event_leaf`.
        """
        rows, following = self._page(after, limit, self._seq)
        lines = [f"{row.seq},{_decimal(row.time)},{row.token}\n" for row in rows]
        return "".join(["" if after else "seq,time,token\n", *lines]), following

    def _page(
        self, after: int, limit: int, until: int, *conditions: Any
    ) -> tuple[list[Any], int | None]:
        """Return some rows, and the number of the last one if there are more."""
        query = select(events).where(events.c.seq > after, events.c.seq <= until, *conditions)
        rows = self._store.rows(query.order_by(events.c.seq).limit(limit + 1))
        return rows[:limit], rows[limit - 1].seq if len(rows) > limit else None

    def checkpoint(self) -> str:
        """Return the signed size and root hash of the journal, see `sign_checkpoint`."""
        size = self._seq
        checkpoint = Checkpoint(self._store.origin, size, self._tree.root(size))
        return sign_checkpoint(checkpoint, self._store.key)

    def inclusion(self, seq: int, size: int) -> list[bytes]:
        """Return the proof that an event is among the first events, see `MerkleTree.inclusion`.

        Raises:
            ValueError: There are fewer events.
        """
        if not 1 <= seq <= size <= self._seq:
            raise ValueError(
                f"seq and size must be in [1, {self._seq}], seq at most size; got {seq} and {size}"
            )
        return self._tree.inclusion(seq - 1, size)

    def consistency(self, old: int, new: int) -> list[bytes]:
        """Return the proof that the journal begins as it was, see `MerkleTree.consistency`.

        Raises:
            ValueError: There are fewer events.
        """
        if new > self._seq:
            raise ValueError(f"new must be at most {self._seq}, got {new}")
        return self._tree.consistency(old, new)

    def close(self) -> None:
        """Release the store, after a snapshot."""
        if self._seq - self._kept >= _FEW and not self._in_doubt and not self._failure:
            self._keep()
        self._store.close()


def _decimal(time: int) -> str:
    """Return microseconds as seconds, with all digits."""
    return f"{time // MICROSECONDS}.{time % MICROSECONDS:06d}"
