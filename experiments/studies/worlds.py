"""Which worlds decide: the order of models in worlds that differ from one world in a single thing.

The things are the number of agents, the rounds of a game, the share of ratings that arrive, the
noise of raters, and the share of attackers. Worst cases are those of the benchmark, without
searches, so that the same attackers play in all worlds. Some ten minutes of a core.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from statistics import fmean, mode
from typing import NamedTuple, Self

from matplotlib.figure import Figure

from roletrust_env import Scenario
from roletrust_env.benchmarking import benchmark
from roletrust_env.benchmarking.leaderboard import LeaderboardRow, leaderboard_rows
from roletrust_env.storage.markdown import markdown_table
from roletrust_experiments.plots.charts import Panel, Series, panels_figure
from roletrust_experiments.plots.style import INK
from studies.condition import suite_of
from studies.study import Recipe, Study, plus_minus


class Options(NamedTuple):
    """Worlds and models.

    Attributes:
        suite: Suite with the worlds, the tracks and the attackers.
        model: Specs of trust models, those of the suite if left out.
    """

    suite: str = "worlds"
    model: tuple[str, ...] = ()


RECIPES = {
    "worlds": Recipe(Options(), {name: name for name in ("worlds.md", "worlds.png", "worlds.csv")})
}


class World(NamedTuple):
    """What tells worlds apart.

    Attributes:
        agents: Number of raters and providers.
        rounds: Rounds of a game.
        arriving: Share of the ratings that arrive.
        noise: Standard deviation of a perceived quality.
        attackers: Share of compromised agents in each role of a track.
    """

    agents: int
    rounds: int
    arriving: float
    noise: float
    attackers: float

    @classmethod
    def of(cls, scenario: Scenario, share: float) -> Self:
        """Return the world of a scenario with a share of attackers."""
        agents, noise = (
            sum(group.count for group in scenario.agents),
            max(group.noise for group in scenario.agents),
        )
        return cls(agents, scenario.max_cycles, round(1 - scenario.ratings.lost, 6), noise, share)

    def beside(self, centre: "World") -> str:
        """Return what tells the world from the one in the centre, in a few words."""
        pairs = zip(self._fields, self, centre, strict=True)
        return (
            ", ".join(f"{name} {value:g}" for name, value, usual in pairs if value != usual)
            or "centre"
        )


Found = Mapping[World, Sequence[LeaderboardRow]]
"""Leaderboard of each world."""


def main(study: Study[Options]) -> None:
    """Play all worlds, and write the page."""
    suite = suite_of(study.options.suite)
    models = study.options.model or tuple(suite.model_names)
    workers = study.workers if study.workers > 1 else 0
    played = benchmark(models, suite, workers=workers, out=study.out, force=study.again)
    worlds = {
        (name, share): World.of(suite.worlds[name], share) for name, _, share in suite.conditions
    }
    boards: dict[World, list[LeaderboardRow]] = {}
    for world in sorted({*worlds.values()}):
        cells = [
            cell for cell in played.cells if worlds[cell.cell.scenario, cell.cell.share] == world
        ]
        attacks = [
            scored
            for scored in played.attacks
            if worlds[scored.condition.scenario, scored.condition.share] == world
        ]
        boards[world] = leaderboard_rows(suite, cells, models, len(cells) // len(models), attacks)
    centre = World(*(mode(values) for values in zip(*boards, strict=True)))
    rows = [
        (*world, row.model, *row.worst[:2], row.tier)
        for world, board in boards.items()
        for row in board
    ]
    study.csv("worlds.csv", (*World._fields, "model", "skill", "skill_half", "tier"), rows)
    note = f"{suite.games} games for each value; 95% intervals; a ring: told apart from all others"
    study.figure("worlds.png", worlds_figure(boards, centre, models, note))
    lines = []
    for world in sorted(
        boards, key=lambda candidate: (candidate != centre, candidate.beside(centre))
    ):
        skill = {row.model: plus_minus(row.worst) for row in boards[world]}
        lines.append(
            [
                world.beside(centre),
                *(skill[name] for name in models),
                ", ".join(first(boards[world])),
            ]
        )
    lines.append(["mean", *(f"{mean_skill(boards)[name]:.3f}" for name in models), ""])
    study.page(
        "worlds.md",
        "# Which worlds decide?",
        "![Worst-case skill of models in worlds that differ from one world in a single "
        "thing](worlds.png)",
        sentence(boards, centre),
        f"The centre has {centre.agents} agents, {centre.rounds} rounds, {centre.arriving:.0%} of "
        "the ratings "
        f"arriving, a noise of {centre.noise:g} in what raters perceive, and "
        f"{centre.attackers:.0%} attackers in "
        "each role of a track. Each other world differs from it in one thing. Skill is 1 for the "
        "best choice and 0 "
        "for a blind one. Shown is the mean of the worst cases on the tracks "
        f"{' and '.join(suite.tracks)}, each "
        f"chosen in {suite.games} games and measured in {suite.games} others, with 95% intervals. "
        "A ring marks a "
        "model that is alone in the first [tier](how/headline.md#tiers) of its world. Attackers "
        "are scripts and "
        "universal coalitions. None was searched in these worlds, so there may be worse ones; and "
        "more games may "
        "tell apart what these do not.",
        markdown_table(["world", *(f"`{name}`" for name in models), "first tier"], lines, 1),
        f"[worlds.csv](worlds.csv) has all numbers. Made by `{study.command}`.",
    )


def first(board: Sequence[LeaderboardRow]) -> list[str]:
    """Return the first tier: the best model, and those that are not told apart from it."""
    return [row.model for row in board if row.tier == 1]


def sentence(boards: Found, centre: World) -> str:
    """Return in how many worlds the model with the highest mean leads, is not told apart from
    others, or is behind.
    """
    means, best = mean_skill(boards), Counter(board[0].model for board in boards.values())
    leader, *others = sorted(means, key=lambda name: -means[name])
    leads = sum(first(board) == [leader] for board in boards.values())
    behind = {
        world.beside(centre): first(board)
        for world, board in boards.items()
        if leader not in first(board)
    }
    where = "; ".join(
        f"{world}: {', '.join(f'`{name}`' for name in names)}" for world, names in behind.items()
    )
    next_to = "".join(f", and `{name}` the next, {means[name]:.3f}" for name in others[:1])
    return (
        f"Over {len(boards)} worlds `{leader}` has the highest mean, {means[leader]:.3f}{next_to}. "
        "It leads all others "
        f"in {leads} of them, is not told apart from some in {len(boards) - leads - len(behind)}, "
        "and is behind in "
        f"{len(behind)}{f' ({where})' * bool(where)}. The highest of a world is "
        f"{', '.join(f'`{name}` in {number}' for name, number in best.most_common())}. So "
        f"{f'`{leader}`' if leads == len(boards) else 'no model'} may be named the leader of all."
    )


def mean_skill(boards: Found) -> dict[str, float]:
    """Return the mean of each model over the worlds."""
    models = [row.model for row in next(iter(boards.values()))]
    return {
        name: fmean(
            row.worst.mean for board in boards.values() for row in board if row.model == name
        )
        for name in models
    }


def worlds_figure(boards: Found, centre: World, models: Sequence[str], note: str) -> Figure:
    """Return a panel for each thing that is changed, and a ring around each model that is alone in
    the first tier.
    """
    panels, rings = [], []
    for name in World._fields:
        worlds = [
            candidate
            for candidate in boards
            if candidate._replace(**{name: getattr(centre, name)}) == centre
        ]
        at = [float(getattr(candidate, name)) for candidate in worlds]
        skill = [
            {row.model: row.worst.interval for row in boards[candidate]} for candidate in worlds
        ]
        series = [Series(model, at, [candidate[model] for candidate in skill]) for model in models]
        panels.append(Panel(name, "", "worst-case skill", series, "log"))
        rings.append(
            [
                (x, boards[candidate][0].worst.mean)
                for x, candidate in zip(at, worlds, strict=True)
                if len(first(boards[candidate])) == 1
            ]
        )
    figure = panels_figure("Which worlds decide?", panels, note, columns=3)
    limits = [end for axes in figure.axes[: len(panels)] for end in axes.get_ylim()]
    for axes, ringed in zip(figure.axes, rings, strict=False):
        axes.set_ylim(min(limits), max(limits))
        for x, y in ringed:
            axes.plot(
                x, y, "o", markersize=13, markerfacecolor="none", markeredgecolor=INK, zorder=4
            )
    return figure
