"""Scene: the visible content of the state of a game."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from roletrust_env.game.game import Game
from roletrust_env.game.state import State
from roletrust_env.world.presence import CUT_OFF, LEFT, WAITING

Floats = npt.NDArray[np.float64]

Curves = Sequence[tuple[Any, Any]]
"""Published trust, ToR (S,) and ToP (P,), at the start and after each round, oldest first."""

_ABSENCES = {WAITING: "waiting", LEFT: "left", CUT_OFF: "cut off"}


class Side(NamedTuple):
    """Raters or providers of a game, K agents.

    Attributes:
        names: Names of the agents.
        trust: ToR or ToP, shape (K,).
        attacker: Boolean array of shape (K,), true for agents marked as attackers.
        absences: Reason why each agent is absent: `"waiting"`, `"left"` or `"cut off"`; empty if it
            is present.
        captions: Caption of each agent.
    """

    names: tuple[str, ...]
    trust: Floats
    attacker: npt.NDArray[np.bool_]
    absences: tuple[str, ...]
    captions: tuple[str, ...]


class Scene(NamedTuple):
    """Visible content of a game after a round.

    Attributes:
        title: Name of the scenario.
        clock: Round and time, as text.
        perturbation: Strength of the perturbation in the last round.
        raters: Raters, S agents.
        providers: Providers, P agents.
        ratings: Ratings that arrived in the last round, shape (S, P), NaN where none arrived.
    """

    title: str
    clock: str
    perturbation: float
    raters: Side
    providers: Side
    ratings: Floats


def make_scene(game: Game, state: State, attackers: Iterable[str]) -> Scene:
    """Return the scene of a state, with some agents marked as attackers."""
    roster, rules = game.roster, game.scenario
    tor, top = game.published(state)
    played = int(state.round)
    phase = np.ones(roster.n_agents) if state.population is None else state.population.phase
    toa = [f"ToA {trust:.2f}" for trust in roster.both(game.agent_trust(state))]
    serves = state.awaiting.any(axis=0)
    quality = [
        f"quality {q:.2f}" if busy else "idle" if played else ""
        for q, busy in zip(state.quality, serves, strict=True)
    ]
    marked = set(attackers)
    n_sr = roster.n_raters - roster.n_both
    strengths = [p.strength for p in rules.perturbations if p.start < played <= p.stop]
    return Scene(
        rules.name,
        f"round {played} of {rules.max_cycles}  ·  {played * rules.period_s:.1f} s",
        max(strengths, default=0.0),
        _side(roster.rater_names, tor, roster.raters(phase), marked, [""] * n_sr + toa),
        _side(roster.provider_names, top, roster.providers(phase), marked, quality),
        np.where(state.rated, state.ratings, np.nan),
    )


def _side(
    names: tuple[str, ...], trust: Any, phases: Any, marked: set[str], captions: list[str]
) -> Side:
    absences = tuple(_ABSENCES.get(int(phase), "") for phase in phases)
    attacker = np.asarray([name in marked for name in names])
    words = [
        " · ".join(filter(None, ("attacker" if attacks else "", absence or note)))
        for attacks, absence, note in zip(attacker, absences, captions, strict=True)
    ]
    return Side(names, np.asarray(trust, np.float64), attacker, absences, tuple(words))
