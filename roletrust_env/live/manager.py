"""The trust manager, without middleware: from messages to rounds, and from rounds to trust."""

from pathlib import Path
from typing import Any

from roletrust_env.live.journal import Entry, Journal, read_journal
from roletrust_env.live.rating_validation import Clock, Gate, Keyring, Ratings
from roletrust_env.live.rounds import Patience, Round, Rounds
from roletrust_env.live.trust_tracker import Standing, Team, Trust
from roletrust_env.trust import TrustModel


class Manager:
    """Turns the ratings that arrive into trust, round by round.

    A round is in the journal before anybody hears of it. A manager that begins with the journal of another goes on with
    the round after its last, with the same trust to the last bit.

    Args:
        model: any trust model.
        journal: path of its journal; it is made if need be.
        patience: how long a round is waited for.
        team: who is there from the start; newcomers come behind.
        keyring: who may rate; None lets everybody.

    Attributes:
        gate: what refuses wrong ratings, and counts them.
        rounds: what puts messages together, and counts those that are in no round.

    Raises:
        ValueError: the model is not sound; the journal is another's, or does not lead to the trust that it says.
        OSError: the journal cannot be written.
    """

    def __init__(
        self,
        model: TrustModel[Any],
        journal: Path,
        *,
        patience: Patience,
        team: Team | None = None,
        keyring: Keyring | None = None,
    ) -> None:
        self._model, self._team = model, team or Team()
        self._providers = set(self._team.providers)
        self._journal = Journal(journal, {"trust_model": repr(model), "period": patience.period})
        since: dict[str, int] = {}
        last: Entry | None = None
        for last in self._journal.entries():
            since |= dict.fromkeys(last.rows, last.stamp)
        if last is not None:
            self._team = last.team.joined(self._team.raters, self._team.providers)
            self._providers |= set(last.team.providers)
        self._standing = replayed(model, journal) if last is not None else None
        clock = Clock(tolerance=patience.tolerance, least=patience.apart)
        self.gate = Gate(clock, keyring, since)
        self.rounds: Rounds[dict[str, float]] = Rounds(
            patience, self._team.raters, None if last is None else last.stamp
        )

    @property
    def next_round(self) -> int:
        """The number of the round that comes next."""
        return self._journal.rounds

    @property
    def trust(self) -> Trust | None:
        """The trust of the team after the last round; None before the first."""
        return None if self._standing is None else self._standing.trust

    def meet(self, provider: str) -> None:
        """Know a provider from now on, so that it may be rated."""
        self._providers.add(provider)

    def hear(self, ratings: Ratings, now: int) -> list[Entry]:
        """Take a message, and publish the rounds that it completes: they are in the journal.

        Args:
            ratings: the message.
            now: the time of its arrival, nanoseconds, by the clock of the stamps.
        """
        admitted = self.gate.admit(ratings, self._providers, now)
        if not admitted:
            return []
        return [self._take(one, now) for one in self.rounds.add(ratings.rater, ratings.stamp, admitted, now)]

    def tick(self, now: int) -> list[Entry]:
        """Publish the rounds that were waited for long enough. To be asked often, some ten times a period."""
        return [self._take(one, now) for one in self.rounds.due(now)]

    def close(self) -> None:
        """Leave the journal to others."""
        self._journal.close()

    def _take(self, closed: Round[dict[str, float]], now: int) -> Entry:
        """Play a round, and write it down."""
        rated = [provider for row in closed.items.values() for provider in row]
        self._team = self._team.joined(closed.items, rated)
        if self._standing is None or self._standing.team != self._team:
            # A newcomer is as one who was there and never rated: a model alone knows what that means to its state.
            past = (entry.rows for entry in self._journal.entries())
            self._standing = Standing(self._model, self._team, past)
        rows = {name: [row.get(provider) for provider in self._team.providers] for name, row in closed.items.items()}
        self._standing.take(rows)
        entry = Entry(self.next_round, closed.stamp, now, self._team, rows, closed.missing, self._standing.trust)
        self._journal.append(entry)
        return entry


def replayed(model: TrustModel[Any], path: Path) -> Standing:
    """What a journal leads to: it must be what it says, to the last bit.

    Args:
        model: the trust model that it was written with.
        path: of a journal with at least one round.

    Raises:
        ValueError: the trust of a round is another.
    """
    entries = list(read_journal(path))
    team = entries[-1].team
    grown = next(place for place, entry in enumerate(entries) if entry.team == team)
    standing = Standing(model, team, (entry.rows for entry in entries[:grown]))
    for entry in entries[grown:]:
        standing.take(entry.rows)
        if standing.trust != entry.trust:
            raise ValueError(
                f"{path}: after round {entry.round} trust was {entry.trust}, and is {standing.trust} when the round is "
                f"played again by {model!r}; the journal is of another version"
            )
    return standing
