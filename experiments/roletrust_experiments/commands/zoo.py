"""`roletrust zoo`: list trained attackers and check their saved scores."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.markup import escape

from roletrust_env.errors import suggest
from roletrust_env.evaluation.measurement import task_memory
from roletrust_env.evaluation.resources import check_memory
from roletrust_env.metrics.confidence import over_games
from roletrust_env.world.presets import scenarios
from roletrust_experiments.commands.console import console, errors, number_table, print_next, progress_bar
from roletrust_experiments.commands.extras import require
from roletrust_experiments.commands.options import Seed

if TYPE_CHECKING:
    from roletrust_agents.learned.saved import SavedAttacker


def zoo(
    names: Annotated[
        list[str] | None, typer.Argument(help="Names of attackers; all if left out.", show_default=False)
    ] = None,
    folder: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="Folder of attackers, each a .json and a .safetensors file; the project's own if left out.",
            show_default=False,
        ),
    ] = None,
    games: Annotated[int, typer.Option(min=2, help="Number of games that measure each attacker.")] = 256,
    seed: Seed = 0,
) -> None:
    """List [bold]trained attackers[/], and measure their scores again in their own tasks.

    The score is the mean reward per round, with its 95% confidence interval. The table also shows the score of honest
    play. The exit code is 1 if a file is refused or a score differs from the saved one.

    [bold]Examples[/]

    [dim]# the attackers that come with the project[/]
    [cyan]roletrust zoo[/]

    [dim]# your own[/]
    [cyan]roletrust zoo --folder results/train[/]

    [dim]# play one of them[/]
    [cyan]roletrust play --attack sp_2=learned:path=provider-3x3[/]
    """
    require("a trained attacker", "train", "safetensors")
    from roletrust_agents.learned import saved
    from roletrust_agents.learned.coalition_attacker import attacker_for

    folder = folder or saved.ZOO
    known = saved.zoo(folder)
    if not known:
        raise ValueError(f"there is no attacker in {folder}; one is a .json and a .safetensors file of one name")
    for name in names or ():
        if name not in known:
            raise ValueError(f"there is no attacker {name!r} in {folder}{suggest(name, known)}")
    table = number_table("Trained attackers", "", "honest", "score, as saved", "measured", "holds")
    well, descriptions, attackers = True, [], {}
    for name in names or known:
        try:
            attackers[name] = saved.load_attacker(folder / name)
        except ValueError as error:
            errors.print(f"[bold red]refused:[/] {escape(str(error))}", soft_wrap=True)
            well = False
    for attacker in attackers.values():
        mind = attacker_for(attacker.network, attacker.card.task.knowledge)
        check_memory("--games", games, task_memory(attacker.task(), mind))
    with progress_bar() as progress:
        for name, attacker in progress.track(attackers.items(), description="Playing"):
            mean, half = measure(attacker, games, seed)
            saved_score = attacker.card.score
            # Two equal means seldom have separate intervals; rounding differs between machines.
            holds = abs(mean - saved_score.mean) <= half + saved_score.half_95 + 1e-4
            well &= holds
            pairs = (saved_score.mean, saved_score.half_95), (mean, half)
            before, now = (f"{a:.4f} ± {b:.4f}" for a, b in pairs)
            table.add_row(escape(name), f"{saved_score.honest:.4f}", before, now, "yes" if holds else "[red]no[/]")
            descriptions.append(f"[cyan]{escape(name)}[/]: {_task(attacker)}")
    console.print(table)
    for line in descriptions:
        console.print(line, soft_wrap=True)
    if playable := [
        name for name, one in attackers.items() if len(one.card.task.compromised) == 1 and one.card.observation
    ]:
        card = attackers[playable[0]].card
        path = playable[0] if folder == saved.ZOO else folder / playable[0]
        scenario = card.scenario.name if card.scenario.name in scenarios() else None
        print_next("play", scenario, "--attack", f"{card.task.compromised[0]}=learned:path={path}")
    if not well:
        raise typer.Exit(1)


def measure(attacker: "SavedAttacker", games: int, seed: int) -> tuple[float, float]:
    """Return the score of an attacker in its own task, and half its 95% confidence interval."""
    from roletrust_agents.learned.policy import play_task

    scores = over_games(play_task(attacker.task(), attacker.network, games=games, seed=seed))
    return float(scores.mean), float(scores.half)


def _task(attacker: "SavedAttacker") -> str:
    """Return a description of the task of an attacker."""
    card = attacker.card
    task, rules = card.task, card.scenario
    price = f", stealth {task.stealth.weight:g} beyond {task.stealth.tolerance:g}" if task.stealth.weight else ""
    who = ", ".join(task.compromised)
    kind = task.id.removeprefix("RoleTrust/").removesuffix("-v0")
    return escape(
        f"{kind}: {who} in {rules.name}, {rules.max_cycles} rounds, {task.objective}{price}, {task.knowledge}\n"
        f"by {card.training.algorithm}, {card.training.steps:,} rounds, seed {card.training.seed}"
    )
