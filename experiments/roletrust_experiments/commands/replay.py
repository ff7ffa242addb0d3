"""`roletrust replay`: an attack of a benchmark once more, as a table, a figure and a video."""

from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.markup import escape

from roletrust_env.benchmarking.leaderboard import Leaderboard
from roletrust_env.benchmarking.schema import AttackResult
from roletrust_env.benchmarking.suite import Cell, Suite
from roletrust_env.benchmarking.verification import check_installed_names
from roletrust_env.benchmarking.worst_case import as_array, attack_scores, least_mean, worst_cases
from roletrust_env.errors import suggest
from roletrust_env.metrics.confidence import estimate
from roletrust_env.storage.files import prepare_folder
from roletrust_experiments.commands.console import (
    ALLOW_CODE,
    console,
    number_table,
    progress_bar,
    tell,
)
from roletrust_experiments.commands.extras import require
from roletrust_experiments.commands.leaderboard import read_run
from roletrust_experiments.commands.options import NAMED, Out
from roletrust_experiments.playing.replay import Replay
from roletrust_experiments.plots.figure_files import write_figure


def replay(
    results: Annotated[
        Path, typer.Argument(help="Results of `roletrust benchmark`, a file results.sqlite.")
    ] = Path("results/benchmark/results.sqlite"),
    model: Annotated[
        str | None,
        typer.Option(
            metavar=NAMED, help="Trust model whose worst case is played, the best one if left out."
        ),
    ] = None,
    cell: Annotated[
        str | None,
        typer.Option(
            metavar="KEY",
            help="Cell whose worst attack is played: model, scenario, track, share, method and seed, joined by |.",  # noqa: E501
        ),
    ] = None,
    attack: Annotated[
        str | None,
        typer.Option(metavar=NAMED, help="Attack of this cell, in place of the worst one."),
    ] = None,
    video: Annotated[
        bool,
        typer.Option(
            "--video", help="Also save a video of the game with the least utility, game.mp4."
        ),
    ] = False,
    allow_code: Annotated[bool, typer.Option("--allow-code", help=ALLOW_CODE)] = False,
    out: Out = Path("results/replay"),
) -> None:
    """Play [bold]an attack of a benchmark[/] again, and show what it does.

    The games are those that measured the attack, and the same ones with everybody honest. What a
    search has found is in the file, except for networks of Stable-Baselines3 and for plans: there
    the search runs again, with its seed and budget, and takes as long as in the benchmark.

    Written: [green]replay.png[/], the utility of consumers and the trust of both sides, round by
    round; and with --video [green]game.mp4[/] and its last round, [green]game.png[/]. In the video,
    the attacker's agents are marked.

    [bold]Examples[/]

    [dim]# the worst that happened to a trust model, with a video[/]
    [cyan]roletrust replay results/quick/results.sqlite --model role-trust --video[/]

    [dim]# one attack in one condition[/]
    [cyan]roletrust replay results/quick/results.sqlite --cell 'beta|market|raters|0.3|scripted|0'
    --attack rank-lies[/]
    """
    require("a replay", "train", "scipy", "cma")  # as the benchmark whose suite it reads
    if video:
        require("--video", "video", "imageio", "imageio_ffmpeg")
    if cell and model:
        raise ValueError("give --cell or --model; the cell names its trust model")
    if attack and not cell:
        raise ValueError("--attack needs the --cell in which it was played")
    suite, place, row = _choose(results, model, cell, attack, allow_code)
    prepare_folder(out)
    with console.status("Playing"):
        replayed = Replay.of(suite, place, row.attack, row.record)
    stored = estimate(as_array(row.measured["utility"])).mean
    utility, honest = estimate(replayed.score), estimate(replayed.honest_score)
    condition = f"{place.model}, {place.scenario}, {place.track} {place.share:.0%}"
    title = f"{condition}: {row.attack}"
    table = number_table(escape(title), escape(row.words), "attack", "everybody honest")
    table.add_row(
        "utility of consumers",
        *(f"{interval.mean:.3f}±{interval.half:.3f}" for interval in (utility, honest)),
    )
    table.add_row(
        "rounds in which the most trusted provider is the attacker's",
        f"{replayed.believed.mean():.0%}",
        "",
    )
    for side in replayed.sides:
        table.add_row(f"trust in {side.label}", f"{np.nanmean(side.trust):.3f}", "")
    console.print(table)
    if abs(utility.mean - stored) > 1e-6:
        tell(
            f"The file has a utility of {stored:.3f}: another processor or other software computes "
            "other numbers, and "
            "may find another attack where the file has no record of the attacker.",
            "yellow",
        )
    from roletrust_experiments.plots.replay import replay_figure

    write_figure(out / "replay.png", replay_figure(title, replayed))
    written = ["replay.png"]
    if video:
        from roletrust_experiments.plots.video import write_video_of_states

        worst, task = int(np.argmin(replayed.score)), replayed.attack_found.task
        with progress_bar() as progress:
            write_video_of_states(
                out / "game.mp4", task.game, replayed.states(worst), task.identities, progress
            )
        written += ["game.mp4", "game.png"]
    tell(f"Written to {out}: {', '.join(written)}")


def _choose(
    path: Path, model: str | None, key: str | None, attack: str | None, allow_code: bool
) -> tuple[Suite, Cell, AttackResult]:
    """Return the suite, the cell and the attack to play, with the results that the file has.

    Raises:
        ValueError: The file is none of a robustness run, or has no such model, cell or attack.
    """
    suite, stored = read_run(path)
    if not allow_code:
        check_installed_names(suite)
    played = {
        stored_cell.cell.key: stored_cell for stored_cell in stored if stored_cell.result.rows
    }
    if key is None:
        board = Leaderboard.of(suite, stored)
        names = [row.model for row in board.rows if row.worst_attack]
        if not names:
            raise ValueError(f"{path} holds no attack that was played")
        model = model or names[0]
        if model not in names:
            raise ValueError(f"{path} has no attack on {model!r}{suggest(model, names)}")
        cases = [case for (name, _), case in worst_cases(board.attacks).items() if name == model]
        attacked = [case for case in cases if suite.tracks[case.condition.track].roles]
        worst = min(attacked, key=lambda case: case.mean)
        seeds = sorted({cell.seed for cell, _ in played.values()})
        seed = next(
            seed for seed, case in zip(seeds, worst.choices, strict=True) if case is worst.common
        )
        key, attack = Cell(model, *worst.condition, worst.common.method, seed).key, worst.attack
    if key not in played:
        raise ValueError(f"{path} has no played cell {key!r}{suggest(key, played)}")
    cell, result = played[key]
    rows = {row.attack: row for row in result.rows}
    if attack is None:
        scores = attack_scores(suite, [played[key]])
        attack = min(scores, key=lambda scored: least_mean(scored.chosen)).attack
    if attack not in rows:
        raise ValueError(f"cell {key} has no attack {attack!r}{suggest(attack, rows)}")
    return suite, cell, rows[attack]
