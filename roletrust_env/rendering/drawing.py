"""A game as a picture: its parts, and their layout."""

from collections.abc import Sequence
from typing import Any

import matplotlib
import numpy as np
import numpy.typing as npt
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.colors import ListedColormap, to_rgba
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from roletrust_env.rendering.scene import Curves, Floats, Scene, Side
from roletrust_env.world.scenario import Scenario

SIZE, DPI = (12.8, 7.2), 100

# Perceptually uniform and safe for colour-blind readers; its brightest end is left out, which would
# vanish on white.
SCALE = ListedColormap(matplotlib.colormaps["viridis"](np.linspace(0, 0.93, 256))).with_extremes(
    bad="#eef1f5"
)

INK, GREY, PALE = "#1b2430", "#7b8794", "#eef1f5"

ATTACK = "#d55e00"  # vermilion, which is not on the scale

HONEST = (
    "#0072b2",
    "#009e73",
    "#56b4e9",
    "#332288",
)  # distinguishable for colour-blind readers, too

CROWD = "#9fb3c8"

KEYS = ("each honest agent", "their mean", "attackers")

# A few curves stay visible even where they coincide: those of attackers are the widest and lie
# under the honest ones, and within each group every further curve is narrower, dashed, and lies on
# top.
ATTACKS = (ATTACK, "#cc79a7", "#e69f00", "#8c510a")

DASHES: tuple[tuple[float, Sequence[float]], ...] = (
    (0, ()),
    (0, (4, 2.5)),
    (0, (1.2, 1.8)),
    (0, (6, 2, 1.2, 2)),
)

WIDTHS = np.asarray((2.8, 2.0, 1.6, 1.3))

STYLE: dict[Any, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 10,
    "text.color": INK,
    "axes.edgecolor": "#c3cad3",
    "axes.labelcolor": GREY,
    "xtick.color": GREY,
    "ytick.color": GREY,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "text.parse_math": False,
    "toolbar": "None",
}

_MAX_NUMBERED = 16  # largest number of edges with a number each

_MAX_COLOURED = 4  # largest number of curves with a colour each


class Graph:
    """Graph with raters on the left, providers on the right and ratings as edges.

    An SR+SP agent is on both sides, with a shaded row between its two nodes.

    Attributes:
        moving: Artists that change, in the order in which they are drawn.
    """

    def __init__(self, axes: Axes, scene: Scene) -> None:
        axes.set(xlim=(0, 1), ylim=(0, 1))
        axes.axis("off")
        both = len(set(scene.raters.names) & set(scene.providers.names))
        rows = max(scene.ratings.shape)
        height = axes.bbox.height / rows
        left = np.stack(
            [np.full(len(scene.raters.names), 0.235), _rows(len(scene.raters.names), both, rows)],
            -1,
        )
        right = np.stack(
            [
                np.full(len(scene.providers.names), 0.74),
                _rows(len(scene.providers.names), both, rows),
            ],
            -1,
        )
        for y in left[len(left) - both :, 1]:
            axes.plot(
                (0.03, 0.97), (y, y), color=PALE, lw=0.55 * height, solid_capstyle="round", zorder=0
            )
        axes.text(0.235, 1.02, "raters", ha="center", color=GREY)
        axes.text(0.725, 1.02, "providers", ha="center", color=GREY)

        self._paths = np.stack(np.broadcast_arrays(left[:, None], right[None]), -2)
        self._suspect = scene.raters.attacker[:, None] | scene.providers.attacker
        self._width = float(np.clip(12 / rows, 0.8, 4))
        self._edges = LineCollection([], capstyle="round")
        axes.add_collection(self._edges, autolim=False)
        self._numbers = []
        if scene.ratings.size <= _MAX_NUMBERED:
            pad = {
                "boxstyle": "round,pad=0.15",
                "facecolor": "white",
                "edgecolor": "none",
                "alpha": 0.85,
            }
            for x, y in (self._paths[..., 0, :] * 0.79 + self._paths[..., 1, :] * 0.21).reshape(
                -1, 2
            ):
                self._numbers.append(
                    axes.text(x, y, "", fontsize=8.5, ha="center", va="center", bbox=pad)
                )
        self._sides = (
            _Nodes(axes, left, scene.raters, height, both, "right"),
            _Nodes(axes, right, scene.providers, height, both, "left"),
        )
        self.moving: list[Artist] = [self._edges, *self._numbers]
        for side in self._sides:
            self.moving += side.moving

    def update(self, scene: Scene) -> None:
        """Show the ratings of a scene as edges."""
        given = ~np.isnan(scene.ratings)
        # The edges of attackers are drawn last, on top.
        order = np.argsort(self._suspect[given], kind="stable")
        ratings = scene.ratings[given][order]
        colours = SCALE(ratings)
        colours[:, 3] = np.where(self._suspect[given][order], 1.0, 0.75)
        self._edges.set_segments(list(self._paths[given][order]))
        self._edges.set_color(list(map(tuple, colours)))
        self._edges.set_linewidth(list(self._width * (0.45 + 0.55 * ratings)))
        for number, rating in zip(self._numbers, scene.ratings.ravel(), strict=False):
            number.set_text("" if np.isnan(rating) else f"{rating:.2f}")
        self._sides[0].update(scene.raters)
        self._sides[1].update(scene.providers)


class _Nodes:
    """One side of the graph: a node for each agent with its trust, and its name and caption on the
    outside.
    """

    def __init__(
        self, axes: Axes, places: Floats, side: Side, height: float, both: int, align: str
    ) -> None:
        diameter = float(np.clip(0.8 * height, 12, 52)) * 72 / axes.figure.dpi
        outside = (
            (-1 if align == "right" else 1)
            * (0.75 * diameter * axes.figure.dpi / 72 + 8)
            / axes.bbox.width
        )
        n = len(places)
        x, y = places.T
        self._own = axes.scatter(x[: n - both], y[: n - both], diameter**2, marker="o")
        self._shared = axes.scatter(x[n - both :], y[n - both :], 1.15 * diameter**2, marker="h")
        rings: dict[str, Any] = {
            "s": (1.3 * diameter) ** 2,
            "facecolor": "none",
            "edgecolor": ATTACK,
            "lw": max(1.5, diameter / 14),
        }
        self._rings = axes.scatter(x[side.attacker], y[side.attacker], **rings)
        small = float(np.clip(diameter / 3.3, 5, 10.5))
        size = float(np.clip(height / 4, 7, 10.5))
        gap = min(0.0135, 0.2 * height / axes.bbox.height)
        self._trust = [
            axes.text(x, y, "", fontsize=small, ha="center", va="center_baseline")
            for x, y in places
        ]
        self._names = [
            axes.text(x + outside, y, name, fontsize=size, ha=align, va="center", weight="bold")
            for (x, y), name in zip(places, side.names, strict=True)
        ]
        self._captions = [
            axes.text(x + outside, y - 1.4 * gap, "", fontsize=0.85 * size, ha=align, va="center")
            for x, y in places
        ]
        self._split, self._middle, self._gap = n - both, places[:, 1], gap
        self.moving: list[Artist] = [
            self._rings,
            self._own,
            self._shared,
            *self._trust,
            *self._names,
            *self._captions,
        ]

    def update(self, side: Side) -> None:
        """Show one side of a scene."""
        absent = np.asarray([bool(absence) for absence in side.absences])
        faces = SCALE(side.trust)
        inks = np.where(faces[:, :3] @ (0.299, 0.587, 0.114) > 0.5, INK, "white")
        faces[absent] = to_rgba("white")
        rims = np.where(absent[:, None], to_rgba(GREY), faces)
        dashes: list[tuple[float, Sequence[float]]] = [
            (0, (2, 2) if missing else ()) for missing in absent
        ]
        for nodes, part in (
            (self._own, slice(self._split)),
            (self._shared, slice(self._split, None)),
        ):
            nodes.set_facecolor(list(map(tuple, faces[part])))
            nodes.set_edgecolor(list(map(tuple, rims[part])))
            nodes.set_linestyle(dashes[part])
        for k, absence in enumerate(side.absences):
            self._trust[k].set_text({"": f"{side.trust[k]:.2f}", "cut off": "x"}.get(absence, ""))
            self._trust[k].set_color(GREY if absence else inks[k])
            self._names[k].set_color(GREY if absence else ATTACK if side.attacker[k] else INK)
            self._names[k].set_y(self._middle[k] + (self._gap if side.captions[k] else 0))
            self._captions[k].set_text(side.captions[k])
            self._captions[k].set_color(ATTACK if side.attacker[k] else GREY)


class Matrix:
    """Matrix with raters as rows, providers as columns and ratings as cells.

    The trust of an agent is at the start of its row or column.
    """

    def __init__(self, axes: Axes, scene: Scene) -> None:
        s, p = scene.ratings.shape
        axes.axis("off")
        grid = axes.inset_axes((0.2, 0.0, 0.74, 0.86))
        rows = axes.inset_axes((0.155, 0.0, 0.03, 0.86))
        columns = axes.inset_axes((0.2, 0.885, 0.74, 0.04))
        self._images = []
        for part, shape in ((grid, (s, p)), (rows, (s, 1)), (columns, (1, p))):
            part.axis("off")
            self._images.append(part.imshow(np.zeros(shape), SCALE, vmin=0, vmax=1, aspect="auto"))
        rows.text(
            0.5,
            1.05,
            "ToR",
            transform=rows.transAxes,
            ha="center",
            va="center",
            color=GREY,
            fontsize=9,
        )
        columns.text(
            1.012, 0.5, "ToP", transform=columns.transAxes, va="center", color=GREY, fontsize=9
        )
        axes.text(0.57, -0.015, f"{p} providers", ha="center", va="top", color=GREY)
        axes.text(0.17, -0.015, f"{s} raters", ha="center", va="top", color=GREY)
        mark: dict[str, Any] = {
            "color": ATTACK,
            "ms": 5,
            "clip_on": False,
            "ls": "none",
            "mec": "none",
        }
        words: dict[str, Any] = {"color": ATTACK, "fontsize": 8, "weight": "bold"}
        at = np.flatnonzero(scene.raters.attacker)
        rows.plot(np.full(at.shape, -0.75), at, marker=">", **mark)
        for k, name in _labels(scene.raters):
            rows.text(-1.0, k, name, ha="right", va="center", **words)
        at = np.flatnonzero(scene.providers.attacker)
        columns.plot(at, np.full(at.shape, -0.75), marker="v", **mark)
        for k, name in _labels(scene.providers):
            columns.text(
                k, -1.1, name, ha="left", va="bottom", rotation=35, rotation_mode="anchor", **words
            )
        self.moving: list[Artist] = list(self._images)

    def update(self, scene: Scene) -> None:
        """Show the ratings of a scene as cells."""
        parts = (
            scene.ratings,
            _trust_of_present(scene.raters)[:, None],
            _trust_of_present(scene.providers)[None],
        )
        for image, values in zip(self._images, parts, strict=True):
            image.set_data(np.ma.masked_invalid(values))


class TrustCurves:
    """Trust of the raters or of the providers over time.

    A few agents have a colour each. With many agents, the mean of the honest ones is drawn as well.
    """

    def __init__(self, axes: Axes, title: str, scenario: Scenario, side: Side) -> None:
        self._period = scenario.period_s
        self._open = any(group.open for group in scenario.agents)
        xlabel = "time (s); grey: perturbation" if scenario.perturbations else "time (s)"
        axes.set(
            xlim=(0, scenario.max_cycles * scenario.period_s), ylim=(-0.02, 1.02), xlabel=xlabel
        )
        axes.set_yticks(np.linspace(0, 1, 6))
        axes.grid(axis="y", color=PALE)
        axes.set_axisbelow(True)
        axes.set_title(title, loc="left", fontsize=11, weight="bold", pad=22)
        for perturbation in scenario.perturbations:
            span = perturbation.start * scenario.period_s, perturbation.stop * scenario.period_s
            axes.axvspan(*span, color=GREY, alpha=0.25 * perturbation.strength, lw=0, zorder=0)
        n = len(side.names)
        few = n <= _MAX_COLOURED
        self._order = np.argsort(
            ~side.attacker if few else side.attacker, kind="stable"
        )  # many: attackers on top
        self._honest = ~side.attacker
        if few:
            ranks = np.where(side.attacker, np.cumsum(side.attacker), np.cumsum(self._honest)) - 1
            colours = [
                (ATTACKS if bad else HONEST)[k] for bad, k in zip(side.attacker, ranks, strict=True)
            ]
            widths = WIDTHS[ranks] + 1.6 * side.attacker
            dashes = [DASHES[k] for k in ranks]
        else:
            colours = [
                ATTACK if bad else f"{CROWD}c0" for bad in side.attacker
            ]  # c0: a little transparent
            widths = np.where(side.attacker, 2.2 if n <= 20 else 1.2, 0.6)
            dashes = [DASHES[0]] * n
        self._lines = LineCollection(
            [],
            colors=[colours[k] for k in self._order],
            linewidths=widths[self._order].tolist(),
            linestyles=[dashes[k] for k in self._order],
            capstyle="butt" if few else "round",
            joinstyle="round",
        )
        axes.add_collection(self._lines, autolim=False)
        (self._mean,) = axes.plot([], [], color=HONEST[0], lw=2.2)
        self._mean.set_visible(not few and bool(self._honest.any()))
        keys = [
            (name, c, 2.5, DASHES[0])
            for name, c in zip(KEYS, (CROWD, HONEST[0], ATTACK), strict=True)
        ]
        if few:
            labels = [
                f"{name}, attacker" if attacks else name
                for name, attacks in zip(side.names, side.attacker, strict=True)
            ]
            keys = list(zip(labels, colours, widths, dashes, strict=True))
        elif self._honest.all():
            keys.pop()
        axes.legend(
            handles=[
                Line2D([], [], color=c, lw=lw, ls=ls, label=label) for label, c, lw, ls in keys
            ],
            loc="lower left",
            bbox_to_anchor=(-0.02, 0.985),
            ncols=len(keys),
            frameon=False,
            fontsize=9,
            handlelength=2.2 if few else 1.2,
            columnspacing=1.2,
        )
        self.moving: list[Artist] = [self._lines, self._mean]

    def update(self, curves: Floats, side: Side) -> None:
        """Show the curves up to now, shape (rounds, K)."""
        time = self._period * np.arange(len(curves))
        if self._open or any(side.absences):
            curves = _mask_absence(curves, side, self._open)
        points = np.stack(np.broadcast_arrays(time[:, None], curves), -1)
        self._lines.set_segments(list(points[:, self._order].swapaxes(0, 1)))
        if self._mean.get_visible():
            honest = np.ma.masked_invalid(curves[:, self._honest])
            self._mean.set_data(time, honest.mean(axis=1).filled(np.nan))


def _mask_absence(curves: Floats, side: Side, newcomers: bool) -> Floats:
    """Return the curves with NaN where the trust is constant because the agent is absent.

    Args:
        curves: Curves, one column for each agent.
        side: Agents. The curve of an absent agent ends at its last change.
        newcomers: Whether agents can join late. If so, curves begin at their first change.
    """
    curves = curves.copy()
    for k, absence in enumerate(side.absences):
        changes = np.flatnonzero(np.diff(curves[:, k]))
        first, last = (changes[0], changes[-1] + 1) if changes.size else (len(curves), len(curves))
        if newcomers:
            curves[:first, k] = np.nan
        if absence:
            curves[last + 1 :, k] = np.nan
    return curves


def _trust_of_present(side: Side) -> Floats:
    """Return the trust of the agents, NaN for those that are absent."""
    return np.where([not absence for absence in side.absences], side.trust, np.nan)


def _rows(n: int, both: int, rows: int) -> Floats:
    """Return the heights of n nodes. The last ones, SR+SP agents, have the lowest rows, the same on
    both sides.
    """
    own = n - both
    top = 1 - both / rows  # share of the height for the other agents
    return np.concatenate(
        [1 - top * (np.arange(own) + 0.5) / max(own, 1), (both - np.arange(both) - 0.5) / rows]
    )


def _labels(side: Side) -> list[tuple[float, str]]:
    """Return positions and texts of the labels of attackers.

    Neighbours share a label, and a label too close to the previous one is left out.
    """
    at = np.flatnonzero(side.attacker)
    runs = np.split(at, np.flatnonzero(np.diff(at) > 1) + 1) if at.size else []
    labels: list[tuple[float, str]] = []
    for run in runs:
        first, last = side.names[run[0]], side.names[run[-1]]
        if not labels or run.mean() - labels[-1][0] > len(side.names) / 35:
            labels.append((float(run.mean()), first if len(run) == 1 else f"{first} … {last}"))
    return labels


_WINDOWLESS = frozenset(
    ("agg", "cairo", "inline", "pdf", "pgf", "ps", "svg", "template")
)  # backends of matplotlib
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
            self._perturbed = figure.text(
                0.595, 0.93, "", fontsize=10, ha="right", va="center", color="white"
            )
            self._perturbed.set_bbox(
                {"boxstyle": "round,pad=0.45", "facecolor": INK, "edgecolor": "none"}
            )
            _scale_bar(figure.add_axes((0.2, 0.043, 0.2, 0.013)))
            left = figure.add_axes((0.02, 0.1, 0.58, 0.74))
            large = max(scene.ratings.shape) > _GRAPH_LIMIT
            self._ratings: Matrix | Graph = Matrix(left, scene) if large else Graph(left, scene)
            self._tor = TrustCurves(
                figure.add_axes((0.655, 0.555, 0.325, 0.33)),
                "Trust of raters, ToR",
                scenario,
                scene.raters,
            )
            self._top = TrustCurves(
                figure.add_axes((0.655, 0.085, 0.325, 0.33)),
                "Trust of providers, ToP",
                scenario,
                scene.providers,
            )
        self.moving = [
            self._clock,
            self._perturbed,
            *self._ratings.moving,
            *self._tor.moving,
            *self._top.moving,
        ]
        for z, artist in enumerate(self.moving, start=10):
            artist.set_zorder(z)  # a window draws in this order, and should look like a frame

    def can_show(self, scene: Scene) -> bool:
        """Return whether this picture can show the scene: the attackers, which are drawn once, must
        be the same.
        """
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
