"""`roletrust defend`: defences that learn against attackers that learn, and what they are worth beside fixed models."""

import shlex
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
import typer
from rich.markup import escape

from roletrust_agents.training.runs import write_bytes
from roletrust_env import __version__
from roletrust_env.storage.files import prepare_folder, write_text
from roletrust_env.storage.provenance import software
from roletrust_experiments.attackers.runs import Run, read_runs, write_runs
from roletrust_experiments.commands import completion
from roletrust_experiments.commands.console import changed_options, console, interruptible, print_next, progress_bar
from roletrust_experiments.commands.extras import require
from roletrust_experiments.commands.options import NAMED, OWN, Again, ConditionSuite, Out, Seed

if TYPE_CHECKING:
    from roletrust_experiments.defence.double_oracle import Game

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
    suite: ConditionSuite = "standard-4",
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
    force: Again = False,
    out: Out = Path("results/defence"),
) -> None:
    """Train [bold]trust models against a population of attackers, and attackers against the models[/], in turn.

    The payoffs of all known models against all known attackers are a matrix, whose equilibrium is solved. Then an
    attacker is trained in each condition against the models' mixture, and each learner against the attackers' mixture,
    and all join the matrix. What the best responses win in other games is a lower bound of the NashConv.

    At the end, the learned models stand beside the fixed ones: under the attackers that were found, one that is trained
    against each model alone with the same budget, and attackers and worlds that no training has met. The number is
    skill: 1 for the best choice of a consumer, 0 for a blind one.

    Each step is saved when it is finished, so that an interrupted command continues when it is given again.

    Written: [green]defence.md defence.png iterations.csv comparison.csv defence.json[/]; the best model of each
    learner as the text that `--model` takes, [green]LEARNER.txt[/], or as
    [green]network.safetensors network.json[/].

    [bold]Examples[/]

    [dim]# the game of the documentation[/]
    [cyan]roletrust defend[/]

    [dim]# a short one in one condition[/]
    [cyan]roletrust defend --front crowd/raters/0.3 --world market/raters/0.2 --iterations 1 --steps 5[/]

    [dim]# another model's numbers[/]
    [cyan]roletrust defend --defence wary-role-trust[/]
    """
    require("learned defence", "train", "scipy", "cma", "torch", "safetensors")
    from roletrust_agents.training.defence import Climb
    from roletrust_agents.training.defence_learners import NetworkLearner, learner_of
    from roletrust_experiments.commands.defend_report import LONGEST, caveats, print_report, write_report
    from roletrust_experiments.defence.comparison import Comparison
    from roletrust_experiments.defence.double_oracle import Game, Setup
    from roletrust_experiments.defence.fronts import Front
    from roletrust_experiments.defence.progress import iterations as progress_of
    from roletrust_experiments.defence.response import least_budget
    from roletrust_experiments.defence.stored import check_of

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
    setup = Setup(learners, fixed, iterations, budget, Climb(steps=steps), games, explored, seed)
    conditions = {one.name: one.condition.describe() for one in (*fronts, *worlds)}
    settings = {"command": "roletrust defend", **setup.plain(), "fresh": fresh, "conditions": conditions, **software()}
    path = out / "defence.json"
    kept = {} if force else read_runs(path, settings, check_of(setup, fresh))
    prepare_folder(out)
    warnings = caveats([*fronts, *worlds], min(games, fresh))
    for line in warnings:
        console.print(f"[dark_orange3]{escape(line)}[/]", soft_wrap=True)

    def keep(key: str, run: Run) -> None:
        kept[key] = run
        write_runs(path, settings, kept)

    game = Game(fronts, setup, kept, keep)
    _watch("Game", game.stages, game.play())
    comparison = Comparison(game, further, worlds, fresh)
    _watch("Comparison", comparison.stages, comparison.play())
    saved = [*_save_specs(out, game, comparison.learned), *_save_network(out, game, comparison.learned)]
    found, rows = progress_of(game), comparison.rows()
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
    )
    command = shlex.join(["roletrust", "defend", *chosen])
    write_report(out, game, found, rows, warnings, command)
    print_report(found, rows)
    files = ["defence.md", "defence.png", "iterations.csv", "comparison.csv", "defence.json", *saved]
    console.print(escape(f"Written to {out}: {', '.join(files)}"), soft_wrap=True)
    best = next(row.name for row in rows if row.name in comparison.models and row.name not in (*fixed, *further))
    spec = comparison.models[best]
    print_next("benchmark", "--model", spec if len(spec) <= LONGEST else f"{_SAVED}:path={out / NetworkLearner.name}")


def _watch(what: str, total: int, stages: Iterator[str]) -> None:
    """Play stages with a progress bar."""
    with progress_bar() as progress, interruptible("steps"):
        bar = progress.add_task(what, total=total)
        for words in stages:
            progress.update(bar, advance=1, description=escape(words))


def _save_specs(out: Path, game: "Game", learned: "Mapping[str, int]") -> list[str]:
    """Write the spec of the best model of each learner but the network, and return the names of the files."""
    from roletrust_agents.training.defence_learners import NetworkLearner

    names = [name for name in learned if name != NetworkLearner.name]
    for name in names:
        write_text(out / _file(name), game.runs[f"defence|{learned[name]}|{name}"]["spec"] + "\n")
    return [_file(name) for name in names]


def _file(name: str) -> str:
    """Return the name of the file of a learner; not all systems allow the colon of an own class in it."""
    return f"{name.replace(':', '.')}.txt"


def _save_network(out: Path, game: "Game", learned: "Mapping[str, int]") -> list[str]:
    """Save the network of a game, if it trained one, and return the names of the files."""
    from roletrust_agents.learned.saved import digest
    from roletrust_agents.learned.saved_defence import DefenceCard, save_defence, weights_bytes
    from roletrust_agents.training.defence_learners import NetworkLearner

    name, setup = NetworkLearner.name, game.setup
    if name not in learned:
        return []
    vector, learner = np.array(game.runs[f"defence|{learned[name]}|{name}"]["vector"]), NetworkLearner()
    weights = np.array(learner.weights(vector))
    card = DefenceCard(
        package_version=__version__,
        parameters=learner.parameters(vector),
        conditions=tuple(str(front.condition) for front in game.fronts),
        iteration=learned[name] + 1,
        seed=setup.seed,
        settings={"steps": setup.climb.steps, "budget": setup.budget, "explored": setup.explored},
        weights_sha256=digest(weights_bytes(weights)),
    )
    save_defence(weights, card, out / name, write_bytes)
    return [f"{name}.safetensors", f"{name}.json"]
