"""Trust from the journal of a manager: its rounds are played from there, and never from anywhere
else.
"""

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np
from sqlalchemy import Select, select

from roletrust_env.logs.evidence import Evidence, Role
from roletrust_env.logs.explain import Explanation, explain
from roletrust_env.logs.log import Log
from roletrust_env.logs.log_rounds import log_rounds
from roletrust_env.logs.names import NameIndex
from roletrust_env.logs.rounds import MOST, nanoseconds
from roletrust_env.logs.stream import TrustStream
from roletrust_env.logs.units import check_scale, unit_ratings
from roletrust_env.trust.edges import runs_on_edges
from roletrust_env.trust.grid_run import check_grid_memory
from roletrust_env.trust.model import TrustModel
from roletrust_env.trust.run import make_run
from roletrust_manager.http.requests import MICROSECONDS, Settings
from roletrust_manager.journal.sql import JournalStore, events

_ROLES: tuple[Role, ...] = ("ratee", "rater")
_FAR = MOST - 2  # rounds without a rating after which none can be taken


class Standing(NamedTuple):
    """Trust in an agent in a role, and what it rests on, see
    `roletrust_env.logs.evidence.Evidence`.

    Attributes:
        trust: Trust, in [0, 1].
        ratings: Number of ratings, received or given.
        agents: Number of agents of the other role in these.
        independent: Effective number of these agents.
        last: Time of the last rating, seconds; None without ratings.
        rank: Rank by trust, 1 for the best; None without ratings.
        of: Number of agents that are ranked.
    """

    trust: float
    ratings: int = 0
    agents: int = 0
    independent: float = 0.0
    last: float | None = None
    rank: int | None = None
    of: int = 0


class RoundEnd(NamedTuple):
    """The end of a round, and the trust that it has changed.

    Attributes:
        round: Number of rounds that have ended.
        time: Time of the end, seconds.
        provider: Trust by provider, where it is another than before.
        rater: Trust by rater.
    """

    round: int
    time: float
    provider: dict[str, float]
    rater: dict[str, float]


class StoredTrust(NamedTuple):
    """All that `JournalTrust` keeps.

    Attributes:
        rounds: Number of rounds that have ended.
        counted: Number of the last event that counts.
        n_counted: Number of ratings that count.
        start: Time of the first rating, nanoseconds; None without ratings.
        first: Time of the first rating that does not count yet.
        stream: File of the stream, see `TrustStream.save`; empty for a model that is played anew.
    """

    rounds: int
    counted: int
    n_counted: int
    start: int | None
    first: int | None
    stream: bytes = b""


class Ranking:
    """The agents of a role that have ratings, the best first.

    Args:
        found: Trust in them and its evidence; None if there are none.
    """

    def __init__(self, trust_evidence: Evidence | None = None) -> None:
        self.names, self.trust, self._columns = list[str](), dict[str, float](), list[Any]()
        if trust_evidence is not None:
            order = trust_evidence.ranked()
            self.names = list(trust_evidence.names.at(order))
            self._columns = [column[order] for column in trust_evidence[1:]]
            self.trust = dict(zip(self.names, self._columns[0].tolist(), strict=True))
        self._places = {name: place for place, name in enumerate(self.names)}

    def place(self, name: str) -> int:
        """Return the place of an agent, from 0; those without ratings are at the end."""
        return self._places.get(name, len(self.names))

    def standing(self, name: str, start: float) -> Standing:
        """Return the standing of an agent, which has the trust of a newcomer if it has no
        ratings.
        """
        of, place = len(self.names), self.place(name)
        if place == of:
            return Standing(start, of=of)
        *numbers, last = (column[place].item() for column in self._columns)
        return Standing._make([*numbers, last / 1e9, place + 1, of])


class JournalTrust:
    """Trust after the rounds of a journal that have ended.

    Ratings count when the time of their round is over. The rounds are those of `roletrust rate
    --every` on the exported journal, and so is the trust. A model that keeps numbers for all pairs
    has to know all agents from the start, so the whole journal is played for it after each round.

    Args:
        store: Journal, which need not be open yet.
        model: Trust model.
        settings: Length of a round, scale and roles of the manager.

    Attributes:
        rates_raters: Whether the model has trust in raters.
        counted: Number of the last event that counts.
        n_counted: Number of ratings that count.
        rankings: Agents with ratings by role. They are replaced as a whole, so that any thread may
            read them.

    Raises:
        ValueError: The best rating of the scale is not above the worst.
    """

    def __init__(self, store: JournalStore, model: TrustModel[Any], settings: Settings) -> None:
        check_scale(settings.scale)
        self._length = nanoseconds("every", settings.every)
        self._store, self._model, self._settings = store, model, settings
        self._of_stream: dict[str, Any] = {
            "every": settings.every,
            "scale": settings.scale,
            "same_agents": settings.same_agents,
            "keep_evidence": True,
        }
        self._stream = None
        if runs_on_edges(self._model):
            self._stream = TrustStream(self._model, **self._of_stream)
        self.rounds = self.counted = self.n_counted = 0
        self.rates_raters: bool = self._model.rates_raters
        newcomer = make_run(self._model, (1, 1), one_role=not settings.same_agents)
        self._newcomer = {
            "ratee": float(newcomer.provider_trust[0]),
            "rater": float(newcomer.rater_trust[0]),
        }
        self._start: int | None = None  # time of the first rating, nanoseconds
        self._first: int | None = None  # of the first that does not count yet
        self.rankings: dict[Role, Ranking] = {"ratee": Ranking(), "rater": Ranking()}

    def save(self) -> StoredTrust:
        """Return all that is kept."""
        stream = b""
        if self._stream is not None:
            with TemporaryDirectory() as folder:
                self._stream.save(Path(folder) / "stream")
                stream = (Path(folder) / "stream").read_bytes()
        at = (self.rounds, self.counted, self.n_counted)
        return StoredTrust(*at, self._start, self._first, stream)

    def load(self, stored: StoredTrust) -> bool:
        """Go on from what was kept, with the same model and settings; return whether that is
        possible.

        Raises:
            StoreError: The journal cannot be read.
        """
        if self._stream is not None:
            try:
                with TemporaryDirectory() as folder:
                    path = Path(folder) / "stream"
                    path.write_bytes(stored.stream)
                    self._stream = TrustStream.load(path, self._model, **self._of_stream)
            except (ValueError, OSError):
                return False
        self.rounds, self.counted, self.n_counted, self._start, self._first, _ = stored
        if self.rounds:
            self._rank()
        return True

    def fits(self, agents: int) -> bool:
        """Return whether the model has room for so many agents."""
        try:
            if self._stream is None:
                check_grid_memory(self._model, (agents, agents))
        except MemoryError:
            return False
        return True

    def has_round(self, time: float) -> bool:
        """Return whether a time has a round: there may have been too many rounds without a rating
        before it.
        """
        return self._start is None or time * 1e9 <= self._furthest

    def is_over(self, now: int) -> bool:
        """Return whether the running round is over at a time, microseconds. Any thread may ask."""
        first = self._first
        return first is not None and self._round(now * 1000) > self._round(first)

    def expect(self, time: float) -> None:
        """Take note that the journal has ratings from a time on."""
        first = round(time * MICROSECONDS) * 1000
        self._start = first if self._start is None else self._start
        self._first = first if self._first is None else self._first

    def advance(self, now: float) -> RoundEnd | None:
        """Count the ratings of rounds whose time is over, and return what has changed; None if none
        is over.

        Args:
            now: Time, seconds.

        Raises:
            StoreError: The journal cannot be read.
        """
        if self._first is None:
            return None
        if (running := self._round(round(now * 1e9))) <= self._round(self._first):
            return None
        before, number = self.rankings, self.n_counted
        first = None
        for rows in self._store.blocks(self._ratings()):
            times = np.array([row.time for row in rows]) * 1000
            ended = int(np.searchsorted(self._round(times), running))
            if ended:
                _, raters, providers, values, _ = zip(*rows[:ended], strict=True)
                if self._stream is not None:
                    self._stream.update(
                        raters, providers, values, times[:ended].view("datetime64[ns]")
                    )
                self.counted, number = rows[ended - 1].seq, number + ended
            if ended < len(rows):
                first = int(times[ended])
                break
        rounds, self._first = self._rank(), first
        self.rounds, self.n_counted = rounds, number  # last: other threads see that trust is there
        provider, rater = (
            {
                name: trust
                for name, trust in ranking.trust.items()
                if before[role].trust.get(name, self._newcomer[role]) != trust
            }
            for role, ranking in self.rankings.items()
        )
        return RoundEnd(self.rounds, now, provider, rater)

    def _rank(self) -> int:
        """Rank the agents by the ratings that count, and return the number of rounds."""
        stream = self._stream or TrustStream.of_log(
            self._model, self._log(), every=self._settings.every, keep_evidence=True
        )
        stream.finish()
        self.rankings = {role: Ranking(stream.evidence(role)) for role in _ROLES}
        return stream.rounds

    def standing(self, name: str, role: Role) -> Standing:
        """Return the standing of an agent in a role."""
        return self.rankings[role].standing(name, self._newcomer[role])

    def explain(self, name: str, role: Role) -> Explanation | None:
        """Return what makes the trust in an agent.

        None if it has no ratings that count, or as a rater if the model has no trust in raters. The
        journal is played several times, which takes as long. Any thread may call it.

        Raises:
            StoreError: The journal cannot be read.
        """
        if role == "rater" and not self.rates_raters:
            return None
        log = self._log()
        names, agents = (
            (log.ratee_names, log.ratees) if role == "ratee" else (log.rater_names, log.raters)
        )
        if name not in names or (agent := names.index(name)) not in agents:
            return None
        return explain(self._model, log, log_rounds(log, self._settings.every), role, agent)

    def _log(self) -> Log:
        """Return the ratings that count."""
        rows = self._store.rows(self._ratings(until=self.counted))
        raters = NameIndex("raters")
        ratees = raters if self._settings.same_agents else NameIndex("ratees")
        i, j = (
            index.places(index.check([row[side] for row in rows]))
            for side, index in enumerate((raters, ratees), 1)
        )
        values = unit_ratings(np.array([row.rating for row in rows]), self._settings.scale)
        times = np.array([row.time for row in rows]) * 1000
        names = raters.names
        return Log(i, j, values, times, names, names if raters is ratees else ratees.names)

    def _ratings(self, until: int | None = None) -> Select[Any]:
        """Return the query of the ratings that do not count yet, or of all up to an event."""
        columns = events.c.seq, events.c.sender, events.c.provider, events.c.rating, events.c.time
        query = select(*columns).where(events.c.kind == "rating").order_by(events.c.seq)
        return query.where(events.c.seq > self.counted if until is None else events.c.seq <= until)

    @property
    def _furthest(self) -> int:
        """The latest time that has a round, nanoseconds."""
        return (self._start or 0) + self._length * (self.rounds + _FAR)

    def _round(self, times: Any) -> Any:
        """Return the number of the round of a time, or of each of some, nanoseconds."""
        return (times - (self._start or 0)) // self._length
