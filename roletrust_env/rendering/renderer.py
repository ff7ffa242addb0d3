"""What a person sees of a game: a picture, a window or a table of text.

`Scene` is what there is to see, read off a state; `as_text` writes it, `Renderer` shows it as a render mode says. The
matplotlib part is `roletrust_env.rendering.drawing`, imported when a picture is asked for.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from roletrust_env.game.game import Game
from roletrust_env.game.state import State
from roletrust_env.world.presence import CUT_OFF, LEFT, WAITING

if TYPE_CHECKING:
    from roletrust_env.rendering.drawing import Canvas, Window

Floats = npt.NDArray[np.float64]
Curves = Sequence[tuple[Any, Any]]
"""The published trust, ToR (S,) and ToP (P,), at the start and after each round so far, oldest first."""

_FATES = {WAITING: "waiting", LEFT: "left", CUT_OFF: "cut off"}
_TABLE_LIMIT = 12  # agents on a side up to which the table shows each of them
_FEW = 4  # of the best and of the worst, shown where there are more
_BAR = 16


class Side(NamedTuple):
    """The raters or the providers of a game, K of them.

    Attributes:
        names: of the agents.
        trust: ToR or ToP, (K,).
        attacker: which of them are marked as attackers, (K,), boolean.
        fates: why an agent is absent, `"waiting"`, `"left"` or `"cut off"`; empty if it is present.
        notes: a few more words on each.
    """

    names: tuple[str, ...]
    trust: Floats
    attacker: npt.NDArray[np.bool_]
    fates: tuple[str, ...]
    notes: tuple[str, ...]


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


class Renderer:
    """Shows one game, as one render mode says. A copy, also a pickled one, begins with a window of its own.

    Args:
        game: whose states are shown.
        mode: `"rgb_array"`, `"ansi"` or `"human"`. Without a display a window is impossible: one warning, and no more.
    """

    def __init__(self, game: Game, mode: Literal["human", "rgb_array", "ansi"]) -> None:
        self.game = game
        self.mode = mode
        self._opened = False
        self._surface: Canvas | Window | None = None
        self._shown: tuple[State, tuple[str, ...]] | None = None

    def render(self, state: State, curves: Curves, attackers: tuple[str, ...]) -> npt.NDArray[np.uint8] | str | None:
        """Show a state of one game, not of a batch.

        Args:
            state: what is shown; it is only read.
            curves: the published trust so far.
            attackers: names of the agents to mark.

        Returns:
            The picture, shape (H, W, 3), the text, or None for a window.

        Raises:
            ModuleNotFoundError: the mode needs matplotlib, which is not installed.
        """
        if self.mode == "ansi":
            return as_text(look(self.game, state, attackers))
        if not self._opened:
            self._surface, self._opened = _open(self.mode, self.game), True
        if self._surface is None:
            return None
        # In the AEC face each agent's turn may ask for the same picture again.
        if self._shown is None or self._shown[0] is not state or self._shown[1] != attackers:
            self._surface.draw(look(self.game, state, attackers), curves)
            self._shown = state, attackers
        return self._surface.frame()

    def __reduce__(self) -> tuple[Any, ...]:
        return Renderer, (self.game, self.mode)

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._surface is not None:
            self._surface.close()
            self._surface = None


def _open(mode: Literal["human", "rgb_array"], game: Game) -> Canvas | Window | None:
    """What to draw on; None where no window can be opened."""
    try:
        from roletrust_env.rendering.drawing import Canvas, Window
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] != "matplotlib":
            raise
        raise ModuleNotFoundError(
            f"render_mode {mode!r} needs matplotlib: pip install 'roletrust-env[cli]'; 'ansi' does without"
        ) from None
    if mode == "rgb_array":
        return Canvas(game.scenario)
    try:
        return Window(game.scenario)
    except ImportError as error:
        warnings.warn(f"render_mode 'human' shows nothing: {error}", stacklevel=4)
        return None


def look(game: Game, state: State, attackers: Iterable[str]) -> Scene:
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


def _side(names: tuple[str, ...], trust: Any, phases: Any, marked: set[str], notes: list[str]) -> Side:
    fates = tuple(_FATES.get(int(phase), "") for phase in phases)
    attacker = np.asarray([name in marked for name in names])
    words = [
        " · ".join(filter(None, ("attacker" if attacks else "", fate or note)))
        for attacks, fate, note in zip(attacker, fates, notes, strict=True)
    ]
    return Side(names, np.asarray(trust, np.float64), attacker, fates, tuple(words))


def as_text(scene: Scene) -> str:
    """A table of the raters with their ratings, and one of the providers; a summary where there are many."""
    header = f"{scene.title}  ·  {scene.clock}"
    if scene.perturbation > 0:
        header += f"  ·  perturbation {scene.perturbation:.0%}"
    small = max(scene.ratings.shape) <= _TABLE_LIMIT
    tables = [
        *_table("rater", "ToR", scene.raters, scene if small else None),
        "",
        *_table("provider", "ToP", scene.providers),
    ]
    given = scene.ratings[~np.isnan(scene.ratings)]
    if not small:
        ratings = f"ratings    {given.size} arrived"
        tables += ["", ratings + (f", mean {given.mean():.2f}, lowest {given.min():.2f}" if given.size else "")]
    rule = "─" * max(len(line) for line in [header, *tables])
    return "\n".join([header, rule, *tables])


def _table(kind: str, trust: str, side: Side, matrix: Scene | None = None) -> list[str]:
    """Head and rows of one side; with the ratings that each rater gave, if there is a matrix to show."""
    width = max(8, *map(len, side.names))
    notes = max(5, *map(len, side.notes))
    head = f"{kind:<{width}}   {trust}  {'':<{_BAR}}"
    rows = [
        f"{name:<{width}} {'!' if attacks else ' '} {'' if fate else f'{value:.2f}':4} {_bar(value, fate)}  {note}"
        for name, value, attacks, fate, note in zip(*side, strict=True)
    ]
    if matrix is not None:
        columns = [max(5, len(name)) for name in matrix.providers.names]
        titles = (f"{name:>{w}}" for name, w in zip(matrix.providers.names, columns, strict=True))
        head = f"{head}  {'':<{notes}}  {' '.join(titles)}"
        wide = len(rows[0]) - len(side.notes[0]) + notes
        rows = [
            f"{row:<{wide}}  " + " ".join(f"{_rating(f):>{w}}" for f, w in zip(given, columns, strict=True))
            for row, given in zip(rows, matrix.ratings, strict=True)
        ]
    return [line.rstrip() for line in (head, *_few(rows, kind, trust, side))]


def _few(rows: list[str], kind: str, trust: str, side: Side) -> list[str]:
    """The rows, or if there are too many, means and the best and the worst of those present."""
    if len(rows) <= _TABLE_LIMIT:
        return rows
    present = np.asarray([not fate for fate in side.fates])
    best = [int(k) for k in np.argsort(-side.trust, kind="stable") if present[k]]
    summary = [f"{present.sum()} of {len(rows)} {kind}s present, mean {trust} {_mean(side.trust[present])}"]
    if side.attacker.any():
        attackers, honest = present & side.attacker, present & ~side.attacker
        summary.append(
            f"{side.attacker.sum()} attackers, mean {trust} {_mean(side.trust[attackers])}; "
            f"the honest {_mean(side.trust[honest])}"
        )
    if len(best) <= 2 * _FEW:
        return [*summary, *(rows[k] for k in best)]
    between = f"  ... {len(best) - 2 * _FEW} between"
    return [*summary, *(rows[k] for k in best[:_FEW]), between, *(rows[k] for k in best[-_FEW:])]


def _mean(values: Floats) -> str:
    return f"{values.mean():.2f}" if values.size else "-"


def _rating(rating: float) -> str:
    return "·" if np.isnan(rating) else f"{rating:.2f}"


def _bar(value: float, fate: str) -> str:
    """A bar in eighths of a character; absent agents have none."""
    if fate:
        return " " * _BAR
    full, rest = divmod(round(value * _BAR * 8), 8)
    bar = "█" * full + (" ▏▎▍▌▋▊▉"[rest] if rest else "")
    return bar + "·" * (_BAR - len(bar))
