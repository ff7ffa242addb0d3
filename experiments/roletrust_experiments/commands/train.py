"""`roletrust train`: an attacker that learns, in a folder from which it goes on if it was interrupted."""

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

from roletrust_env import Scenario, make_scenario
from roletrust_env.envs.tasks import TASKS
from roletrust_env.evaluation.resources import check_memory
from roletrust_env.evaluation.specs import parse_settings, read_trust_model
from roletrust_env.storage.files import write_csv
from roletrust_env.storage.provenance import provenance
from roletrust_env.trust.model import registry as trust_models
from roletrust_experiments.commands.console import console, errors, progress_bar
from roletrust_experiments.commands.extras import require
from roletrust_experiments.commands.task_options import (
    ScenarioOption,
    SettingsOption,
    StealthTolerance,
    StealthWeight,
    TrustModelOption,
    find_task,
)
from roletrust_experiments.plots.figure_files import write_figure
from roletrust_experiments.training.runs import RunFolder, write_bytes

if TYPE_CHECKING:
    from roletrust_agents.learned.cards import ModelCard
    from roletrust_agents.learned.saved import SavedAttacker

    from roletrust_experiments.training.loop import Point, Report, Run

_OUT = Path("results/train")


class Algorithm(StrEnum):
    """What learns."""

    PPO = "ppo"
    SAC = "sac"
    RECURRENT_PPO = "recurrent-ppo"


class Objective(StrEnum):
    """What the attacker is after."""

    DAMAGE = "damage"
    EXPLOIT = "exploit"
    PROMOTE = "promote"
    MISLEAD = "mislead"


class Knowledge(StrEnum):
    """What the attacker sees."""

    BLACK_BOX = "black_box"
    GREY_BOX = "grey_box"
    WHITE_BOX = "white_box"


def train(
    task: Annotated[
        str | None,
        typer.Argument(help="ProviderAttack, RaterAttack, DualAttack or CollusionAttack.", show_default=False),
    ] = None,
    algo: Annotated[Algorithm, typer.Option(help="What learns.")] = Algorithm.PPO,
    steps: Annotated[
        int | None, typer.Option(min=1, help="Rounds to train for, of all games together, at least; tuned if left out.")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Of all luck, that of the learner included.")] = 0,
    runs: Annotated[
        int,
        typer.Option(min=1, help="How often it is trained, with this seed and the ones after it, in folders seed-..."),
    ] = 1,
    out: Annotated[Path, typer.Option(help="Folder of the run; it is made if need be.")] = _OUT,
    scenario: ScenarioOption = None,
    settings: SettingsOption = None,
    trust_model: TrustModelOption = "role-trust",
    compromised: Annotated[
        list[str] | None, typer.Option(metavar="AGENT", help="Who is controlled; repeat for more.")
    ] = None,
    objective: Annotated[Objective | None, typer.Option(help="Another aim than the task's.")] = None,
    accomplice: Annotated[
        list[str] | None, typer.Option(metavar="AGENT", help="Whom 'promote' is for; repeat for more.")
    ] = None,
    stealth_weight: StealthWeight = 0.0,
    stealth_tolerance: StealthTolerance = 0.1,
    knowledge: Annotated[Knowledge, typer.Option(help="What the attacker sees.")] = Knowledge.BLACK_BOX,
    learner: Annotated[
        list[str] | None,
        typer.Option(metavar="SETTING=VALUE", help="Change a setting of the learner, such as gamma; repeat for more."),
    ] = None,
    threads: Annotated[int, typer.Option(min=1, help="Threads of torch; networks this small gain little by two.")] = 1,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on with the run in --out, from its last checkpoint.")
    ] = False,
) -> None:
    r"""Train [bold]an attacker[/] by reinforcement learning, and save it to be shared and played anywhere.

    Written: [green]attacker.json attacker.safetensors curve.csv curve.png config.json[/], checkpoints, and a log for
    TensorBoard. The score is the mean reward per round in held-out games. A run that was stopped, however it was,
    goes on with [cyan]--resume --out DIR[/]. On the same machine the same seed learns the same to the last bit, in runs
    that nothing stops. Of several runs, the whole command is given again, with [cyan]--resume[/].

    [bold]Examples[/]

    [dim]# a provider that sells bad service on good trust[/]
    [cyan]roletrust train ProviderAttack --set max_cycles=200[/]

    [dim]# a rater that lies, but not so that it shows[/]
    [cyan]roletrust train RaterAttack --stealth-weight 2 --set noise=0 --out results/rater[/]

    [dim]# go on with it[/]
    [cyan]roletrust train --resume --out results/rater[/]

    [dim]# five seeds, for one rung of a ladder[/]
    [cyan]roletrust train CollusionAttack --stealth-weight 2 --runs 5 --out results/colluders[/]

    [dim]# the attacker at play[/]
    [cyan]roletrust play --attack sr_2=learned:path=results/rater[/]
    """
    require("training", "train", "torch", "stable_baselines3", "sb3_contrib", "safetensors", "tensorboard")
    import torch
    from roletrust_agents.learned.cards import Price, TaskCard

    from roletrust_experiments.training.loop import Run
    from roletrust_experiments.training.settings import make_settings

    torch.set_num_threads(threads)
    run = None
    if task is not None:
        task_id = find_task(task)
        changes = parse_settings(learner or [], "--learner")
        tuned = make_settings(task_id, algo.value, {**changes, **({"steps": steps} if steps else {})})
        defaults = TASKS[task_id].defaults
        rules = make_scenario(scenario or defaults["scenario"])
        if fields := parse_settings(settings or []):
            rules = rules.change(**fields)
        run = Run(
            algo=algo.value,
            steps=tuned.steps,
            seed=seed,
            settings=tuned.model_dump(mode="json"),
            task=TaskCard(
                id=task_id,
                compromised=tuple(compromised or defaults["compromised"]),
                objective=objective.value if objective else defaults["objective"],
                stealth=Price(weight=stealth_weight, tolerance=stealth_tolerance),
                knowledge=knowledge.value,
                accomplices=tuple(accomplice or ()),
            ),
            trust_model=_model_card(trust_model, rules),
            scenario=rules,
        )
    asked = [run.model_copy(update={"seed": seed + k}) if run else None for k in range(runs)]
    folders = [RunFolder(out / f"seed-{seed + k}" if runs > 1 else out) for k in range(runs)]
    for one, folder in [(_which(*pair, resume), pair[1]) for pair in zip(asked, folders, strict=True)]:
        try:
            _train(one, folder)
        except KeyboardInterrupt:
            again = f"--resume --out {out}" if runs == 1 else "the same command and --resume"
            errors.print(f"Stopped; what is trained is kept: go on by roletrust train {again}", soft_wrap=True)
            raise typer.Exit(130) from None


def _which(asked: "Run | None", folder: RunFolder, resume: bool) -> "Run":
    """The run to train in a folder: what is asked for, or what the folder holds.

    Raises:
        ValueError: there is none and none is asked for, or there is one that is not to be gone on with.
    """
    from roletrust_experiments.training.loop import Run

    config, out = folder.config(), folder.path
    if config is None:
        if asked is None:
            several = next(out.parent.glob("seed-*") if out.name.startswith("seed-") else out.glob("seed-*"), None)
            how = "give the whole command again, with --resume" if several else "name a task to begin one"
            raise ValueError(f"there is no run in {out} to go on with; {how}" if resume else "name a task")
        return asked
    found = Run.read(config.get("run"))
    if not resume:
        raise ValueError(f"{out} holds a run; go on with it by --resume, or choose another --out")
    if asked is not None and asked != found:
        raise ValueError(f"{out} holds another run, see its config.json; leave the task out to go on with that one")
    return found


def _train(run: "Run", folder: RunFolder) -> None:
    """Train a run, or go on with it."""
    from roletrust_agents.learned.saved import task_from_card

    from roletrust_experiments.training.loop import MANY, game_memory, versions
    from roletrust_experiments.training.loop import train as learn

    games = run.settings["games"]
    if games > MANY:
        check_memory("--learner games", games, game_memory(run))
    game = task_from_card(run.task, run.trust_model, run.scenario).game  # before anything is written of a wrong one
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
            f"--trust-model {text}: a saved attacker tells its trust model by name, and no code is run to find it; "
            f"declare the model as an entry point in the group {trust_models.group!r}"
        )
    return ModelCard(name=name, parameters=parameters)


def _bar() -> Progress:
    """A progress bar that shows the score."""
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TaskProgressColumn(),
        TimeRemainingColumn(),
        TextColumn("score [bold]{task.fields[score]}"),
    )
    return progress_bar(columns=columns)


def _show(progress: Progress, job: Any, report: "Report") -> None:
    score = (
        f"{report.curve[-1].score:.4f}, best {max(point.score for point in report.curve):.4f}"
        if report.curve
        else "..."
    )
    progress.update(job, completed=report.steps, score=score)


def _write(out: Path, run: "Run", attacker: "SavedAttacker", curve: "list[Point]") -> None:
    from roletrust_agents.learned import save_attacker

    from roletrust_experiments.plots.learning import learning_figure

    write_csv(out / "curve.csv", ("steps", "seconds", "score", "half_95"), curve)
    write_figure(out / "curve.png", learning_figure(run.algo, attacker, curve))
    save_attacker(attacker, out / "attacker", write_bytes)
