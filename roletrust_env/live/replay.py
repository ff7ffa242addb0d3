"""Replays of a journal: the memory of a trust model after the rounds so far, checked against the published trust."""

import time
from collections import deque
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from roletrust_env.live.journal import JournalEntry, read_journal
from roletrust_env.live.state_growth import grows
from roletrust_env.live.trust_tracker import Team, TrustTracker
from roletrust_env.trust import TrustModel


def replay_journal(model: TrustModel[Any], path: Path) -> TrustTracker:
    """Replay a journal and check that each trust value in it is reproduced to the last bit.

    If the state of the model cannot grow, the rounds before the last newcomer are replayed with the whole team, and are
    not checked.

    Args:
        model: Trust model that wrote the journal.
        path: Path of a journal with at least one round.

    Raises:
        ValueError: A round gives other trust than the journal contains.
    """
    team = None
    if not grows(model):
        for entry in read_journal(path):
            team = entry.team
    tracker = replay_rounds(model, read_journal(path), team, path)
    if tracker is None:
        raise ValueError(f"{path} has no rounds")
    return tracker


def replay_rounds(
    model: TrustModel[Any],
    entries: Iterable[JournalEntry],
    team: Team | None,
    path: Path,
    tracker: TrustTracker | None = None,
) -> TrustTracker | None:
    """Replay some rounds and check their trust; return None if there are none and no tracker.

    Args:
        model: Trust model.
        entries: Rounds.
        team: Team at the end, for a model whose state cannot grow; None for one that can.
        path: Path of the journal, for the error.
        tracker: Trust before these rounds; None for the start.

    Raises:
        ValueError: A round gives other trust than the journal contains.
    """
    for entry in entries:
        if tracker is None:
            tracker = TrustTracker(model, team or entry.team)
        elif team is None and tracker.team != entry.team:
            tracker.grow(entry.team)
        tracker.update(entry.ratings)
        if tracker.team == entry.team and tracker.trust != entry.trust:
            raise ValueError(
                f"{path}: the journal has the trust {entry.trust} after round {entry.round}, but a replay with "
                f"{model!r} gives {tracker.trust}; another version wrote the journal, or it was changed"
            )
    return tracker


class GradualReplay:
    """A replay with a larger team, a little at a time, while further rounds close.

    Args:
        model: Trust model.
        team: Larger team.
        path: Path of the journal.

    Attributes:
        tracker: Trust of the larger team after the replayed rounds.
        rounds: Number of replayed rounds.
    """

    def __init__(self, model: TrustModel[Any], team: Team, path: Path) -> None:
        self.tracker, self.rounds = TrustTracker(model, team), 0
        self._stored, self._new = read_journal(path), deque[JournalEntry]()

    def add(self, entry: JournalEntry) -> None:
        """Note a round that has closed meanwhile."""
        self._new.append(entry)

    def advance(self, seconds: float) -> None:
        """Replay for a time."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            entry = next(self._stored, None) or (self._new.popleft() if self._new else None)
            if entry is None:
                return
            if entry.round == self.rounds:  # the file may have contained some of the new rounds
                self.tracker.update(entry.ratings)
                self.rounds += 1
