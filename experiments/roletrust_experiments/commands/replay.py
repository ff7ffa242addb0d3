"""`roletrust replay`: an attack of a benchmark once more, as a table, a figure and a video."""

from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.markup import escape

from roletrust_env.benchmarking.leaderboard import Leaderboard
from roletrust_env.benchmarking.suite import Cell, Rule
from roletrust_env.errors import suggest
from roletrust_env.evaluation.agreed import check_recorded
from roletrust_env.evaluation.attackers import Attacker, read_record
from roletrust_env.evaluation.specs import check_installed
from roletrust_env.metrics.score import mean_or_nan
from roletrust_env.storage.files import prepare_folder
from roletrust_env.trust.model import registry as trust_models
from roletrust_experiments.commands.console import (
    ALLOW_CODE,
    console,
    number_table,
    progress_bar,
    tell,
)
from roletrust_experiments.commands.extras import require
from roletrust_experiments.commands.leaderboard import read_board
from roletrust_experiments.commands.options import NAMED, Out
from roletrust_experiments.playing.replay import Replay
from roletrust_experiments.plots.figure_files import write_figure

TOLERANCE = 1e-6
"""Difference of skill up to which a replay agrees with the file."""


def replay(
    results: Annotated[
        Path, typer.Argument(help="Results of `roletrust benchmark`, a file results.sqlite.")
    ] = Path("results/benchmark/results.sqlite"),
    model: Annotated[
        str | None,
        typer.Option(metavar=NAMED, help="Trust model; by default the first one of the table."),
    ] = None,
    rule: Annotated[Rule, typer.Option(help="Choice rule of the consumers.")] = "common",
    setting: Annotated[
        str | None,
        typer.Option(
            metavar="NAME", help="Setting of the suite; by default the one with the lowest skill."
        ),
    ] = None,
    world: Annotated[
        int | None,
        typer.Option(
            min=0, help="Number of a measured world; by default the one with the lowest skill."
        ),
    ] = None,
    video: Annotated[
        bool,
        typer.Option(
            "--video", help="Also save a video of the game with the lowest quality, game.mp4."
        ),
    ] = False,
    allow_code: Annotated[bool, typer.Option("--allow-code", help=ALLOW_CODE)] = False,
    out: Out = Path("results/replay"),
) -> None:
    """Play [bold]the worst attack on a trust model[/] again in one world, and show what it does.

    The games are those that measured the attack in this world, and the same ones while all agents
    are honest. A warning follows if the skill score differs from that of the file.

    Written: [green]replay.png[/], the quality that consumers receive, the share of services from
    compromised providers, and the trust in both sides, round by round; and with --video
    [green]game.mp4[/] and its last round, [green]game.png[/]. In the video, the compromised agents
    are marked.

    [bold]Examples[/]

    [dim]# the worst attack on a trust model, with a video[/]
    [cyan]roletrust replay results/quick/results.sqlite --model role-trust --video[/]

    [dim]# in another setting, with the choice rule of the model[/]
    [cyan]roletrust replay results/quick/results.sqlite --model block --rule own --setting raters[/]
    """
    require("a replay", "train", "scipy", "cma")  # as the benchmark whose suite it reads
    if video:
        require("--video", "video", "imageio", "imageio_ffmpeg")
    board = read_board(results)
    cell, attack = _choose(board, results, model, rule, setting, allow_code)
    case = board.worst_cases[cell[:3]]
    skills = case.scores["skill"]
    if world is None:
        world = int(np.nanargmin(skills))
    elif world >= len(skills):
        raise ValueError(f"world must be in [0, {len(skills) - 1}], got {world}")
    prepare_folder(out)
    with console.status("Playing"):
        replayed = Replay.of(board.suite, cell, attack, world)
    attacked, honest = replayed.attacked, replayed.honest
    title = f"{cell.model} ({rule} rule), {cell.setting}, world {world}: {case.attack}"
    table = number_table(escape(title), escape(case.words), "attack", "all agents honest")
    table.add_row("skill score", f"{attacked.skill:.3f}", f"{honest.skill:.3f}")
    table.add_row("skill score, mean over all worlds", f"{case.skill:.3f}", "")
    table.add_row(
        "quality received", *(f"{course.received.mean():.3f}" for course in (attacked, honest))
    )
    table.add_row(
        "services from compromised providers",
        *(f"{mean_or_nan(course.from_attacker.ravel(), 0):.0%}" for course in (attacked, honest)),
    )
    for side, same in zip(attacked.sides, honest.sides, strict=True):
        means = (f"{np.nanmean(course.trust):.3f}" for course in (side, same))
        table.add_row(f"trust in {side.label}", *means)
    console.print(table)
    if not abs(attacked.skill - skills[world]) <= TOLERANCE:
        tell(
            f"The skill score in world {world} is {attacked.skill:.6f}, but the file has "
            f"{skills[world]:.6f}. Possible causes: another version of the software, another "
            "processor, or a changed file.",
            "yellow",
        )
    from roletrust_experiments.plots.replay import replay_figure

    write_figure(out / "replay.png", replay_figure(title, replayed))
    written = ["replay.png"]
    if video:
        from roletrust_experiments.plots.video import write_video_of_states

        task, game = replayed.task, int(attacked.received.mean(axis=0).argmin())
        with progress_bar() as progress:
            write_video_of_states(
                out / "game.mp4", task.game, replayed.states(game), task.identities, progress
            )
        written += ["game.mp4", "game.png"]
    tell(f"Written to {out}: {', '.join(written)}")


def _choose(
    board: Leaderboard,
    path: Path,
    model: str | None,
    rule: Rule,
    setting: str | None,
    allow_code: bool,
) -> tuple[Cell, Attacker]:
    """Return the cell of the options and its worst attack.

    Raises:
        ValueError: The run has no such model or setting, or a model or an attack is not installed.
    """
    rows = {row.model: row for row in board.rows if row.rule == rule and row.worst_setting}
    if not rows:
        raise ValueError(f"{path} has no attack that was played with the {rule} rule")
    model = model or next(iter(rows))
    if model not in rows:
        raise ValueError(
            f"{path} has no attack on {model!r} with the {rule} rule{suggest(model, rows)}"
        )
    settings = [
        name
        for name, each in board.suite.settings.items()
        if each.roles and (model, rule, name) in board.worst_cases
    ]
    setting = setting or rows[model].worst_setting
    if setting not in settings:
        raise ValueError(
            f"{path} has no attack in the setting {setting!r}{suggest(setting, settings)}"
        )
    case = board.worst_cases[model, rule, setting]
    if not allow_code:
        check_installed(trust_models, [model])
        check_recorded([case.record])
    attack = read_record(case.record)
    method = next(name for name in board.suite.methods if name == case.method)
    return Cell(model, rule, setting, method), attack
