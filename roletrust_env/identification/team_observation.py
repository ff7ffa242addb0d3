"""Observation of a team in a recording: the presence of its agents, and the ratings that counted."""

import statistics
import tempfile
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from roletrust_env.live.manager import Manager
from roletrust_env.live.nodes.manager_node import replay_recording
from roletrust_env.live.rounds import RoundTiming
from roletrust_env.live.trust_tracker import Team
from roletrust_env.live.validation import Keyring, is_genuine
from roletrust_env.live.wire import messages
from roletrust_env.live.wire.recording import RecordedMessage
from roletrust_env.live.wire.topics import IMAGES, RATINGS, owner
from roletrust_env.trust import make_trust_model

Floats = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class TeamObservation:
    """R rounds of a team.

    Attributes:
        team: Agents of the team, in the order of the axes.
        period: Time between rounds, nanoseconds.
        ratings: Ratings that counted, by the round of the service, NaN elsewhere, (R, S, P).
        sent: Mask of the ratings that were sent, in time or late, (R, S, P).
        serves: Mask of the rounds in which a provider sent a picture or was rated, (R, P).
    """

    team: Team
    period: int
    ratings: Floats
    sent: Mask
    serves: Mask


class _RatingMessage(NamedTuple):
    """A message of a rater: its time of arrival, its stamp, and the rated providers."""

    rater: str
    time: int
    stamp: int
    providers: tuple[str, ...]


def observe_team(recording: Iterable[RecordedMessage], keyring: Keyring | None = None) -> TeamObservation:
    """Observe a team in a recording. The manager decides which ratings counted.

    Args:
        recording: Messages in order of arrival.
        keyring: Agents that may take part; None accepts every agent.

    Raises:
        ValueError: The recording has less than two rounds of ratings.
    """
    messages_of_team = [
        _without_picture(one)
        for one in recording
        if owner(one.topic, RATINGS) or (owner(one.topic, IMAGES) and _is_of_camera(one, keyring))
    ]
    authentic = [read for one in messages_of_team if (read := _read_ratings(one, keyring)) is not None]
    period = _period(authentic)
    timely = [one for one in authentic if abs(one.stamp - one.time) <= RoundTiming(period).tolerance]
    if not any(one.providers for one in timely):
        raise ValueError("the recording has no rating whose stamp is near the time of its arrival")
    cameras = {
        name: [one.time for one in messages_of_team if owner(one.topic, IMAGES) == name]
        for name in _cameras(messages_of_team)
    }
    team = Team(
        _sorted_names(one.rater for one in timely),
        _sorted_names([*cameras, *(name for one in timely for name in one.providers)]),
    )
    start = min(one.stamp for one in timely)
    count = 1 + round((max(one.stamp for one in timely) - start) / period)
    index = _AxisIndices(team, start, period, count)
    ratings = np.full((count, len(team.raters), len(team.providers)), np.nan)
    for stamp, rater, provider, value in _counted(messages_of_team, team, period, keyring):
        ratings[index.round(stamp), index.rater[rater], index.provider[provider]] = value
    sent = ~np.isnan(ratings)
    for one in timely:
        for name in one.providers:
            sent[index.round(one.stamp), index.rater[one.rater], index.provider[name]] = True
    serves = sent.any(axis=1)
    for name, moments in cameras.items():
        serves[[index.round(moment) for moment in moments], index.provider[name]] = True
    return TeamObservation(team, period, ratings, sent, serves)


class _AxisIndices:
    """Indices of rounds, raters and providers on the axes."""

    def __init__(self, team: Team, start: int, period: int, count: int) -> None:
        self.rater = {name: i for i, name in enumerate(team.raters)}
        self.provider = {name: j for j, name in enumerate(team.providers)}
        self._start, self._period, self._count = start, period, count

    def round(self, moment: int) -> int:
        """Return the round of a stamp, or of a moment shortly after it."""
        return min(max(0, round((moment - self._start) / self._period)), self._count - 1)


def _is_of_camera(one: RecordedMessage, keyring: Keyring | None) -> bool:
    """Return whether a message is from the camera of its topic."""
    try:
        return keyring is None or is_genuine(
            messages.read_picture(one.raw, owner(one.topic, IMAGES) or "").envelope, keyring
        )
    except ValueError:
        return False


def _without_picture(one: RecordedMessage) -> RecordedMessage:
    """Return a message without its picture, of which only the time is needed."""
    return one._replace(raw=b"") if one.kind == messages.IMAGE else one


def _read_ratings(one: RecordedMessage, keyring: Keyring | None) -> _RatingMessage | None:
    """Return the ratings of a message; None if there are none, or if it is not from the rater that it names."""
    name = owner(one.topic, RATINGS)
    if name is None or one.kind != messages.RATINGS:
        return None
    try:
        read = messages.read_ratings(one.raw)
    except ValueError:
        return None
    if read.envelope.sender != name or not is_genuine(read.envelope, keyring):
        return None
    return _RatingMessage(name, one.time, read.envelope.stamp, tuple(read.providers))


def _cameras(recording: Iterable[RecordedMessage]) -> set[str]:
    return {name for one in recording if (name := owner(one.topic, IMAGES)) is not None}


def _period(ratings: Iterable[_RatingMessage]) -> int:
    """Return the time between rounds: the median time between two messages of a rater, nanoseconds."""
    stamps: dict[str, list[int]] = {}
    for one in ratings:
        stamps.setdefault(one.rater, []).append(one.stamp)
    gaps = [b - a for own in stamps.values() for a, b in pairwise(sorted(own)) if b > a]
    if not gaps:
        raise ValueError("the recording has less than two rounds of ratings")
    return round(statistics.median(gaps))


def _counted(
    recording: Iterable[RecordedMessage], team: Team, period: int, keyring: Keyring | None
) -> Iterable[tuple[int, str, str, float]]:
    """Iterate over the ratings that reach the trust model, as (stamp, rater, provider, rating); any model will do."""
    with tempfile.TemporaryDirectory() as folder:
        journal = Path(folder) / "journal"
        manager = Manager(make_trust_model("constant"), journal, timing=RoundTiming(period), team=team, keyring=keyring)
        for entry in replay_recording(recording, manager, period):
            for rater, row in entry.ratings.items():
                for provider, value in zip(entry.team.providers, row, strict=False):
                    if value is not None:
                        yield entry.stamp, rater, provider, value
        manager.close()


def _sorted_names(names: Iterable[str]) -> tuple[str, ...]:
    """Return the distinct names in natural order: `sr_10` after `sr_2`."""

    def key(name: str) -> tuple[str, int, str]:
        head, _, number = name.rpartition("_")
        return (head, int(number), "") if number.isdecimal() else (name, -1, name)

    return tuple(sorted(set(names), key=key))
