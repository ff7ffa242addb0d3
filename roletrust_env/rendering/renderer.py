"""Renderer of a game: a picture, a window or a table of text.

A `Scene` is the visible content of a state. `as_text` turns it into text, and `Renderer` shows it
in a render mode. `roletrust_env.rendering.drawing`, which needs matplotlib, is imported only for
pictures and windows.
"""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import numpy.typing as npt
from gymnasium.error import DependencyNotInstalled

from roletrust_env.game.game import Game
from roletrust_env.game.state import State
from roletrust_env.rendering.scene import Curves, make_scene
from roletrust_env.rendering.text import as_text

if TYPE_CHECKING:
    from roletrust_env.rendering.drawing import Canvas, Window


class Renderer:
    """Renderer of one game in one render mode. A copy, also by pickling, opens its own window.

    Args:
        game: Game to show.
        mode: Render mode: `"rgb_array"`, `"ansi"` or `"human"`. Without a display, `"human"` shows
            nothing and warns once.
    """

    def __init__(self, game: Game, mode: Literal["human", "rgb_array", "ansi"]) -> None:
        self.game = game
        self.mode = mode
        self._opened = False
        self._surface: Canvas | Window | None = None
        self._shown: tuple[State, tuple[str, ...]] | None = None

    def render(
        self, state: State, curves: Curves, attackers: tuple[str, ...]
    ) -> npt.NDArray[np.uint8] | str | None:
        """Show the state of a single game, not of a batch.

        Args:
            state: State to show; it is not changed.
            curves: Published trust up to this state.
            attackers: Names of the agents to mark as attackers.

        Returns:
            The picture, shape (H, W, 3), or the text, or None for a window.

        Raises:
            DependencyNotInstalled: The mode needs matplotlib. The error is Gymnasium's.
        """
        if self.mode == "ansi":
            return as_text(make_scene(self.game, state, attackers))
        if not self._opened:
            self._surface, self._opened = _open(self.mode, self.game), True
        if self._surface is None:
            return None
        # In the AEC environment every agent can render the same state in its turn.
        if self._shown is None or self._shown[0] is not state or self._shown[1] != attackers:
            self._surface.draw(make_scene(self.game, state, attackers), curves)
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
    """Return a canvas or a window; None if no window can be opened."""
    try:
        from roletrust_env.rendering.drawing import Canvas, Window
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] != "matplotlib":
            raise
        raise DependencyNotInstalled(
            f"render_mode {mode!r} needs matplotlib: pip install 'roletrust-env[cli]'; 'ansi' does "
            "not need it"
        ) from None
    if mode == "rgb_array":
        return Canvas(game.scenario)
    try:
        return Window(game.scenario)
    except ImportError as error:
        warnings.warn(f"render_mode 'human' shows nothing: {error}", stacklevel=5)
        return None
