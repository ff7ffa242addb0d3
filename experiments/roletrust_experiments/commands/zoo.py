"""`roletrust zoo`: trained attackers, and whether they still score what they are said to."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.box import SIMPLE_HEAD
from rich.markup import escape
from rich.table import Table

from roletrust_env.evaluation.resources import check_memory
from roletrust_env.metrics.confidence import over_games
from roletrust_experiments.commands.console import console, errors, progress_bar
from roletrust_experiments.commands.extras import require
from roletrust_experiments.playing.games import task_memory

if TYPE_CHECKING:
    from roletrust_agents.learned.saved import SavedAttacker


def zoo(
    names: Annotated[
        list[str] | None, typer.Argument(help="Which attackers; all if left out.", show_default=False)
    ] = None,
    folder: Annotated[
        Path | None,
        typer.Option(help="Where they are, as pairs of files; the project's own if left out.", show_default=False),
    ] = None,
    games: Annotated[int, typer.Option(min=2, help="Games in which each is measured.")] = 256,
    seed: Annotated[int, typer.Option(min=0, help="Of all luck.")] = 0,
) -> None:
    """List [bold]trained attackers[/] and measure their scores anew, in their own tasks.

    The score is the mean reward per round, with its 95% confidence interval; beside it what honest play scores.
    Leaves with 1 if a file is refused or a score is not what it is said to be.

    [bold]Examples[/]

    [dim]# those that come with the project[/]
    [cyan]roletrust zoo[/]

    [dim]# your own[/]
    [cyan]roletrust zoo --folder results/train[/]

    [dim]# one of them at play[/]
    [cyan]roletrust play --attack sp_2=learned:path=provider-3x3[/]
    """
    require("a trained attacker", "train", "safetensors")
    from roletrust_agents.learned import saved
    from roletrust_agents.learned.network_attacker import NetworkAttacker

    folder = folder or saved.ZOO
    known = saved.zoo(folder)
    if not known:
        raise ValueError(f"there is no attacker in {folder}; one is a .json and a .safetensors file of one name")
    for name in names or ():
        if name not in known:
            raise ValueError(f"there is no attacker {name!r} in {folder}; there are {', '.join(known)}")
    table = Table(title="Trained attackers", title_justify="left", title_style="bold", box=SIMPLE_HEAD, pad_edge=False)
    table.add_column("name", style="cyan", no_wrap=True)
    for column in ("honest", "score, as saved", "measured"):
        table.add_column(column, justify="right", no_wrap=True)
    table.add_column("holds")
    well, told, attackers = True, [], {}
    for name in names or known:
        try:
            attackers[name] = saved.load_attacker(folder / name)
        except ValueError as error:
            errors.print(f"[bold red]refused:[/] {escape(str(error))}", soft_wrap=True)
            well = False
    for attacker in attackers.values():
        mind = NetworkAttacker(attacker.network, attacker.card.task.knowledge)
        check_memory("--games", games, task_memory(attacker.task(), mind))
    with progress_bar() as progress:
        for name, attacker in progress.track(attackers.items(), description="Playing"):
            mean, half = measure(attacker, games, seed)
            said = attacker.card.score
            # Of two means that are the same, the intervals seldom lie apart; rounding differs between machines.
            holds = abs(mean - said.mean) <= half + said.half_95 + 1e-4
            well &= holds
            before, now = (f"{a:.4f} ± {b:.4f}" for a, b in ((said.mean, said.half_95), (mean, half)))
            table.add_row(name, f"{said.honest:.4f}", before, now, "yes" if holds else "[red]no")
            told.append(f"[cyan]{name}[/]: {_task(attacker)}")
    console.print(table)
    for line in told:
        console.print(line, soft_wrap=True)
    if not well:
        raise typer.Exit(1)


def measure(attacker: "SavedAttacker", games: int, seed: int) -> tuple[float, float]:
    """The score of an attacker in its own task, and half its 95% confidence interval."""
    from roletrust_agents.learned.policy import play_task

    scores = over_games(play_task(attacker.task(), attacker.network, games=games, seed=seed))
    return float(scores.mean), float(scores.half)


def _task(attacker: "SavedAttacker") -> str:
    """What an attacker is for, in words."""
    card = attacker.card
    task, rules = card.task, card.scenario
    price = f", stealth {task.stealth.weight:g} beyond {task.stealth.tolerance:g}" if task.stealth.weight else ""
    who = ", ".join(task.compromised)
    kind = task.id.removeprefix("RoleTrust/").removesuffix("-v0")
    return escape(
        f"{kind}: {who} in {rules.name}, {rules.max_cycles} rounds, {task.objective}{price}, {task.knowledge}\n"
        f"by {card.training.algorithm}, {card.training.steps:,} rounds, seed {card.training.seed}"
    )
