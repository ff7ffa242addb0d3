"""Defences that learn against attackers that learn, and what they are worth beside fixed models."""

import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape

from roletrust_env.storage.files import prepare_folder
from roletrust_env.storage.provenance import software
from roletrust_experiments.commands import completion
from roletrust_experiments.commands.console import changed_options, console, interruptible, print_next, progress_bar
from roletrust_experiments.commands.extras import require
from roletrust_experiments.commands.options import NAMED, OWN, Out, Seed, SeededRuns
from studies.attackers.runs import Run, read_runs, write_runs
from studies.options import Again, ConditionSuite
from studies.running import run

_FRONT = "SCENARIO/TRACK/SHARE"
_LEARNERS = ("leave-one-out", "network")
_MODELS = ("role-trust", "wary-role-trust", "leave-one-out", "iterative-filtering")
_FRONTS = ("crowd/raters/0.4", "crowd/coalition/0.2", "market/raters/0.2", "market/coalition/0.2")
_WORLDS = ("diverse/raters/0.2", "diverse/coalition/0.1", "large/raters/0.2", "large/coalition/0.1")
_SAVED = "roletrust_agents.learned.saved_defence:SavedTrust"


def defend(
    defence: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME",
            help="Defence to train: the numbers of a trust model, by its name, or `network`; repeat for more. "
            f"By default {', '.join(_LEARNERS)}. {OWN}",
            autocompletion=completion.models,
            show_default=False,
        ),
    ] = None,
    model: Annotated[
        list[str] | None,
        typer.Option(
            metavar=NAMED,
            help=f"Fixed trust model that the defence has at the beginning; repeat for more. By default "
            f"{', '.join(_MODELS)}. {OWN}",
            autocompletion=completion.models,
            show_default=False,
        ),
    ] = None,
    beside: Annotated[
        list[str] | None,
        typer.Option(
            metavar=NAMED,
            help=f"Further trust model for the comparison at the end; repeat for more. {OWN}",
            autocompletion=completion.models,
            show_default=False,
        ),
    ] = None,
    suite: ConditionSuite = "standard",
    front: Annotated[
        list[str] | None,
        typer.Option(
            metavar=_FRONT,
            help=f"Condition of the suite to train in; repeat for more. By default {', '.join(_FRONTS)}.",
            show_default=False,
        ),
    ] = None,
    world: Annotated[
        list[str] | None,
        typer.Option(
            metavar=_FRONT,
            help=f"Condition that is kept for the comparison; repeat for more. By default {', '.join(_WORLDS)}.",
            show_default=False,
        ),
    ] = None,
    iterations: Annotated[int, typer.Option(min=1, help="Number of times that both sides respond.")] = 4,
    budget: Annotated[
        int,
        typer.Option(
            help="Rounds x games of the training of an attacker in one condition. The least number grows with the "
            "rounds of a game and with the models of the mixture; a smaller one is refused with that number."
        ),
    ] = 60_000,
    steps: Annotated[int, typer.Option(min=1, help="Steps of the training of a defence.")] = 20,
    games: Annotated[int, typer.Option(min=2, help="Games that choose, and as many others that measure.")] = 24,
    fresh: Annotated[int, typer.Option(min=2, help="The same for the comparison, in fresh games.")] = 24,
    explored: Annotated[
        float,
        typer.Option(min=0, max=1, help="Share of all known attackers alike in what a defence is trained against."),
    ] = 0.25,
    seed: Seed = 0,
    runs: SeededRuns = 1,
    force: Again = False,
    out: Out = Path("results/defence"),
) -> None:
    """Train [bold]trust models against a population of attackers, and attackers against the models[/], in turn.

    The payoffs of all known models against all known attackers are a matrix, whose equilibrium is solved. Then an
    attacker is trained in each condition against the models' mixture, and each learner against the attackers' mixture,
    and all join the matrix. What the best responses win in other games is a lower bound of the NashConv.

    At the end, the learned models stand beside the fixed ones: under the attackers that were found, one that is trained
    against each model alone with the same budget, and attackers and worlds that no training has met. The number is
    skill: 1 for the best choice of a consumer, 0 for a blind one. With several runs, all is trained again with other
    seeds, and intervals cover games and trainings.

    Each step is saved when it is finished, so that an interrupted command continues when it is given again.

    Written: [green]defence.md defence.png iterations.csv comparison.csv leads.csv[/]; [green]defence.json[/] and the
    best model of each learner as the text that `--model` takes, [green]LEARNER.txt[/], or as
    [green]network.safetensors network.json[/], of several runs in a folder for each.

    [bold]Examples[/]

    [dim]# the game of the documentation[/]
    [cyan]python -m studies.defend[/]

    [dim]# a short one in one condition[/]
    [cyan]python -m studies.defend --front crowd/raters/0.3 --world market/raters/0.2 --iterations 1 --steps 5[/]

    [dim]# another model's numbers[/]
    [cyan]python -m studies.defend --defence wary-role-trust[/]

    [dim]# judges with experience of their own, trained three times, beside others[/]
    [cyan]python -m studies.defend --defence first-hand --beside first-hand --beside travos --runs 3[/]
    """
    require("learned defence", "train", "scipy", "cma", "torch", "safetensors")
    from roletrust_agents.training.defence import Climb
    from roletrust_agents.training.defence_learners import NetworkLearner, learner_of
    from studies.defence.comparison import Comparison, leads, names_of
    from studies.defence.comparison import rows as rows_of
    from studies.defence.double_oracle import Game, Setup, label
    from studies.defence.fronts import Front
    from studies.defence.progress import iterations as progress_of
    from studies.defence.response import least_budget
    from studies.defence.saving import save_models
    from studies.defence.stored import check_of
    from studies.defend_report import LONGEST, Report, caveats, print_report, write_report

    learners = tuple(dict.fromkeys(defence or _LEARNERS))
    fixed, further = tuple(dict.fromkeys(model or _MODELS)), tuple(dict.fromkeys(beside or ()))
    met, others = (
        {(one := Front.of(suite, n)).name: one for n in names} for names in (front or _FRONTS, world or _WORLDS)
    )
    if world and (both := sorted({*met} & {*others})):
        raise ValueError(f"{both[0]} is a condition of the training; --world is for others")
    fronts, worlds = list(met.values()), [one for name, one in others.items() if name not in met]
    for name in learners:
        learner_of(name)
    for one in (*fronts, *worlds):
        one.condition.check([*fixed, *further])
    if budget < (least := max(least_budget(one.length) for one in fronts)):
        raise ValueError(f"--budget is {budget} rounds; the training of an attacker needs {least} or more")
    conditions = {one.name: one.condition.describe() for one in (*fronts, *worlds)}

    def planned(k: int) -> tuple[Path, Game]:
        """Return the folder of a run and its game, with the steps that are stored there."""
        setup = Setup(learners, fixed, iterations, budget, Climb(steps=steps), games, explored, seed + k)
        settings = {"command": "python -m studies.defend", **setup.plain(), "fresh": fresh, "conditions": conditions}
        folder = out / f"seed-{seed + k}" if runs > 1 else out
        path, settings = folder / "defence.json", settings | software()
        kept = {} if force else read_runs(path, settings, check_of(setup, fresh))

        def keep(key: str, run: Run) -> None:
            kept[key] = run
            write_runs(path, settings, kept)

        return folder, Game(fronts, setup, kept, keep)

    plans = [planned(k) for k in range(runs)]  # all that is stored is checked before anything is written
    for folder, _ in plans:
        prepare_folder(folder)
    warnings = caveats([*fronts, *worlds], min(games, fresh))
    for line in warnings:
        console.print(f"[dark_orange3]{escape(line)}[/]", soft_wrap=True)
    comparisons, saved = [], list[Path]()
    for folder, game in plans:
        of = f" of {folder.name}" if runs > 1 else ""
        _watch(f"Game{of}", game.stages, game.play())
        comparison = Comparison(game, further, worlds, fresh)
        _watch(f"Comparison{of}", comparison.stages, comparison.play())
        comparisons.append(comparison)
        saved += [folder / name for name in ("defence.json", *save_models(folder, game, comparison.learned))]
    every = [game for _, game in plans]
    found, rows = progress_of(every), rows_of(comparisons)
    chosen = changed_options(
        defend,
        defence=defence,
        model=model,
        beside=beside,
        suite=suite,
        front=front,
        world=world,
        iterations=iterations,
        budget=budget,
        steps=steps,
        games=games,
        fresh=fresh,
        explored=explored,
        seed=seed,
        runs=runs,
    )
    command = shlex.join(["python", "-m", "studies.defend", *chosen])
    report = Report(every, found, rows, leads(comparisons), warnings, command)
    write_report(out, report)
    print_report(report)
    files = ["defence.md", "defence.png", "iterations.csv", "comparison.csv", "leads.csv"]
    names = ", ".join([*files, *(path.relative_to(out).as_posix() for path in saved)])
    console.print(escape(f"Written to {out}: {names}"), soft_wrap=True)
    models = {name: learner for learner, name in names_of(comparisons).items()}
    best = models[next(row.name for row in rows if row.name in models)]
    (folder, game), first = plans[0], comparisons[0]
    spec = first.models[label(best, first.learned[best])]
    print_next(
        "benchmark", "--model", spec if len(spec) <= LONGEST else f"{_SAVED}:path={folder / NetworkLearner.name}"
    )


def _watch(what: str, total: int, stages: Iterator[str]) -> None:
    """Play stages with a progress bar."""
    with progress_bar() as progress, interruptible("steps"):
        bar = progress.add_task(what, total=total)
        for words in stages:
            progress.update(bar, advance=1, description=escape(words))


if __name__ == "__main__":
    run(defend)
