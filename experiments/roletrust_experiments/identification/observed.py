"""What a recording holds of a team: who was there when, and which ratings counted."""

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
from roletrust_env.live.nodes.manage import replay
from roletrust_env.live.nodes.topics import IMAGES, RATINGS, owner
from roletrust_env.live.rating_validation import Keyring
from roletrust_env.live.rounds import Patience
from roletrust_env.live.trust_tracker import Team
from roletrust_env.live.wire import messages
from roletrust_env.live.wire.recording import Recorded
from roletrust_env.trust import make_trust_model

Floats = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Observed:
    """R rounds of a team.

    Attributes:
        team: who stands where.
        period: between rounds, nanoseconds.
        ratings: those that counted, by the round of the service, NaN elsewhere, (R, S, P).
        sent: those that were sent, in time or not, (R, S, P).
        serves: in which rounds a provider was seen, by its pictures or else by a rating, (R, P).
    """

    team: Team
    period: int
    ratings: Floats
    sent: Mask
    serves: Mask


class _Said(NamedTuple):
    """A message of a rater: when it came, the stamp that it is about, and whom it rates."""

    rater: str
    time: int
    stamp: int
    providers: tuple[str, ...]


def observe(recording: Iterable[Recorded], keyring: Keyring | None = None) -> Observed:
    """Read a recording, and have the manager say which ratings counted.

    Args:
        recording: in order of arrival.
        keyring: who may rate; None believes everybody who says to be a rater.

    Raises:
        ValueError: there are not two rounds of ratings in it.
    """
    heard = [_slim(one) for one in recording if owner(one.topic, RATINGS) or owner(one.topic, IMAGES)]
    claimed = [read for one in heard if (read := _said(one, keyring)) is not None]
    period = _period(claimed)
    said = [one for one in claimed if abs(one.stamp - one.time) <= Patience(period).tolerance]
    if not any(one.providers for one in said):
        raise ValueError("the recording holds no rating that came about when its service was")
    cameras = {name: [one.time for one in heard if owner(one.topic, IMAGES) == name] for name in _cameras(heard)}
    team = Team(
        _in_order(one.rater for one in said), _in_order([*cameras, *(name for one in said for name in one.providers)])
    )
    start = min(one.stamp for one in said)
    count = 1 + round((max(one.stamp for one in said) - start) / period)
    place = _Places(team, start, period, count)
    ratings = np.full((count, len(team.raters), len(team.providers)), np.nan)
    for stamp, rater, provider, value in _counted(heard, team, period, keyring):
        ratings[place.round(stamp), place.rater[rater], place.provider[provider]] = value
    sent = ~np.isnan(ratings)
    for one in said:
        for name in one.providers:
            sent[place.round(one.stamp), place.rater[one.rater], place.provider[name]] = True
    serves = sent.any(axis=1)
    for name, moments in cameras.items():
        serves[[place.round(moment) for moment in moments], place.provider[name]] = True
    return Observed(team, period, ratings, sent, serves)


class _Places:
    """Where rounds, raters and providers stand on the axes."""

    def __init__(self, team: Team, start: int, period: int, count: int) -> None:
        self.rater = {name: i for i, name in enumerate(team.raters)}
        self.provider = {name: j for j, name in enumerate(team.providers)}
        self._start, self._period, self._count = start, period, count

    def round(self, moment: int) -> int:
        """The round of a stamp, or of a moment close after it."""
        return min(max(0, round((moment - self._start) / self._period)), self._count - 1)


def _slim(one: Recorded) -> Recorded:
    """A message without its picture, of which only the moment is needed."""
    return one._replace(raw=b"") if one.kind == messages.IMAGE else one


def _said(one: Recorded, keyring: Keyring | None) -> _Said | None:
    """What a message says, and None if it says nothing, or is not of whom it says."""
    name = owner(one.topic, RATINGS)
    if name is None or one.kind != messages.RATINGS:
        return None
    try:
        read = messages.read_ratings(one.raw)
    except ValueError:
        return None
    known = keyring is None or (name in keyring and keyring.verifies(name, read.signed, read.signature))
    return _Said(name, one.time, read.stamp, tuple(read.providers)) if read.rater == name and known else None


def _cameras(heard: Iterable[Recorded]) -> set[str]:
    return {name for one in heard if (name := owner(one.topic, IMAGES)) is not None}


def _period(said: Iterable[_Said]) -> int:
    """Between rounds: the median of what lies between two messages of a rater."""
    stamps: dict[str, list[int]] = {}
    for one in said:
        stamps.setdefault(one.rater, []).append(one.stamp)
    gaps = [b - a for own in stamps.values() for a, b in pairwise(sorted(own)) if b > a]
    if not gaps:
        raise ValueError("the recording holds less than two rounds of ratings")
    return round(statistics.median(gaps))


def _counted(
    heard: Iterable[Recorded], team: Team, period: int, keyring: Keyring | None
) -> Iterable[tuple[int, str, str, float]]:
    """The ratings that reached the trust model, as (stamp, rater, provider, rating); any model will do."""
    with tempfile.TemporaryDirectory() as folder:
        journal = Path(folder) / "journal"
        manager = Manager(make_trust_model("constant"), journal, patience=Patience(period), team=team, keyring=keyring)
        for name in team.providers:
            manager.meet(name)
        for entry in replay(heard, manager, period):
            for rater, row in entry.rows.items():
                for provider, value in zip(entry.team.providers, row, strict=False):
                    if value is not None:
                        yield entry.stamp, rater, provider, value
        manager.close()


def _in_order(names: Iterable[str]) -> tuple[str, ...]:
    """Each name once; `sr_10` stands behind `sr_2`."""

    def key(name: str) -> tuple[str, int, str]:
        head, _, number = name.rpartition("_")
        return (head, int(number), "") if number.isdecimal() else (name, -1, name)

    return tuple(sorted(set(names), key=key))
