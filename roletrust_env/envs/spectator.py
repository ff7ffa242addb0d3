"""Pictures of games in progress, the same in every environment."""

from base64 import b64encode
from html import escape
from io import BytesIO
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np
import numpy.typing as npt
from gymnasium.error import DependencyNotInstalled

from roletrust_env.game.game import Game
from roletrust_env.game.state import State, first_game

if TYPE_CHECKING:
    from roletrust_env.rendering.renderer import Renderer

RenderMode = Literal["human", "rgb_array", "ansi"]
RENDERING: dict[str, Any] = {"render_modes": list(get_args(RenderMode)), "render_fps": 4}
"""The part about rendering of the metadata of every environment."""


class Spectator:
    """Follows a game, or the first game of a batch: records the trust curves and shows the state.

    Args:
        game: Game that is played.
        render_mode: `"human"`, `"rgb_array"` or `"ansi"`; None shows nothing.

    Attributes:
        attackers: Names of the agents to mark.
        curves: Published trust so far, ToR (S,) and ToP (P,), oldest first; empty without a render
            mode.

    Raises:
        ValueError: The render mode is unknown.
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
        """Take the state of the games, at the start and after each round."""
        if self._mode is None:
            self._state = state
            return
        state = first_game(state)
        # A masked reset shows the first game anew, or once more as it stood.
        self.curves[int(state.round) :] = [self._game.published(state)]
        self._state = state
        if self._mode == "human":
            self.render()

    def render(self) -> npt.NDArray[np.uint8] | str | None:
        """Show the state of the game: a picture, text, or a window (None).

        Raises:
            RuntimeError: There is no render mode, or no game yet.
            DependencyNotInstalled: Matplotlib is missing. The class is that of Gymnasium.
        """
        if self._mode is None or self._state is None:
            raise RuntimeError(
                "make the environment with a render_mode, and call reset() before render()"
            )
        if self._renderer is None:
            from roletrust_env.rendering.renderer import Renderer

            self._renderer = Renderer(self._game, self._mode)
        return self._renderer.render(self._state, self.curves, self.attackers)

    def html(self, title: str, state: State | None = None) -> str:
        """Return the state of the game for a notebook: a picture, or text where matplotlib is
        missing.

        Args:
            title: Line above the picture.
            state: State of the games; None for that which was followed last.
        """
        heading = f"<code>{escape(title)}</code>"
        state = self._state if state is None else state
        if state is None:
            return heading
        state = first_game(state)
        tor, top = (np.asarray(trust) for trust in self._game.published(state))
        before = np.full_like(tor, np.nan), np.full_like(top, np.nan)
        # Without a render mode there is no record of the rounds before.
        curves = self.curves or [*[before] * int(state.round), (tor, top)]
        try:
            return f"{heading}<br>{_image(self._game, state, curves, self.attackers)}"
        except DependencyNotInstalled:
            from roletrust_env.rendering.renderer import Renderer

            text = Renderer(self._game, "ansi").render(state, curves, self.attackers)
            return f"{heading}<pre>{escape(str(text))}</pre>"

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None


def _image(game: Game, state: State, curves: Any, attackers: tuple[str, ...]) -> str:
    """Return a picture of a state as an HTML element."""
    from roletrust_env.rendering.renderer import Renderer

    renderer = Renderer(game, "rgb_array")
    picture = np.asarray(renderer.render(state, curves, attackers))
    from matplotlib.image import imsave

    file = BytesIO()
    imsave(file, picture, format="png")
    renderer.close()
    return (
        '<img alt="state of the game" '
        f'src="data:image/png;base64,{b64encode(file.getvalue()).decode()}">'
    )
