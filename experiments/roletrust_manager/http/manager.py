"""The trust manager of agents that report ratings: who may rate, what is acknowledged, and whom to
trust.
"""

import logging
import time
from collections import Counter
from collections.abc import Callable, Sequence
from functools import partial
from importlib.metadata import version
from typing import Any

from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey
from sqlalchemy import select

from roletrust_env.evaluation.specs import parse_named
from roletrust_env.logs.evidence import Role
from roletrust_env.logs.explain import Explanation
from roletrust_env.parameters import truth_value
from roletrust_env.trust.model import TrustModel, registry
from roletrust_manager.admission.keys import KnownKeys
from roletrust_manager.admission.validation import (
    MessageValidator,
    NewcomerLimit,
    RefusalReason,
    StampLimits,
    is_genuine,
    rating_error,
)
from roletrust_manager.http.journal_trust import SECOND, JournalTrust, RoundEnd, Standing
from roletrust_manager.http.requests import (
    Member,
    Receipt,
    RefusedError,
    Request,
    Settings,
    Signed,
    refusal,
    registered_key,
)
from roletrust_manager.http.tokens import (
    Rating,
    Registration,
    has_work,
    key_as_text,
    key_of_text,
    read_token,
)
from roletrust_manager.journal.sql import Event, JournalStore, StoreError, events

_log = logging.getLogger(__name__)
_VERSION = version("roletrust-env")
_NANO = 1000  # nanoseconds of a microsecond
_AHEAD = 10 * SECOND  # microseconds of which the operator is told
MOST_ROWS = 10_000
"""Number of ratings in a page of the export."""

_LONGEST = 10**9  # seconds of a round or of a tolerance
_AGAIN = "~"  # between the name of an agent that has come back, and how often it has begun


class TrustManager:
    """Takes signed ratings, keeps them, and says whom to trust.

    What it has acknowledged is in the store. All else follows from the store by a replay at the
    start, so that another model, scale or length of a round is another start. It is used by one
    thread at a time, but for what only reads: `about`, `member`, `members`, `standings`, `explain`
    and `export`.

    Args:
        store: Journal, which is opened.
        model: Name of the trust model, such as `roletrust list models` has it.
        settings: Settings.
        clock: Function that returns the time, seconds since 1970. If it is set back, rounds go on
            as if it was not.
        monotonic: Function that returns the time by a clock that nobody sets, seconds.
        make: Function that makes the trust model of a name.

    Attributes:
        validator: Checks tokens.
        refusals: Number of refusals by agent and reason, see `MessageValidator`.
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
        for length in ("every", "tolerance"):
            if not 0 <= (value := getattr(settings, length)) <= _LONGEST:
                raise ValueError(f"{length} is {value:g} s; it must be from 0 to {_LONGEST:,} s")
        self._store, self._model, self.settings = store, model, settings
        self._clock, self._monotonic, self._read_at = clock, monotonic, monotonic()
        self._made = make(model)
        self._keys: dict[str, Ed25519PublicKey] = {}
        self._new: list[Event] = []  # of the requests that are being taken
        self._undo: list[Callable[[], object]] = []  # how to take them back
        self._is_ahead = False  # whether the journal is ahead of the clock
        self._in_doubt = False  # whether the store may have more than is known
        self._failure = ""  # of the model, for good
        self.refusals: Counter[tuple[str, RefusalReason]] = Counter()
        self.tell: Callable[[RoundEnd], object] = lambda end: None
        self._replay()

    def _replay(self) -> None:
        """Begin with what the store has; it is opened once all that can be checked without it has
        been.
        """
        settings = self.settings
        self._trust = JournalTrust(
            self._store,
            self._made,
            settings.every,
            settings.scale,
            same_agents=settings.same_agents,
        )
        self._store.open()
        limits = StampLimits(round(settings.tolerance * 1e9), 1)
        self._limit = NewcomerLimit(settings.newcomers, round(settings.every * 1e9))
        self._keys.clear()
        self._members: dict[str, Member] = {}
        self._begun: Counter[str] = Counter()  # how often each agent has registered
        self._sent: Counter[str] = Counter()  # ratings of each agent in the running round
        self._latest: dict[str, int] = {}  # an event of the last request of each agent
        self._ratings = self._time = last = 0
        stamps: dict[str, int] = {}
        for event in self._store.history():
            name = event.sender.partition(_AGAIN)[0]
            if not self._follows(event, name, stamps.get(name, 0)):
                raise self._store.damaged(
                    event.seq, f"{event.sender!r} cannot have sent this {event.kind} then"
                )
            stamps[name], self._latest[name] = event.stamp, event.seq
            self._time, last = event.time, event.seq
            if event.kind == "rating":
                self._trust.expect(event.time / SECOND)
                self._ratings += 1
        self.validator = MessageValidator(limits, KnownKeys(self._keys), stamps)
        self.validator.refusals = self.refusals
        self._seq = last  # now that nothing is missing
        self.advance()
        running = select(events.c.sender).where(
            events.c.kind == "rating", events.c.seq > self._trust.counted
        )
        self._sent.update(sender.partition(_AGAIN)[0] for (sender,) in self._store.rows(running))

    def _follows(self, event: Event, name: str, stamp: int) -> bool:
        """Take an event into account; return whether its agent can have sent it after its last one
        with a stamp.
        """
        member = self._members.get(name)
        if event.stamp <= stamp or (event.kind == "register") != (member is None):
            return False
        if event.kind == "register":
            try:
                claims, _ = read_token(event.token, Registration)
            except ValueError:
                return False
            key = key_of_text(claims.key)
            if (claims.iss, claims.stamp, self._keys.setdefault(name, key)) != (
                name,
                event.stamp,
                key,
            ):
                return False
            member = self._join(claims, Receipt(event.seq, event.time / SECOND))
            self._limit.admits(event.time * _NANO)
        elif event.kind == "leave":
            del self._members[name]
        else:
            rated = self._members.get((event.provider or "").partition(_AGAIN)[0])
            if (
                rated is None
                or rated == member
                or rated.identity != event.provider
                or event.rating is None
            ):
                return False
        return member is not None and member.identity == event.sender

    # --- requests
    # -----------------------------------------------------------------------------------

    def take(self, requests: Sequence[Request]) -> list[list[Receipt] | RefusedError | StoreError]:
        """Return the answer to each request. Those that are acknowledged are in the store, by one
        transaction.

        A request counts as a whole. The last request of an agent may be sent again, and is
        acknowledged again. Refusals are counted, and change nothing else.
        """
        try:
            if self._in_doubt and self._store.last() != self._seq:
                self._replay()
            self._in_doubt = False
            self.advance()
        except StoreError as error:
            return [error] * len(requests)
        self._take_back(0)  # what is left of requests at which something has broken
        answers = [self._answer(request) for request in requests]
        if self._new:
            try:
                self._store.append(self._new)
            except StoreError as error:
                self._take_back(0)
                self._in_doubt = True
                return [
                    error if isinstance(answer, list) and answer[-1].seq > self._seq else answer
                    for answer in answers
                ]
            self._seq = self._new[-1].seq
            if times := [event.time for event in self._new if event.rating is not None]:
                self._ratings += len(times)
                self._trust.expect(times[0] / SECOND)
            self._new.clear()
            self._undo.clear()
        return answers

    def advance(self) -> RoundEnd | None:
        """End the round whose time is over, if there is one, and return what has changed, by name.

        Raises:
            StoreError: The store cannot be read, or the model fails, now or before. Trust stays as
                it is then.
        """
        before, self._read_at = self._read_at, self._monotonic()
        now = round(self._clock() * SECOND)
        self._time = max(now, self._time + round((self._read_at - before) * SECOND))
        is_ahead = self._time - now > _AHEAD
        if is_ahead and not self._is_ahead:
            _log.warning("the clock is %.0f s behind the journal", (self._time - now) / SECOND)
        self._is_ahead = is_ahead
        if self._failure:
            raise StoreError(self._failure)
        try:
            end = self._trust.advance(self._time / SECOND)
        except (ValueError, MemoryError) as error:
            self._failure = (
                f"{self._model} cannot go on, so start with another model or scale: {error}"
            )
            raise StoreError(self._failure) from None
        if end is None:
            return None
        self._sent.clear()
        here = {member.identity: member.name for member in self._members.values()}
        provider, rater = (
            {here[identity]: trust for identity, trust in side.items() if identity in here}
            for side in (end.provider, end.rater)
        )
        end = end._replace(provider=provider, rater=rater)
        self.tell(end)
        return end

    def _answer(self, request: Request) -> list[Receipt] | RefusedError | StoreError:
        """Return the receipts of a request, whose events are not in the store yet, or why there are
        none.
        """
        mark, self._time = len(self._undo), self._time + 1
        try:
            signed = [self._read(request, at) for at in range(len(request.tokens))]
            return self._acknowledged(signed) or self._accept(request, signed)
        except RefusedError as refused:
            self._take_back(mark)
            self.validator.refuse(refused.sender, refused.reason)
            return refused
        except StoreError as error:
            self._take_back(mark)
            return error

    def _read(self, request: Request, at: int) -> Signed:
        """Return a token of a request with its claims.

        Raises:
            RefusedError: It is no such token, or is for another manager or about another agent.
        """
        try:
            signed = Signed(request.tokens[at], *read_token(request.tokens[at], request.kind))
        except ValueError as error:
            raise RefusedError(RefusalReason.GARBAGE, str(error), at) from None
        claims = signed.claims
        if claims.aud != self._store.name:
            raise refusal(RefusalReason.ELSEWHERE, claims, at, f"this is {self._store.name}")
        if request.name not in (None, claims.iss):
            raise refusal(
                RefusalReason.ELSEWHERE, claims, at, f"the request is about {request.name}"
            )
        return signed

    def _acknowledged(self, request: Sequence[Signed]) -> list[Receipt]:
        """Return the receipts of a request that is the last one of its sender, sent again; none if
        it is not.
        """
        claims = request[0].claims
        if claims.stamp > self.validator.last_stamp(claims.iss):
            return []
        near = self._latest[claims.iss]
        around = events.c.seq.between(near - len(request), near + len(request))
        rows = [*self._store.rows(select(events).where(around).order_by(events.c.seq)), *self._new]
        (when,) = (row.time for row in rows if row.seq == near)
        same = [row for row in rows if row.time == when]
        if [row.token for row in same] != [signed.token for signed in request]:
            return []
        return [Receipt(row.seq, row.time / SECOND) for row in same]

    def _accept(self, request: Request, signed: Sequence[Signed]) -> list[Receipt]:
        """Return the receipts of a request after a check of each token.

        Raises:
            RefusedError: A token is refused.
            StoreError: There have been too many rounds without a rating.
        """
        first, rated = len(self._new), set[tuple[str, str]]()
        for at, token in enumerate(signed):
            claims = token.claims
            if isinstance(claims, Registration):
                if claims.iss in self._members and self._is_registered(token):
                    return [self._members[claims.iss].receipt]
                self._register(token)
            elif claims.iss not in self._members:
                raise refusal(RefusalReason.UNKNOWN, claims, at, "register it first")
            elif isinstance(claims, Rating):
                self._rate(token, at, rated)
            else:
                self._verify(token, at)
                self._append(token)
                member = self._members.pop(claims.iss)
                self._undo.append(partial(self._members.__setitem__, claims.iss, member))
        for token in signed:
            before = self._latest.get(token.claims.iss)
            self._undo.append(partial(_put, self._latest, token.claims.iss, before))
            self._latest[token.claims.iss] = self._new[-1].seq
        return [Receipt(event.seq, event.time / SECOND) for event in self._new[first:]]

    def _rate(self, signed: Signed, at: int, rated: set[tuple[str, str]]) -> None:
        """Take a rating, if it is valid.

        Args:
            signed: Token.
            at: Its place in the request.
            rated: Pairs of rater and provider that the request has before it.

        Raises:
            RefusedError: It is not.
            StoreError: There have been too many rounds without a rating.
        """
        claims = signed.claims
        rater, provider = claims.iss, claims.sub
        worst, best = self.settings.scale
        before = {provider} if (rater, provider) in rated else ()
        if reason := rating_error(
            rater, provider, claims.rating, self._members, before, self.settings.scale
        ):
            raise refusal(
                reason,
                claims,
                at,
                f"it is {claims.rating} of {provider}, from {worst:g} to {best:g}",
            )
        if self._sent[rater] >= self.settings.quota:
            raise refusal(
                RefusalReason.FLOOD,
                claims,
                at,
                f"{self.settings.quota:,} ratings in a round are allowed",
            )
        self._verify(signed, at)
        if not self._trust.has_round(self._time / SECOND):
            raise StoreError(
                "there have been too many rounds without a rating; start with a longer --every"
            )
        rated.add((rater, provider))
        self._sent[rater] += 1
        self._undo.append(partial(self._sent.subtract, {rater: 1}))
        self._append(signed, self._members[provider].identity, claims.rating)

    def _is_registered(self, signed: Signed) -> bool:
        """Return whether a registration is by the holder of the key that the agent has registered
        with.
        """
        claims = signed.claims
        return claims.key == self._members[claims.iss].key and is_genuine(
            signed.envelope, KnownKeys(self._keys)
        )

    def _register(self, signed: Signed) -> None:
        """Let an agent join, if its registration is valid.

        Raises:
            RefusedError: It is not.
        """
        claims = signed.claims
        name = claims.iss
        if not has_work(claims, self.settings.work):
            raise refusal(
                RefusalReason.NO_WORK, claims, 0, f"it costs {self.settings.work} bits here"
            )
        if name not in self._keys:
            self._keys[name] = registered_key(claims)
            self._undo.append(partial(self._keys.pop, name))
        elif name in self._members or claims.key != key_as_text(self._keys[name]):
            raise refusal(RefusalReason.TAKEN, claims, 0, "choose another one")
        self._verify(signed, 0)
        if not self._limit.admits(self._time * _NANO):
            raise refusal(
                RefusalReason.CROWDED,
                claims,
                0,
                f"{self.settings.newcomers:,} in a round are allowed",
            )
        if not self._trust.fits(sum(self._begun.values()) + 1):
            raise refusal(
                RefusalReason.CROWDED, claims, 0, f"{self._model} has no room for more agents"
            )
        self._undo.append(partial(self._unjoin, name))
        self._append(
            signed,
            None,
            None,
            self._join(claims, Receipt(self._next, self._time / SECOND)).identity,
        )

    def _verify(self, signed: Signed, at: int) -> None:
        """Check when and by whom a token was signed, and remember that.

        Raises:
            RefusedError: It is not valid.
        """
        envelope = signed.envelope
        if reason := self.validator.error(envelope, round(self._clock() * 1e9)):
            raise refusal(reason, signed.claims, at, f"the clock here says {self._clock():.3f}")
        before = self.validator.remember(envelope.sender, envelope.stamp)
        self._undo.append(partial(self.validator.remember, envelope.sender, before))

    def _append(
        self,
        signed: Signed,
        provider: str | None = None,
        rating: float | None = None,
        own: str = "",
    ) -> None:
        """Add an event to those that will be written."""
        claims = signed.claims
        sender = own or self._members[claims.iss].identity
        self._undo.append(self._new.pop)
        self._new.append(
            Event(
                self._next,
                claims.kind,
                self._time,
                sender,
                claims.stamp,
                provider,
                rating,
                signed.token,
            )
        )

    @property
    def _next(self) -> int:
        """Number of the next event."""
        return self._seq + len(self._new) + 1

    def _join(self, claims: Registration, receipt: Receipt) -> Member:
        name = claims.iss
        self._begun[name] += 1
        identity = name if self._begun[name] == 1 else f"{name}{_AGAIN}{self._begun[name]}"
        self._members[name] = Member(name, identity, claims.key, receipt)
        return self._members[name]

    def _unjoin(self, name: str) -> None:
        self._begun[name] -= 1
        del self._members[name]

    def _take_back(self, mark: int) -> None:
        """Undo what was done in memory, down to a mark."""
        while len(self._undo) > mark:
            self._undo.pop()()

    # --- what only reads
    # ----------------------------------------------------------------------------

    @property
    def name(self) -> str:
        """Name of the manager."""
        return self._store.name

    @property
    def rounds(self) -> int:
        """Number of rounds that have ended."""
        return self._trust.rounds

    @property
    def time(self) -> float:
        """Time of the last request or end of a round, seconds."""
        return self._time / SECOND

    def about(self) -> dict[str, Any]:
        """Return what this manager is, and its state, by the fields of `About`."""
        return {
            "name": self.name,
            "model": self._model,
            **self.settings._asdict(),
            "version": _VERSION,
            "agents": len(self._members),
            "ratings": self._ratings,
            "rounds": self.rounds,
            "counted": self._trust.n_counted,
            "time": self.time,
        }

    def member(self, name: str) -> Member | None:
        """Return a registered agent; None if there is none of that name."""
        return self._members.get(name)

    def members(self) -> list[Member]:
        """Return the registered agents, the best provider first, and those without ratings last."""
        members = list(self._members.values())
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
        query = select(events).where(events.c.kind == "rating", events.c.seq > after)
        query = query.where(events.c.seq <= until).order_by(events.c.seq).limit(limit + 1)
        rows = self._store.rows(query)
        lines = [
            f"{row.sender},{row.provider},{row.rating!r},{_decimal(row.time)},{row.token}\n"
            for row in rows[:limit]
        ]
        head = "" if after else "rater,ratee,rating,time,token\n"
        return head + "".join(lines), rows[limit - 1].seq if len(rows) > limit else None

    def close(self) -> None:
        """Release the store."""
        self._store.close()


def _put(table: dict[str, int], name: str, value: int | None) -> None:
    """Set a value of a table back; None for none."""
    if value is None:
        del table[name]
    else:
        table[name] = value


def _decimal(time: int) -> str:
    """Return microseconds as seconds, with all digits."""
    return f"{time // SECOND}.{time % SECOND:06d}"
