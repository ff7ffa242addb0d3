"""What a person sees of games in progress, the same through every face."""

from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np
import numpy.typing as npt

from roletrust_env.envs.task_batch import first_game
from roletrust_env.game.game import Game
from roletrust_env.game.state import State

if TYPE_CHECKING:
    from roletrust_env.rendering.renderer import Renderer

RenderMode = Literal["human", "rgb_array", "ansi"]
RENDERING: dict[str, Any] = {"render_modes": list(get_args(RenderMode)), "render_fps": 4}
"""What the metadata of every face say of it."""


class Spectator:
    """Follows a game, of a batch the first: keeps the trust curves, which no state holds, and shows what is new.

    Args:
        game: what is played.
        render_mode: `"human"`, `"rgb_array"` or `"ansi"`; None shows nothing.

    Attributes:
        attackers: names of the agents to mark.
        curves: the published trust so far, ToR (S,) and ToP (P,), oldest first.

    Raises:
        ValueError: the render mode is unknown.
    """

    def __init__(self, game: Game, render_mode: RenderMode | None) -> None:
        if render_mode is not None and render_mode not in get_args(RenderMode):
            known = ", ".join(get_args(RenderMode))
            raise ValueError(f"unknown render_mode {render_mode!r}; known: {known}, or None")
        self.attackers: tuple[str, ...] = ()
        self._game, self._mode = game, render_mode
        self._state: State | None = None
        self.curves: list[tuple[Any, Any]] = []
        self._renderer: Renderer | None = None  # made when first needed

    def follow(self, state: State) -> None:
        """Take note of how it stands, at the start and after each round."""
        if self._mode is None:
            return
        state = first_game(state)
        # A masked reset shows the first game anew, or once more as it stood.
        self.curves[int(state.round) :] = [self._game.published(state)]
        self._state = state
        if self._mode == "human":
            self.render()

    def render(self) -> npt.NDArray[np.uint8] | str | None:
        """Show the game as it stands: a picture, text, or a window (None).

        Raises:
            RuntimeError: there is no render mode, or no game yet.
            DependencyNotInstalled: of Gymnasium: matplotlib is missing.
        """
        if self._mode is None or self._state is None:
            raise RuntimeError("make the environment with a render_mode, and call reset() before render()")
        if self._renderer is None:
            from roletrust_env.rendering.renderer import Renderer

            self._renderer = Renderer(self._game, self._mode)
        return self._renderer.render(self._state, self.curves, self.attackers)

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None
