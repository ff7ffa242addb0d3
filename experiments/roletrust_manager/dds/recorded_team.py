"""The scenario of a recorded team, as far as a scenario can express it: agents, presence, losses,
disturbances.
"""

import math
import statistics
import tempfile
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from roletrust_env.metrics.confidence import Interval, over_games
from roletrust_env.trust import make_trust_model
from roletrust_env.world.scenario import Scenario, read_scenario
from roletrust_manager.admission.validation import Envelope, Keyring, is_genuine
from roletrust_manager.dds.manager import Manager
from roletrust_manager.dds.nodes.manager_node import replay_recording
from roletrust_manager.dds.perception_estimates import (
    Floats,
    Mask,
    PerceptionEstimates,
    estimate_perception,
)
from roletrust_manager.dds.rounds import RoundTiming
from roletrust_manager.dds.wire import messages
from roletrust_manager.dds.wire.recording import RecordedMessage
from roletrust_manager.dds.wire.topics import IMAGES, RATINGS, owner
from roletrust_manager.team import Team

_MIN_SILENCE = 3  # rounds; silences up to this length never count as an absence
_UNLIKELY = 1e-3  # a silence that is less likely by loss alone counts as an absence
_MIN_DROP = 0.1  # smallest relative drop of quality that counts as a disturbance
_MIN_DROP_DEVIATIONS = 4.0  # the same in standard deviations

Spans = list[tuple[int, int] | None]


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


class _Ratings(NamedTuple):
    """A message of a rater: its time of arrival, its stamp, and the rated providers."""

    rater: str
    time: int
    stamp: int
    providers: tuple[str, ...]


def observe_team(
    recording: Iterable[RecordedMessage],
    keyring: Keyring | None = None,
    again: Callable[[Sequence[RecordedMessage]], Iterable[RecordedMessage]] = iter,
) -> TeamObservation:
    """Observe a team in a recording. The manager decides which ratings counted.

    Args:
        recording: Messages in order of arrival.
        keyring: Agents that may take part; None accepts every agent.
        again: Function that iterates over the messages of the team for the manager, and may show
            how far it is.

    Raises:
        ValueError: The recording has less than two rounds of ratings.
    """
    of_team: list[RecordedMessage] = []
    authentic: list[_Ratings] = []
    pictures: dict[str, list[int]] = {}
    for message in recording:
        if camera := owner(message.topic, IMAGES):
            if keyring is None or _origin(message, camera, keyring) is not None:
                pictures.setdefault(camera, []).append(message.time)
                of_team.append(
                    message._replace(raw=b"") if message.kind == messages.IMAGE else message
                )
        elif rater := owner(message.topic, RATINGS):
            of_team.append(message)
            if (
                message.kind == messages.RATINGS
                and (origin := _origin(message, rater, keyring)) is not None
            ):
                providers = tuple(messages.read_ratings_message(message.raw).providers)
                authentic.append(_Ratings(rater, message.time, origin.stamp, providers))
    period = _period(authentic)
    timely = [
        rating_message
        for rating_message in authentic
        if abs(rating_message.stamp - rating_message.time) <= RoundTiming(period).tolerance
    ]
    if not any(rating_message.providers for rating_message in timely):
        raise ValueError("the recording has no rating whose stamp is near the time of its arrival")
    team = Team(
        _sorted_names(rating_message.rater for rating_message in timely),
        _sorted_names(
            [*pictures, *(name for rating_message in timely for name in rating_message.providers)]
        ),
    )
    i = {name: index for index, name in enumerate(team.raters)}
    j = {name: index for index, name in enumerate(team.providers)}
    start = min(rating_message.stamp for rating_message in timely)
    count = 1 + round((max(rating_message.stamp for rating_message in timely) - start) / period)

    def round_of(moment: int) -> int:
        """Return the round of a stamp, or of a moment shortly after it."""
        return min(max(0, round((moment - start) / period)), count - 1)

    ratings = np.full((count, len(team.raters), len(team.providers)), np.nan)
    for stamp, rater, provider, value in _counted(again(of_team), team, period, keyring):
        ratings[round_of(stamp), i[rater], j[provider]] = value
    sent = ~np.isnan(ratings)
    for rating_message in timely:
        for provider in rating_message.providers:
            sent[round_of(rating_message.stamp), i[rating_message.rater], j[provider]] = True
    serves = sent.any(axis=1)
    for camera, moments in pictures.items():
        serves[[round_of(moment) for moment in moments], j[camera]] = True
    return TeamObservation(team, period, ratings, sent, serves)


def _origin(message: RecordedMessage, name: str, keyring: Keyring | None) -> Envelope | None:
    """Return the origin of a picture or of ratings; None if it is not from the agent of its
    topic.
    """
    try:
        if owner(message.topic, IMAGES):
            envelope = messages.read_picture_message(name, message.raw).envelope
        else:
            envelope = messages.read_ratings_message(message.raw).envelope
    except ValueError:
        return None
    return envelope if envelope.sender == name and is_genuine(envelope, keyring) else None


def _period(ratings: Iterable[_Ratings]) -> int:
    """Return the time between rounds: the median time between two messages of a rater,
    nanoseconds.
    """
    stamps: dict[str, list[int]] = {}
    for message in ratings:
        stamps.setdefault(message.rater, []).append(message.stamp)
    gaps = [b - a for own in stamps.values() for a, b in pairwise(sorted(own)) if b > a]
    if not gaps:
        raise ValueError("the recording has less than two rounds of ratings")
    return round(statistics.median(gaps))


def _counted(
    recording: Iterable[RecordedMessage], team: Team, period: int, keyring: Keyring | None
) -> Iterable[tuple[int, str, str, float]]:
    """Iterate over the ratings that reach the trust model, as (stamp, rater, provider, rating); any
    model will do.
    """
    with tempfile.TemporaryDirectory() as folder:
        journal = Path(folder) / "journal"
        manager = Manager(
            make_trust_model("constant"),
            journal,
            timing=RoundTiming(period),
            team=team,
            keyring=keyring,
        )
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


class InferredScenario(NamedTuple):
    """A scenario and the estimates behind it.

    Attributes:
        scenario: Scenario of the team.
        names: Names of its agents in the recording, in the order of the scenario.
        raters: Names of the raters, in the order of `perception`.
        providers: Names of the providers, in the order of `perception`.
        lost: Probability that a rating does not count, with its 95% interval.
        late: Share of the ratings that arrived too late.
        perception: Estimates of ability, bias and noise.
        away: Agents that were absent for a while and came back, which a scenario cannot express.
    """

    scenario: Scenario
    names: tuple[str, ...]
    raters: tuple[str, ...]
    providers: tuple[str, ...]
    lost: Interval
    late: float
    perception: PerceptionEstimates
    away: tuple[str, ...]


def infer_scenario(observation: TeamObservation, name: str) -> InferredScenario:
    """Infer the scenario of a team.

    A rating that arrives after its round was closed does not count in the live system, so it counts
    as lost here. Attackers are treated like other agents; see `estimate_perception` for the effect
    of attacks.
    """
    team, rounds = observation.team, len(observation.ratings)
    rates: Mask = np.any(observation.sent, axis=2)
    silence = _longest_silence(rates)
    rating, serving = _spans(rates, silence), _spans(observation.serves, silence)
    present = _presence(rates, rating, silence), _presence(observation.serves, serving, silence)
    due = present[0][:, :, None] & present[1][:, None, :] & ~team.peers
    lost = _lost(due, observation.ratings)
    late = (observation.sent & np.isnan(observation.ratings)).sum() / max(1, observation.sent.sum())
    relative = _relative_quality(observation.ratings)
    deviation = float(_median(abs(relative - 1).ravel(), 0)) / 0.6745
    worse = relative < 1 - max(_MIN_DROP, _MIN_DROP_DEVIATIONS * deviation)
    disturbances = _disturbances(relative, worse)
    perception = estimate_perception(observation.ratings, ~worse)
    agents = [
        _agent(name, observation, perception, rating, serving)
        for name in _ordered_names(observation)
    ]
    data: dict[str, Any] = {
        "name": name,
        "description": f"A team as it was recorded: {len(team.raters)} raters, {len(team.providers)} providers",  # noqa: E501
        "agents": agents,
        "ratings": {"lost": round(lost.value, 4)},
        "perturbations": [
            {"start": start, "stop": stop, "strength": round(strength, 2)}
            for start, stop, strength in disturbances
        ],
        "max_cycles": rounds,
        "period_s": round(observation.period / 1e9, 6),
    }
    away = [
        name
        for names, spans, here in (
            (team.raters, rating, present[0]),
            (team.providers, serving, present[1]),
        )
        for k, name in enumerate(names)
        if (span := spans[k]) is not None and not here[span[0] : span[1], k].all()
    ]
    scenario, names = read_scenario(data, "the recording"), tuple(_ordered_names(observation))
    return InferredScenario(
        scenario, names, team.raters, team.providers, lost, float(late), perception, tuple(away)
    )


def _ordered_names(observation: TeamObservation) -> list[str]:
    """Return the names of all agents in the order of a scenario: raters, providers, agents with
    both roles.
    """
    raters, providers, both = (
        observation.team.raters,
        observation.team.providers,
        observation.team.dual_role,
    )
    return [*(x for x in raters if x not in both), *(x for x in providers if x not in both), *both]


def _agent(
    name: str,
    observation: TeamObservation,
    perception: PerceptionEstimates,
    rating: Spans,
    serving: Spans,
) -> dict[str, Any]:
    """Return a group of one agent, without default values."""
    team, rounds = observation.team, len(observation.ratings)
    rates, serves = name in team.raters, name in team.providers
    group: dict[str, Any] = {"role": "SR+SP" if rates and serves else "SR" if rates else "SP"}
    spans = [rating[team.raters.index(name)]] if rates else []
    spans += [serving[team.providers.index(name)]] if serves else []
    here = [span for span in spans if span is not None]
    joins, leaves = min(span[0] for span in here), max(span[1] for span in here)
    if joins > 0:
        group["joins"] = joins
    if leaves < rounds:
        group["leaves"] = leaves
    if rates:
        place = team.raters.index(name)
        noise, bias = perception.noise[place], perception.bias[place]
        if noise.value > 0:
            group["noise"] = _round_digits(noise.value)
        if bias.low > 0 or bias.high < 0:
            group["bias"] = _round_digits(bias.value)
    if serves:
        ability = perception.ability[team.providers.index(name)]
        if ability.high < 1:
            group["ability"] = round(ability.value, 3)
    return group


def _round_digits(value: float) -> float:
    return float(f"{value:.3g}")


def _longest_silence(active: Mask) -> int:
    """Return the longest silence that lost messages alone can explain, rounds, given the active
    rounds, (R, n).
    """
    gaps = []
    for column in active.T:
        at = np.flatnonzero(column)
        gaps += [1 - len(at) / (at[-1] - at[0] + 1)] if len(at) else []
    share = min(float(np.median(gaps)), 0.9) if gaps else 0.0
    return (
        max(_MIN_SILENCE, math.ceil(math.log(_UNLIKELY) / math.log(share)))
        if share > 0
        else _MIN_SILENCE
    )


def _spans(active: Mask, silence: int) -> Spans:
    """Return the first and the last round of each agent, given its active rounds, (R, n).

    A short silence at the beginning or the end counts as presence.
    """
    spans: Spans = []
    for column in active.T:
        at = np.flatnonzero(column)
        if not len(at):
            spans.append(None)
            continue
        first, last = int(at[0]), int(at[-1]) + 1
        spans.append(
            (first if first > silence else 0, last if len(column) - last > silence else len(column))
        )
    return spans


def _presence(active: Mask, spans: Spans, silence: int) -> Mask:
    """Return the mask of the rounds in which each agent was present: its span without long
    silences, (R, n).
    """
    present = np.zeros(active.shape, bool)
    for k, span in enumerate(spans):
        if span is None:
            continue
        at = [span[0] - 1, *np.flatnonzero(active[:, k]).tolist(), span[1]]
        present[span[0] : span[1], k] = True
        for before, after in pairwise(at):
            if after - before - 1 > silence:
                present[before + 1 : after, k] = False
    return present


def _lost(due: Mask, ratings: Floats) -> Interval:
    """Return the share of the due ratings that did not count, with an interval over rounds, since
    losses cluster.
    """
    expected = due.any(axis=(1, 2))
    counts = due[expected].sum(axis=(1, 2))
    missing = (due & np.isnan(ratings))[expected].sum(axis=(1, 2))
    mean = over_games(missing / counts)
    value, half = float(mean.mean), float(mean.half)
    return Interval(value, max(0.0, value - half), min(1.0, value + half))


def _relative_quality(ratings: Floats) -> Floats:
    """Return the median rating of each provider in a round, relative to its usual one, (R, P)."""
    level = _median(ratings, 1)
    usual = _median(level, 0)
    relative: Floats = np.divide(level, usual, out=np.full(level.shape, np.nan), where=usual > 0)
    return relative


def _disturbances(relative: Floats, worse: Mask) -> list[tuple[int, int, float]]:
    """Return the intervals of rounds in which all services were worse together, as (start, stop,
    strength).

    With a single provider there are none, since a disturbance would look like an attack.
    """
    rated = ~np.isnan(relative)
    disturbed = (worse | ~rated).all(axis=1) & rated.any(axis=1) & (relative.shape[1] > 1)
    edges = np.flatnonzero(
        np.diff(np.concatenate([[False], disturbed, [False]]).astype(int))
    ).reshape(-1, 2)
    return [(int(a), int(b), float(np.clip(1 - np.nanmean(relative[a:b]), 0, 1))) for a, b in edges]


def _median(values: npt.NDArray[Any], axis: int) -> Floats:
    """Return the median without NaN entries; NaN where all entries are."""
    known = (~np.isnan(values)).any(axis=axis)
    medians: Floats = np.full(np.delete(np.array(values.shape), axis), np.nan)
    medians[known] = np.nanmedian(np.moveaxis(values, axis, -1)[known], axis=-1)
    return medians
