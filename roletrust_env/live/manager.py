"""The trust manager without middleware: from messages to rounds, and from rounds to trust."""

from collections.abc import Container
from pathlib import Path
from typing import Any

from roletrust_env.live.admission import Admission
from roletrust_env.live.journal import Journal, JournalEntry, read_journal
from roletrust_env.live.message_validation import MANAGER, Keyring, KeysOfOthers, StampLimits
from roletrust_env.live.rating_validation import Ratings, RatingValidator
from roletrust_env.live.rounds import Round, RoundAssembler, RoundTiming
from roletrust_env.live.trust_tracker import Team, Trust, TrustTracker
from roletrust_env.trust import TrustModel


class Manager:
    """Turns incoming ratings into trust, round by round.

    A round is in the journal before it is published. A manager that opens an existing journal continues after its last
    round, with the same trust to the last bit.

    Args:
        model: Trust model.
        journal: Path of the journal; the file is created if it does not exist.
        timing: How long to wait for a round.
        team: Agents that are expected from the start; newcomers are appended.
        keyring: Keys of the agents; None accepts every rater. The settings' raters may not serve, and its providers may
            not rate, unless they have both roles.

    Attributes:
        validator: Refuses invalid ratings and counts them.
        rounds: Assembles messages into rounds and counts those that fit into none.
        known_raters: Raters that have a key or, without keys, a place in the team.

    Raises:
        ValueError: The model is not sound, the journal belongs to another manager, or replaying it gives other trust
            than it contains.
        OSError: The journal cannot be written.
    """

    def __init__(
        self,
        model: TrustModel[Any],
        journal: Path,
        *,
        timing: RoundTiming,
        team: Team | None = None,
        keyring: Keyring | None = None,
    ) -> None:
        self._model, self._team = model, team or Team()
        settings = self._team
        self._journal = Journal(journal, {"trust_model": repr(model), "period": timing.period})
        last_stamps: dict[str, int] = {}
        last: JournalEntry | None = None
        for last in self._journal.entries():
            last_stamps |= dict.fromkeys(last.ratings, last.stamp)
        if last is not None:
            self._team = last.team.with_newcomers(self._team.raters, self._team.providers)
        self._tracker = replay_journal(model, journal) if last is not None else None
        rater_keys, provider_keys = keys_by_role(keyring, settings)
        limits, period = StampLimits(tolerance=timing.tolerance, min_gap=timing.max_spread), timing.period
        strange = [name for name in self._team.raters if name not in settings.raters]
        self._raters = Admission(self._team.raters, period, rater_keys, len(strange))
        strange = [name for name in self._team.providers if name not in settings.providers]
        self._providers = Admission(self._team.providers, period, provider_keys, len(strange))
        self.validator = RatingValidator(limits, rater_keys, last_stamps, self._raters)
        self.known_raters: Container[str] = self._raters if rater_keys is None else rater_keys
        self.rounds: RoundAssembler[dict[str, float]] = RoundAssembler(
            timing, self._team.raters, None if last is None else last.stamp
        )

    @property
    def next_round(self) -> int:
        """Number of the next round."""
        return self._journal.rounds

    @property
    def trust(self) -> Trust | None:
        """Trust of the team after the last round; None before the first."""
        return None if self._tracker is None else self._tracker.trust

    def add_provider(self, provider: str, now: int) -> None:
        """Accept ratings of a provider from now on, if it may join.

        Args:
            provider: Name of the provider.
            now: Time, nanoseconds.
        """
        self._providers.admits(provider, now)

    def receive(self, ratings: Ratings, now: int) -> list[JournalEntry]:
        """Take a message and return the rounds that it closes. They are in the journal by then.

        Args:
            ratings: Message.
            now: Time of arrival, nanoseconds, by the clock of the stamps.
        """
        accepted = self.validator.accept(ratings, self._providers, now)
        if not accepted:
            return []
        return [self._close(one, now) for one in self.rounds.add(ratings.rater, ratings.stamp, accepted, now)]

    def tick(self, now: int) -> list[JournalEntry]:
        """Return the rounds whose deadline has passed. Call it often, about ten times a period."""
        return [self._close(one, now) for one in self.rounds.close_due(now)]

    def close(self) -> None:
        """Release the journal."""
        self._journal.close()

    def _close(self, closed: Round[dict[str, float]], now: int) -> JournalEntry:
        """Update trust with a closed round and write it to the journal."""
        rated = [provider for row in closed.items.values() for provider in row]
        self._team = self._team.with_newcomers(closed.items, rated)
        if self._tracker is None or self._tracker.team != self._team:
            # A newcomer counts as present all along, without ratings: only the model knows what that does to its state.
            past = (entry.ratings for entry in self._journal.entries())
            self._tracker = TrustTracker(self._model, self._team, past)
        ratings = {name: [row.get(provider) for provider in self._team.providers] for name, row in closed.items.items()}
        self._tracker.update(ratings)
        trust = self._tracker.trust
        entry = JournalEntry(self.next_round, closed.stamp, now, self._team, ratings, closed.missing, trust)
        self._journal.append(entry)
        return entry


def keys_by_role(keyring: Keyring | None, team: Team) -> tuple[Keyring | None, Keyring | None]:
    """Return the keys of those that may rate and of those that may serve; None where there are no keys."""
    if keyring is None:
        return None, None
    raters, providers = set(team.raters), set(team.providers)
    return (
        KeysOfOthers(keyring, {MANAGER} | (providers - raters)),
        KeysOfOthers(keyring, {MANAGER} | (raters - providers)),
    )


def replay_journal(model: TrustModel[Any], path: Path) -> TrustTracker:
    """Replay a journal and check that each trust value in it is reproduced to the last bit.

    Args:
        model: Trust model that wrote the journal.
        path: Path of a journal with at least one round.

    Raises:
        ValueError: A round gives other trust than the journal contains.
    """
    entries = list(read_journal(path))
    team = entries[-1].team
    grown = next(place for place, entry in enumerate(entries) if entry.team == team)
    tracker = TrustTracker(model, team, (entry.ratings for entry in entries[:grown]))
    for entry in entries[grown:]:
        tracker.update(entry.ratings)
        if tracker.trust != entry.trust:
            raise ValueError(
                f"{path}: the journal has the trust {entry.trust} after round {entry.round}, but a replay with "
                f"{model!r} gives {tracker.trust}; another version wrote the journal, or it was changed"
            )
    return tracker
