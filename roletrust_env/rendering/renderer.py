"""What a person sees of a game: a picture, a window or a table of text.

`Scene` is what there is to see, read off a state; `as_text` writes it, `Renderer` shows it as a render mode says. The
matplotlib part is `roletrust_env.rendering.drawing`, imported when a picture is asked for.
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
            DependencyNotInstalled: of Gymnasium: the mode needs matplotlib.
        """
        if self.mode == "ansi":
            return as_text(make_scene(self.game, state, attackers))
        if not self._opened:
            self._surface, self._opened = _open(self.mode, self.game), True
        if self._surface is None:
            return None
        # In the AEC face each agent's turn may ask for the same picture again.
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
    """What to draw on; None where no window can be opened."""
    try:
        from roletrust_env.rendering.drawing import Canvas, Window
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] != "matplotlib":
            raise
        raise DependencyNotInstalled(
            f"render_mode {mode!r} needs matplotlib: pip install 'roletrust-env[cli]'; 'ansi' does without"
        ) from None
    if mode == "rgb_array":
        return Canvas(game.scenario)
    try:
        return Window(game.scenario)
    except ImportError as error:
        warnings.warn(f"render_mode 'human' shows nothing: {error}", stacklevel=5)
        return None
