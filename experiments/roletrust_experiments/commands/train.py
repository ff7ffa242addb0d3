"""`roletrust train`: train an attacker, in a folder that holds all that an interrupted run needs to continue."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_args

import typer
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

from roletrust_agents.training.runs import RunFolder, write_bytes
from roletrust_env import Scenario, make_scenario
from roletrust_env.envs.attack_env import TASKS
from roletrust_env.evaluation.resources import check_memory
from roletrust_env.evaluation.specs import parse_parameters, parse_settings, read_trust_model
from roletrust_env.game.attack_task import Knowledge, Objective
from roletrust_env.storage.files import write_csv
from roletrust_env.storage.provenance import provenance
from roletrust_env.trust.model import registry as trust_models
from roletrust_experiments.commands import completion
from roletrust_experiments.commands.console import console, errors, print_next, progress_bar
from roletrust_experiments.commands.extras import require
from roletrust_experiments.commands.options import (
    NAMED,
    Compromised,
    ScenarioOption,
    SeededRuns,
    SettingsOption,
    StealthTolerance,
    StealthWeight,
    check_choice,
    find_task,
)
from roletrust_experiments.plots.figure_files import write_figure

if TYPE_CHECKING:
    from roletrust_agents.learned.cards import ModelCard
    from roletrust_agents.learned.saved import SavedAttacker
    from roletrust_agents.training.runs import CurvePoint, Run, TrainingReport

_SINGLE = {"PPO": "ppo", "SAC": "sac", "recurrent-PPO": "recurrent-ppo"}
_COALITIONS = {
    "evolution": "evolution",
    "evolution-strategy": "evolution-strategy",
    "gradients": "gradients",
    "coalition-PPO": "coalition-ppo",
}
"""Learners of the network of a coalition, and their algorithms."""

_ALGORITHMS = _SINGLE | _COALITIONS
"""Names of the learners, and of their algorithms in configurations and saved attackers."""


def train(
    context: typer.Context,
    task: Annotated[
        str | None,
        typer.Argument(
            help=f"Attack task: {', '.join(completion.task_names())}.",
            autocompletion=completion.tasks,
            show_default=False,
        ),
    ] = None,
    learner: Annotated[
        str,
        typer.Option(
            metavar=NAMED,
            help=f"Learning algorithm, one of {', '.join(_ALGORITHMS)}, with settings such as gamma=0.9.",
            autocompletion=lambda incomplete: [name for name in _ALGORITHMS if name.startswith(incomplete)],
        ),
    ] = "PPO",
    steps: Annotated[
        int | None,
        typer.Option(min=1, help="Minimum number of rounds to train for, over all games; the tuned one if left out."),
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Random seed of the games and of the learner.")] = 0,
    runs: SeededRuns = 1,
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder of the run; it is created if it is missing.")] = Path(
        "results/train"
    ),
    scenario: ScenarioOption = None,
    settings: SettingsOption = None,
    model: Annotated[
        list[str] | None,
        typer.Option(
            metavar=NAMED,
            help="Trust model, role-trust if left out; a class of your own needs an entry point. "
            "Learners of coalitions take several, and train against them in turn: " + ", ".join(_COALITIONS) + ".",
            autocompletion=completion.models,
            show_default=False,
        ),
    ] = None,
    compromised: Compromised = None,
    objective: Annotated[
        str | None,
        typer.Option(
            metavar="|".join(get_args(Objective)),
            help="Aim of the attacker; the task's own if left out.",
            autocompletion=lambda incomplete: [name for name in get_args(Objective) if name.startswith(incomplete)],
            show_default=False,
        ),
    ] = None,
    accomplice: Annotated[
        list[str] | None,
        typer.Option(
            metavar="AGENT", help="Provider that the objective promote is about; repeat for more.", show_default=False
        ),
    ] = None,
    stealth_weight: StealthWeight = 0.0,
    stealth_tolerance: StealthTolerance = 0.1,
    knowledge: Annotated[
        str,
        typer.Option(
            metavar="|".join(get_args(Knowledge)),
            help="Threat model: what the attacker observes.",
            autocompletion=lambda incomplete: [name for name in get_args(Knowledge) if name.startswith(incomplete)],
        ),
    ] = "black_box",
    threads: Annotated[
        int, typer.Option(min=1, help="Number of threads of torch; networks of this size gain little from two.")
    ] = 1,
    resume: Annotated[
        bool, typer.Option("--resume", help="Continue the run in --out from its last checkpoint.")
    ] = False,
) -> None:
    r"""Train [bold]an attacker[/] by reinforcement learning, evolution or gradients, and save it to play it anywhere.

    Written: [green]attacker.json attacker.safetensors curve.csv curve.png config.json[/], checkpoints, and, except
    by learners of coalitions, a log for TensorBoard. The score is the mean reward per round in held-out games. An
    interrupted run continues with [cyan]--resume --out DIR[/]; to continue several runs, give the whole command again
    with [cyan]--resume[/]. On the same machine, the same seed gives the same result to the last bit if the run is not
    interrupted.

    [bold]Examples[/]

    [dim]# a provider that sells bad service while it is trusted[/]
    [cyan]roletrust train ProviderAttack --set max_cycles=200[/]

    [dim]# a rater that lies without being detected[/]
    [cyan]roletrust train RaterAttack --stealth-weight 2 --set noise=0 --out results/rater[/]

    [dim]# continue this run[/]
    [cyan]roletrust train --resume --out results/rater[/]

    [dim]# another learner, with settings of its own[/]
    [cyan]roletrust train RaterAttack --learner SAC:gamma=0.9,gradient_steps=2 --out results/sac[/]

    [dim]# a coalition that learns by evolution, against two trust models in turn[/]
    [cyan]roletrust train CollusionAttack --learner evolution --model beta --model qor[/]

    [dim]# one by an evolution strategy, which needs fewer rounds[/]
    [cyan]roletrust train CollusionAttack --learner evolution-strategy --objective mislead --model role-trust[/]

    [dim]# one by PPO, with noise that is held over a game[/]
    [cyan]roletrust train CollusionAttack --learner coalition-PPO --objective mislead --model median[/]

    [dim]# a coalition that learns by gradients through the game[/]
    [cyan]roletrust train CollusionAttack --learner gradients:learning_rate=0.005 --objective mislead --model beta[/]

    [dim]# five seeds, for one rung of a ladder[/]
    [cyan]roletrust train CollusionAttack --stealth-weight 2 --runs 5 --out results/colluders[/]

    [dim]# play the trained attacker[/]
    [cyan]roletrust play --attack sr_2=learned:path=results/rater[/]
    """
    require("training", "train", "torch", "stable_baselines3", "sb3_contrib", "safetensors", "tensorboard")
    import torch

    from roletrust_agents.learned.cards import Price, TaskCard
    from roletrust_agents.training.runs import Run
    from roletrust_agents.training.settings import make_settings

    torch.set_num_threads(threads)
    run = None
    if task is None:
        _refuse_options(context)
    if task is not None:
        task_id = find_task(task)
        name, changes = parse_parameters(learner)
        algo: Any = {known.lower(): algo for known, algo in _ALGORITHMS.items()}.get(name.lower().replace(" ", "-"))
        algo = algo or check_choice("learner", name, tuple(_ALGORITHMS))
        tuned = make_settings(task_id, algo, {**changes, **({"steps": steps} if steps else {})})
        defaults = TASKS[task_id].defaults
        rules = make_scenario(scenario or defaults["scenario"])
        if fields := parse_settings(settings or []):
            rules = rules.change(**fields)
        models = [_model_card(one, rules) for one in model or ["role-trust"]]
        if len(models) > 1 and algo not in _COALITIONS.values():
            raise ValueError(
                f"--model is given {len(models)} times; only {', '.join(_COALITIONS)} train against several trust "
                "models"
            )
        run = Run(
            algo=algo,
            steps=tuned.steps,
            seed=seed,
            settings=tuned.model_dump(mode="json"),
            task=TaskCard(
                id=task_id,
                compromised=tuple(compromised or defaults["compromised"]),
                objective=check_choice("objective", objective or defaults["objective"], get_args(Objective)),
                stealth=Price(weight=stealth_weight, tolerance=stealth_tolerance),
                knowledge=check_choice("knowledge", knowledge, get_args(Knowledge)),
                accomplices=tuple(accomplice or ()),
            ),
            trust_model=models[0],
            further_models=tuple(models[1:]),
            scenario=rules,
        )
    planned = [run.model_copy(update={"seed": seed + k}) if run else None for k in range(runs)]
    folders = [RunFolder(out / f"seed-{seed + k}" if runs > 1 else out) for k in range(runs)]
    for one, folder in [(_run_in(folder, plan, resume), folder) for plan, folder in zip(planned, folders, strict=True)]:
        try:
            _train(one, folder)
        except KeyboardInterrupt:
            again = f"--resume --out {out}" if runs == 1 else "the same command and --resume"
            errors.print(
                f"Stopped. The training so far is kept; continue with: roletrust train {again}", soft_wrap=True
            )
            raise typer.Exit(130) from None
    print_next("list", "zoo", "--folder", out if runs == 1 else folders[0].path)


def _refuse_options(context: typer.Context) -> None:
    """Refuse the options of a new run beside a run that is continued, which has its own."""
    allowed = ("--out", "--threads", "--resume", "--runs")
    sources = {one.opts[0]: context.get_parameter_source(str(one.name)) for one in context.command.params}
    given = [name for name, source in sources.items() if source is not None and source.name == "COMMANDLINE"]
    if wrong := [name for name in given if name not in allowed]:
        raise ValueError(f"{', '.join(wrong)}: a run that is continued keeps its options; name a task to begin another")


def _run_in(folder: RunFolder, planned: "Run | None", resume: bool) -> "Run":
    """Return the run to train in a folder: the planned one, or the one that the folder holds.

    Raises:
        ValueError: There is neither, or the folder holds a run that must not be continued.
    """
    from roletrust_agents.training.runs import Run

    config, out = folder.config(), folder.path
    if config is None:
        if planned is None:
            several = next(out.parent.glob("seed-*") if out.name.startswith("seed-") else out.glob("seed-*"), None)
            how = "give the whole command again, with --resume" if several else "name a task to begin one"
            raise ValueError(f"there is no run in {out} to continue; {how}" if resume else "name a task")
        return planned
    run = Run.read(config.get("run"))
    if not resume:
        raise ValueError(f"{out} holds a run; continue it with --resume, or choose another --out")
    if planned is not None and planned != run:
        raise ValueError(f"{out} holds another run, see its config.json; leave the task out to continue that one")
    return run


def _train(run: "Run", folder: RunFolder) -> None:
    """Train a run from its last checkpoint or from the beginning."""
    from roletrust_agents.learned.saved import task_from_card
    from roletrust_agents.training import coalition_loop, loop
    from roletrust_agents.training.runs import versions

    coalition, games = run.algo in _COALITIONS.values(), run.settings["games"]
    learn = coalition_loop.train if coalition else loop.train
    if coalition:
        coalition_loop.check_games(run)
    elif games > loop.MANY:
        check_memory("--learner games", games, loop.game_memory(run))
    game = task_from_card(run.task, run.trust_model, run.scenario).game  # raises before anything is written
    folder.prepare()
    if folder.config() is None:
        about = {"command": "roletrust train", "run": run.model_dump(mode="json"), "learner_packages": versions()}
        folder.begin({**about, **provenance(game, run.seed)})
    with _bar() as progress:
        name = run.task.id.removeprefix("RoleTrust/").removesuffix("-v0")
        job = progress.add_task(f"{name}, {run.algo}, seed {run.seed}", total=run.steps, score="...")
        attacker, curve = learn(run, folder, lambda report: _show(progress, job, report))
    _write(folder.path, run, attacker, curve)
    score = attacker.card.score
    console.print(
        f"[bold]{name}[/], {run.algo}, seed {run.seed}: score {score.mean:.4f} ± {score.half_95:.4f} in {score.games} "
        f"held-out games, honest play {score.honest:.4f}; {attacker.card.training.seconds:.0f} s",
        soft_wrap=True,
    )
    written = "attacker.json, attacker.safetensors, curve.csv, curve.png"
    console.print(f"Written to {folder.path}: {written}", soft_wrap=True)


def _model_card(text: str, rules: Scenario) -> "ModelCard":
    from roletrust_agents.learned.cards import ModelCard

    registry, name, parameters = read_trust_model(text, rules)
    if registry is not trust_models:
        raise ValueError(
            f"--model {text}: a saved attacker refers to its trust model by name, so that no code runs to find it; "
            f"declare the model as an entry point in the group {trust_models.group!r}"
        )
    return ModelCard(name=name, parameters=parameters)


def _bar() -> Progress:
    """Return a progress bar that shows the score."""
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TaskProgressColumn(),
        TimeRemainingColumn(),
        TextColumn("score [bold]{task.fields[score]}"),
    )
    return progress_bar(columns=columns)


def _show(progress: Progress, job: Any, report: "TrainingReport") -> None:
    score = (
        f"{report.curve[-1].score:.4f}, best {max(point.score for point in report.curve):.4f}"
        if report.curve
        else "..."
    )
    progress.update(job, completed=report.steps, score=score)


def _write(out: Path, run: "Run", attacker: "SavedAttacker", curve: "list[CurvePoint]") -> None:
    from roletrust_agents.learned import save_attacker
    from roletrust_experiments.plots.learning import learning_figure

    write_csv(out / "curve.csv", ("steps", "seconds", "score", "half_95"), curve)
    write_figure(out / "curve.png", learning_figure(run.algo, attacker, curve))
    save_attacker(attacker, out / "attacker", write_bytes)
