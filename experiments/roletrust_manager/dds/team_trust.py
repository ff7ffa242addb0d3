"""The trust of a team that grows, on disk: a journal of all rounds, and snapshots that make a
restart quick.
"""

from collections.abc import Callable, Iterable
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

from roletrust_env.trust import TrustModel
from roletrust_manager.dds.rounds import MatchedRound
from roletrust_manager.dds.team_run import TeamRun, grows
from roletrust_manager.journal.lines import (
    Journal,
    JournalEntry,
    JournalPosition,
    Snapshot,
    read_journal,
    read_snapshot,
    write_snapshot,
)
from roletrust_manager.team import Team, Trust

_AT_ONCE = 100  # rounds that are replayed in no time: a snapshot is written after so many


class CountedRatings(NamedTuple):
    """The ratings of a rater that count in a round.

    Attributes:
        ratings: Ratings by provider.
        signed: Message with these ratings and its signature, as CDR; empty if the team has no keys.
    """

    ratings: dict[str, float]
    signed: bytes


class TeamTrust:
    """Closes rounds: updates trust, and writes the round to the journal before it is published.

    A newcomer counts as present all along, without ratings given or received. The state of most
    models grows by the newcomer's start values, with the same trust as that of a replay. Other
    models, see `grows`, take no newcomers while they run: the settings of the next start name them.

    Args:
        model: Trust model.
        path: Path of the journal; the file is created if it does not exist.
        period: Time between rounds, nanoseconds.
        settings: Agents of the team from the start; newcomers are appended.
        report: Function that shows a line to the user, before a long replay.

    Attributes:
        grows: Whether newcomers may join.
        team: Agents of the team.
        last_stamps: Last accepted stamp of each rater, nanoseconds; after a replay, that of its
            last round.
        last_stamp: Stamp of the last round in the journal, nanoseconds; None if it was empty.

    Raises:
        ValueError: The model is not sound, the journal belongs to another manager, or replaying it
            gives other trust than it contains.
        OSError: The journal cannot be written.
    """

    def __init__(
        self,
        model: TrustModel[Any],
        path: Path,
        period: int,
        settings: Team,
        report: Callable[[str], object] = lambda line: None,
    ) -> None:
        self._model, self._path, self.grows = model, path, grows(model)
        snapshot, fault = None, ""
        try:
            snapshot = read_snapshot(path)
        except (OSError, ValueError) as error:
            fault = str(error)
        about = {"trust_model": repr(model), "period": period}
        self._journal = Journal(path, about, None if snapshot is None else snapshot.position)
        self.last_stamps: dict[str, int] = {}
        self.last_stamp: int | None = None
        self.team = self._journal.position.team
        if not self.grows:
            self.team = self.team.with_newcomers(settings.raters, settings.providers)
        self._run: TeamRun | None = None
        after: JournalPosition | None = None
        if snapshot is not None:
            try:
                after = self._load(snapshot)
            except ValueError as error:
                fault = str(error)
        replayed = self.next_round - (0 if after is None else after.round)
        if replayed and (fault or replayed > _AT_ONCE):
            why = f"its snapshot cannot be used: {fault}" if fault else "it has no snapshot"
            report(f"{path}: {replayed} rounds are replayed, since {why}")
        entries = self._noted(read_journal(path, after))
        self._run = replay_rounds(
            model, entries, None if self.grows else self.team, path, self._run
        )
        if replayed > _AT_ONCE:
            self._write_snapshot()
        self.team = self.team.with_newcomers(settings.raters, settings.providers)

    def _load(self, snapshot: Snapshot) -> JournalPosition:
        """Begin with the memory of a snapshot, and return its place in the journal.

        Raises:
            ValueError: The snapshot is of another journal, team or model.
        """
        if self._journal.after is None:
            raise ValueError("it is of another journal")
        if not self.grows and snapshot.position.team != self.team:
            raise ValueError("agents have joined since")
        run = TeamRun(self._model, snapshot.position.team)
        run.load(snapshot.run)
        self._run, self.last_stamps, self.last_stamp = (
            run,
            dict(snapshot.last_stamps),
            snapshot.stamp,
        )
        return snapshot.position

    def _noted(self, entries: Iterable[JournalEntry]) -> Iterable[JournalEntry]:
        """Iterate over rounds and note their stamps."""
        for entry in entries:
            self.last_stamps |= dict.fromkeys(entry.ratings, entry.stamp)
            self.last_stamp = entry.stamp
            yield entry

    @property
    def next_round(self) -> int:
        """Number of the next round."""
        return self._journal.rounds

    @property
    def values(self) -> Trust | None:
        """Trust of the team after the last round; None before the first."""
        return None if self._run is None else self._run.trust

    def close_round(
        self, closed: MatchedRound[CountedRatings], now: int, last_stamps: dict[str, int]
    ) -> JournalEntry:
        """Update trust with a round, and write it to the journal.

        Args:
            closed: Round with the ratings of each rater.
            now: Time, nanoseconds.
            last_stamps: Last accepted stamp of each rater, nanoseconds.
        """
        rated = [provider for item in closed.items.values() for provider in item.ratings]
        self.team = self.team.with_newcomers(closed.items, rated)
        if self._run is None:
            self._run = TeamRun(self._model, self.team)
        elif self._run.team != self.team:
            self._run.grow(self.team)
        ratings = {
            name: [item.ratings.get(provider) for provider in self.team.providers]
            for name, item in closed.items.items()
        }
        signed = {name: item.signed for name, item in closed.items.items() if item.signed}
        self._run.play_named(ratings)
        trust = self._run.trust
        entry = JournalEntry(
            self.next_round, closed.stamp, now, self.team, ratings, closed.missing, trust, signed
        )
        self._journal.append(entry)
        self.last_stamps, self.last_stamp = last_stamps, closed.stamp
        if self.next_round % _AT_ONCE == 0:
            self._write_snapshot()
        return entry

    def close(self) -> None:
        """Release the journal."""
        self._journal.close()

    def _write_snapshot(self) -> None:
        """Write a snapshot; without it, a restart takes longer, and nothing else is lost."""
        if self._run is not None and self.last_stamp is not None:
            with suppress(OSError, TypeError, ValueError):
                position = self._journal.position
                write_snapshot(
                    self._path,
                    Snapshot(position, self.last_stamp, self.last_stamps, self._run.save()),
                )


def replay_rounds(
    model: TrustModel[Any],
    entries: Iterable[JournalEntry],
    team: Team | None,
    path: Path,
    run: TeamRun | None = None,
) -> TeamRun | None:
    """Replay some rounds and check their trust; return None if there are none and no run.

    Args:
        model: Trust model.
        entries: Rounds.
        team: Team at the end, for a model whose state cannot grow; None for one that can.
        path: Path of the journal, for the error.
        run: Trust before these rounds; None for the start.

    Raises:
        ValueError: A round gives other trust than the journal contains.
    """
    for entry in entries:
        if run is None:
            run = TeamRun(model, team or entry.team)
        elif team is None and run.team != entry.team:
            run.grow(entry.team)
        run.play_named(entry.ratings)
        if run.team == entry.team and run.trust != entry.trust:
            raise ValueError(
                f"{path}: the journal has the trust {entry.trust} after round {entry.round}, but a "
                "replay with "
                f"{model!r} gives {run.trust}; another version wrote the journal, or it was changed"
            )
    return run
