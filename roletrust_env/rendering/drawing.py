"""Pictures of a game with matplotlib: the ratings and the trust of all agents, with trust curves beside them.

With at most `_GRAPH_LIMIT` raters and providers, ratings are the edges of a bipartite graph, otherwise the cells of its
adjacency matrix. The background is drawn once; only the artists that change are drawn in each frame.
"""

from typing import Any

import matplotlib
import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from roletrust_env.rendering.panels import Graph, Matrix, Panel, TrustCurves
from roletrust_env.rendering.scene import Curves, Scene
from roletrust_env.rendering.style import DPI, GREY, INK, SCALE, SIZE, STYLE
from roletrust_env.world.scenario import Scenario

_WINDOWLESS = frozenset(("agg", "cairo", "inline", "pdf", "pgf", "ps", "svg", "template"))  # backends of matplotlib
_GRAPH_LIMIT = 20  # raters or providers; with more, single edges could not be seen


class Canvas:
    """Canvas that draws frames in memory.

    Args:
        scenario: Scenario of the game.
    """

    def __init__(self, scenario: Scenario) -> None:
        self._scenario = scenario
        self._canvas: Any = FigureCanvasAgg(Figure(SIZE, DPI))  # not typed by matplotlib
        self._picture: Picture | None = None

    def draw(self, scene: Scene, curves: Curves) -> None:
        """Draw a frame."""
        canvas = self._canvas
        if self._picture is None or not self._picture.can_show(scene):
            self._picture = Picture(canvas.figure, self._scenario, scene)
            for artist in self._picture.moving:
                artist.set_animated(True)
            canvas.draw()
            self._background = canvas.copy_from_bbox(canvas.figure.bbox)
        canvas.restore_region(self._background)
        self._picture.update(scene, curves)
        for artist in self._picture.moving:
            artist.draw(canvas.get_renderer())

    def frame(self) -> npt.NDArray[np.uint8]:
        """Return the last frame, shape (H, W, 3)."""
        return np.ascontiguousarray(np.asarray(self._canvas.buffer_rgba())[..., :3])

    def close(self) -> None:
        """Do nothing, as there is no window."""


class Window:
    """Window that shows frames.

    Args:
        scenario: Scenario of the game.

    Raises:
        ImportError: There is no display, or the backend of matplotlib has no windows.
    """

    def __init__(self, scenario: Scenario) -> None:
        import matplotlib.pyplot as plt

        if plt.get_backend().lower().rpartition("_")[2] in _WINDOWLESS:
            raise ImportError("matplotlib's backend has no windows")
        self._plt = plt
        self._scenario = scenario
        with matplotlib.rc_context(STYLE):
            self._figure = plt.figure(figsize=SIZE, dpi=DPI)
        if self._figure.canvas.manager is not None:
            self._figure.canvas.manager.set_window_title(f"RoleTrust {scenario.name}")
        self._figure.show()
        self._picture: Picture | None = None

    def draw(self, scene: Scene, curves: Curves) -> None:
        """Draw a frame, unless the user has closed the window."""
        if not self._plt.fignum_exists(self._figure.number):
            return
        if self._picture is None or not self._picture.can_show(scene):
            self._picture = Picture(self._figure, self._scenario, scene)
        self._picture.update(scene, curves)
        self._figure.canvas.draw_idle()
        self._figure.canvas.flush_events()

    def frame(self) -> None:
        """Return None: the frame is only in the window."""

    def close(self) -> None:
        """Close the window."""
        self._plt.close(self._figure)


class Picture:
    """Picture of a game: header, ratings on the left, curves on the right.

    Args:
        figure: Figure to draw in; it is cleared first.
        scenario: Scenario of the game.
        scene: Any scene of the game, with the agents and the attackers, which are drawn once.
    """

    def __init__(self, figure: Figure, scenario: Scenario, scene: Scene) -> None:
        self._attackers = _attackers(scene)
        figure.clear()
        figure.set_facecolor("white")
        with matplotlib.rc_context(STYLE):
            figure.text(0.025, 0.945, scene.title, fontsize=17, weight="bold")
            self._clock = figure.text(0.025, 0.908, "", fontsize=11, color=GREY)
            self._perturbed = figure.text(0.595, 0.93, "", fontsize=10, ha="right", va="center", color="white")
            self._perturbed.set_bbox({"boxstyle": "round,pad=0.45", "facecolor": INK, "edgecolor": "none"})
            _scale_bar(figure.add_axes((0.2, 0.043, 0.2, 0.013)))
            left = figure.add_axes((0.02, 0.1, 0.58, 0.74))
            large = max(scene.ratings.shape) > _GRAPH_LIMIT
            self._ratings: Panel = Matrix(left, scene) if large else Graph(left, scene)
            self._tor = TrustCurves(
                figure.add_axes((0.655, 0.555, 0.325, 0.33)), "Trust of raters, ToR", scenario, scene.raters
            )
            self._top = TrustCurves(
                figure.add_axes((0.655, 0.085, 0.325, 0.33)), "Trust of providers, ToP", scenario, scene.providers
            )
        self.moving = [self._clock, self._perturbed, *self._ratings.moving, *self._tor.moving, *self._top.moving]
        for z, artist in enumerate(self.moving, start=10):
            artist.set_zorder(z)  # a window draws in this order, and should look like a frame

    def can_show(self, scene: Scene) -> bool:
        """Return whether this picture can show the scene: the attackers, which are drawn once, must be the same."""
        return self._attackers == _attackers(scene)

    def update(self, scene: Scene, curves: Curves) -> None:
        """Show a scene and the curves up to it."""
        self._clock.set_text(scene.clock)
        self._perturbed.set_text(f"perturbation {scene.perturbation:.0%}")
        self._perturbed.set_visible(scene.perturbation > 0)
        self._ratings.update(scene)
        self._tor.update(np.stack([tor for tor, _ in curves]), scene.raters)
        self._top.update(np.stack([top for _, top in curves]), scene.providers)


def _scale_bar(axes: Axes) -> None:
    axes.imshow(np.linspace(0, 1, 256)[None], SCALE, aspect="auto", extent=(0, 1, 0, 1))
    axes.set(yticks=[], xticks=[0, 0.5, 1])
    axes.tick_params(length=0, labelsize=8, pad=2)
    for spine in axes.spines.values():
        spine.set_visible(False)
    axes.text(-0.03, 0.5, "trust and ratings", ha="right", va="center", color=GREY, fontsize=9)


def _attackers(scene: Scene) -> list[bool]:
    return [*scene.raters.attacker.tolist(), *scene.providers.attacker.tolist()]
