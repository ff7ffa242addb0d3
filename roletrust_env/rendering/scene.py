"""What there is to see of a game, read off its state."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from roletrust_env.game.game import Game
from roletrust_env.game.state import State
from roletrust_env.world.presence import CUT_OFF, LEFT, WAITING

if TYPE_CHECKING:
    pass

Floats = npt.NDArray[np.float64]


Curves = Sequence[tuple[Any, Any]]
"""The published trust, ToR (S,) and ToP (P,), at the start and after each round so far, oldest first."""


_ABSENCES = {WAITING: "waiting", LEFT: "left", CUT_OFF: "cut off"}


class Side(NamedTuple):
    """The raters or the providers of a game, K of them.

    Attributes:
        names: of the agents.
        trust: ToR or ToP, (K,).
        attacker: which of them are marked as attackers, (K,), boolean.
        absences: why an agent is absent, `"waiting"`, `"left"` or `"cut off"`; empty if it is present.
        captions: a few more words on each.
    """

    names: tuple[str, ...]
    trust: Floats
    attacker: npt.NDArray[np.bool_]
    absences: tuple[str, ...]
    captions: tuple[str, ...]


class Scene(NamedTuple):
    """What there is to see of a game after a round.

    Attributes:
        title: name of the scenario.
        clock: the round and the time.
        perturbation: its strength in the round just played.
        raters: S of them.
        providers: P of them.
        ratings: that arrived in the last round, NaN where none did, (S, P).
    """

    title: str
    clock: str
    perturbation: float
    raters: Side
    providers: Side
    ratings: Floats


def make_scene(game: Game, state: State, attackers: Iterable[str]) -> Scene:
    """Read off a state what there is to see."""
    roster, rules = game.roster, game.scenario
    tor, top = game.published(state)
    played = int(state.round)
    phase = np.ones(roster.n_agents) if state.population is None else state.population.phase
    toa = [f"ToA {trust:.2f}" for trust in roster.both(game.agent_trust(state))]
    serves = state.awaiting.any(axis=0)
    quality = [
        f"quality {q:.2f}" if busy else "idle" if played else "" for q, busy in zip(state.quality, serves, strict=True)
    ]
    marked = set(attackers)
    n_sr = roster.n_raters - roster.n_both
    struck = [blow.strength for blow in rules.perturbations if blow.start < played <= blow.stop]
    return Scene(
        rules.name,
        f"round {played} of {rules.max_cycles}  ·  {played * rules.period_s:.1f} s",
        max(struck, default=0.0),
        _side(roster.rater_names, tor, roster.raters(phase), marked, [""] * n_sr + toa),
        _side(roster.provider_names, top, roster.providers(phase), marked, quality),
        np.where(state.rated, state.ratings, np.nan),
    )


def _side(names: tuple[str, ...], trust: Any, phases: Any, marked: set[str], captions: list[str]) -> Side:
    absences = tuple(_ABSENCES.get(int(phase), "") for phase in phases)
    attacker = np.asarray([name in marked for name in names])
    words = [
        " · ".join(filter(None, ("attacker" if attacks else "", absence or note)))
        for attacks, absence, note in zip(attacker, absences, captions, strict=True)
    ]
    return Side(names, np.asarray(trust, np.float64), attacker, absences, tuple(words))
