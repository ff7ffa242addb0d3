"""A scenario of what was observed of a team, as far as scenarios can say it."""

import math
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from roletrust_env import Scenario
from roletrust_env.metrics.confidence import Interval, over_games
from roletrust_env.world.scenario import read_scenario
from roletrust_experiments.identification.observed import Floats, Mask, Observed
from roletrust_experiments.identification.perception import Seen, perceive

_SILENT = 3  # rounds without a word, by which at least somebody is found to have come or gone
_UNLIKELY = 1e-3  # chance of a silence by loss alone that is no longer taken for one
_VISIBLE = 0.1  # share of all quality from which a disturbance of all services is one
_NOISES = 4.0  # and how many deviations it is

Spans = list[tuple[int, int] | None]


class Found(NamedTuple):
    """What was found, besides the scenario.

    Attributes:
        scenario: the team as it was.
        names: of its agents in the recording, in the order of the scenario's own.
        raters: of them, in the order of `seen`.
        providers: of them, in the order of `seen`.
        lost: probability that a rating does not count.
        late: the share of ratings that came, and too late.
        seen: how raters see.
        away: who was silent for long and came back, which no scenario can say.
    """

    scenario: Scenario
    names: tuple[str, ...]
    raters: tuple[str, ...]
    providers: tuple[str, ...]
    lost: Interval
    late: float
    seen: Seen
    away: tuple[str, ...]


def infer(observed: Observed, name: str) -> Found:
    """The scenario of a team.

    A rating that comes after its round was closed does not count on the wire, so it is lost here. Who attacks is not
    told apart: see `perceive` for what attacks do to it.

    Args:
        observed: the team.
        name: of the scenario.
    """
    team, rounds = observed.team, len(observed.ratings)
    talks: Mask = np.any(observed.sent, axis=2)
    patience = _patience(talks)
    rating, serving = _spans(talks, patience), _spans(observed.serves, patience)
    there = _here(talks, rating, patience), _here(observed.serves, serving, patience)
    due = there[0][:, :, None] & there[1][:, None, :] & ~team.peers
    lost = _lost(due, observed.ratings)
    late = (observed.sent & np.isnan(observed.ratings)).sum() / max(1, observed.sent.sum())
    share = _share(observed.ratings)
    worse = share < 1 - max(_VISIBLE, _NOISES * float(_median(abs(share - 1).ravel(), 0)) / 0.6745)
    blows = _disturbances(share, worse)
    seen = perceive(observed.ratings, ~worse)
    agents = [_agent(name, observed, seen, rating, serving) for name in _roles(observed)]
    data: dict[str, Any] = {
        "name": name,
        "description": f"A team as it was recorded: {len(team.raters)} raters, {len(team.providers)} providers",
        "agents": agents,
        "ratings": {"lost": round(lost.value, 4)},
        "perturbations": [
            {"start": start, "stop": stop, "strength": round(strength, 2)} for start, stop, strength in blows
        ],
        "max_cycles": rounds,
        "period_s": round(observed.period / 1e9, 6),
    }
    away = [
        one
        for names, spans, here in ((team.raters, rating, there[0]), (team.providers, serving, there[1]))
        for k, one in enumerate(names)
        if (span := spans[k]) is not None and not here[span[0] : span[1], k].all()
    ]
    made, names = read_scenario(data, "the recording"), tuple(_roles(observed))
    return Found(made, names, team.raters, team.providers, lost, float(late), seen, tuple(away))


def _roles(observed: Observed) -> list[str]:
    """All agents, in the order of a scenario's: those that rate, those that serve, those that do both."""
    raters, providers, both = observed.team.raters, observed.team.providers, observed.team.both
    return [*(x for x in raters if x not in both), *(x for x in providers if x not in both), *both]


def _agent(name: str, observed: Observed, seen: Seen, rating: Spans, serving: Spans) -> dict[str, Any]:
    """A group of one agent; what is as usual is left out."""
    team, rounds = observed.team, len(observed.ratings)
    rates, serves = name in team.raters, name in team.providers
    found: dict[str, Any] = {"role": "SR+SP" if rates and serves else "SR" if rates else "SP"}
    spans = [rating[team.raters.index(name)]] if rates else []
    spans += [serving[team.providers.index(name)]] if serves else []
    here = [span for span in spans if span is not None]
    joins, leaves = min(span[0] for span in here), max(span[1] for span in here)
    if joins > 0:
        found["joins"] = joins
    if leaves < rounds:
        found["leaves"] = leaves
    if rates:
        place = team.raters.index(name)
        noise, bias = seen.noise[place], seen.bias[place]
        if noise.value > 0:
            found["noise"] = _digits(noise.value)
        if bias.low > 0 or bias.high < 0:
            found["bias"] = _digits(bias.value)
    if serves:
        ability = seen.ability[team.providers.index(name)]
        if ability.high < 1:
            found["ability"] = round(ability.value, 3)
    return found


def _digits(value: float) -> float:
    return float(f"{value:.3g}")


def _patience(here: Mask) -> int:
    """After how many rounds a silence is none of luck: (R, n)."""
    gaps = []
    for column in here.T:
        at = np.flatnonzero(column)
        gaps += [1 - len(at) / (at[-1] - at[0] + 1)] if len(at) else []
    share = min(float(np.median(gaps)), 0.9) if gaps else 0.0
    return max(_SILENT, math.ceil(math.log(_UNLIKELY) / math.log(share))) if share > 0 else _SILENT


def _spans(here: Mask, patience: int) -> Spans:
    """From when to when each was there, the whole run if it was silent only shortly at its ends: (R, n)."""
    spans: Spans = []
    for column in here.T:
        at = np.flatnonzero(column)
        if not len(at):
            spans.append(None)
            continue
        first, last = int(at[0]), int(at[-1]) + 1
        spans.append((first if first > patience else 0, last if len(column) - last > patience else len(column)))
    return spans


def _here(spoke: Mask, spans: Spans, patience: int) -> Mask:
    """Who was there when: in its span, but for silences that are too long to be of luck, (R, n)."""
    here = np.zeros(spoke.shape, bool)
    for k, span in enumerate(spans):
        if span is None:
            continue
        at = [span[0] - 1, *np.flatnonzero(spoke[:, k]).tolist(), span[1]]
        here[span[0] : span[1], k] = True
        for before, after in pairwise(at):
            if after - before - 1 > patience:
                here[before + 1 : after, k] = False
    return here


def _lost(due: Mask, ratings: Floats) -> Interval:
    """The share of the ratings that were due and did not count; its interval is by rounds, for losses come together."""
    some = due.any(axis=(1, 2))
    counts = due[some].sum(axis=(1, 2))
    missing = (due & np.isnan(ratings))[some].sum(axis=(1, 2))
    mean = over_games(missing / counts)
    value, half = float(mean.mean), float(mean.half)
    return Interval(value, max(0.0, value - half), min(1.0, value + half))


def _share(ratings: Floats) -> Floats:
    """Of what most raters usually say of a provider, how much most say in a round, (R, P)."""
    level = _median(ratings, 1)
    usual = _median(level, 0)
    share: Floats = np.divide(level, usual, out=np.full(level.shape, np.nan), where=usual > 0)
    return share


def _disturbances(share: Floats, worse: Mask) -> list[tuple[int, int, float]]:
    """Stretches of rounds in which all services were worse together: (start, stop, share that was gone).

    With one provider it cannot be told from an attack, so none is looked for.
    """
    rated = ~np.isnan(share)
    struck = (worse | ~rated).all(axis=1) & rated.any(axis=1) & (share.shape[1] > 1)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], struck, [False]]).astype(int))).reshape(-1, 2)
    return [(int(a), int(b), float(np.clip(1 - np.nanmean(share[a:b]), 0, 1))) for a, b in edges]


def _median(values: npt.NDArray[Any], axis: int) -> Floats:
    """The median of what is there; NaN where nothing is."""
    some = (~np.isnan(values)).any(axis=axis)
    found: Floats = np.full(np.delete(np.array(values.shape), axis), np.nan)
    found[some] = np.nanmedian(np.moveaxis(values, axis, -1)[some], axis=-1)
    return found
