"""`roletrust train`: train an attacker, in a folder that holds all that an interrupted run needs to
continue.
"""

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from roletrust_env import Scenario, make_scenario, scenarios
from roletrust_env.benchmarking.suite_files import setting_worlds
from roletrust_env.envs.attack_env import TASKS
from roletrust_env.errors import suggest
from roletrust_env.evaluation.specs import (
    parse_parameters,
    parse_settings,
    read_trust_model,
    value_text,
)
from roletrust_env.game.attack_task import Consumers, Knowledge, Objective
from roletrust_env.storage.files import write_csv
from roletrust_env.storage.provenance import provenance
from roletrust_env.trust.model import registry as trust_models
from roletrust_experiments.commands.console import errors, progress_bar, tell
from roletrust_experiments.commands.extras import require
from roletrust_experiments.commands.options import (
    NAMED,
    Out,
    Seed,
    SettingsOption,
    find_task,
    given_options,
    task_names,
)
from roletrust_experiments.plots.figure_files import write_figure

if TYPE_CHECKING:
    from roletrust_agents.learned.cards import ModelCard
    from roletrust_agents.training.runs import Run, RunFolder, TrainingReport

_COALITIONS = ("evolution", "evolution-strategy", "gradients", "coalition-PPO")
"""Learners of the network of a coalition."""

_ALGORITHMS = ("PPO", "SAC", "recurrent-PPO", *_COALITIONS)
"""Names of the learners; in configurations and saved attackers they are in small letters."""


def train(
    context: typer.Context,
    task: Annotated[
        str | None,
        typer.Argument(
            help=(
                f"Attack task: {', '.join(task_names())}; or a setting of a suite, such as "
                "standard:coalition, with all its selection worlds."
            )
        ),
    ] = None,
    learner: Annotated[
        str | None,
        typer.Option(
            metavar=NAMED,
            help=(
                f"Learner, also with settings (gamma=0.9): {', '.join(_ALGORITHMS)}. The "
                "default is PPO, and evolution in the worlds of a suite."
            ),
        ),
    ] = None,
    steps: Annotated[
        int | None,
        typer.Option(
            min=1,
            help="Minimum number of rounds to train for, over all games; the tuned one if left out.",  # noqa: E501
        ),
    ] = None,
    seed: Seed = 0,
    runs: Annotated[
        int,
        typer.Option(
            min=1, help="Number of runs, with this seed and the seeds after it, in folders seed-..."
        ),
    ] = 1,
    out: Out = Path("results/train"),
    scenario: Annotated[
        str | None,
        typer.Option(
            help=(
                "Scenario to play instead of the task's own: a name, or the path of a .toml or "
                ".yaml file."
            )
        ),
    ] = None,
    settings: SettingsOption = None,
    model: Annotated[
        list[str] | None,
        typer.Option(
            metavar=NAMED,
            help="Trust model, role-trust if left out; coalitions train against several.",
        ),
    ] = None,
    compromised: Annotated[
        list[str] | None,
        typer.Option(
            metavar="AGENT",
            help="Agent of the attacker; repeat for more; the task's own if left out.",
        ),
    ] = None,
    objective: Annotated[
        Objective | None, typer.Option(help="Aim of the attacker; the task's own if left out.")
    ] = None,
    accomplice: Annotated[
        list[str] | None,
        typer.Option(
            metavar="AGENT", help="Provider that the objective promote is about; repeat for more."
        ),
    ] = None,
    stealth_weight: Annotated[
        float, typer.Option(min=0, help="Price of a trust gap that gives the attacker away.")
    ] = 0.0,
    stealth_tolerance: Annotated[
        float, typer.Option(min=0, max=1, help="Trust gap that costs nothing.")
    ] = 0.1,
    knowledge: Annotated[
        Knowledge, typer.Option(help="Threat model: what the attacker observes.")
    ] = "black_box",
    consumers: Annotated[
        Consumers,
        typer.Option(help="Consumers: the public by published trust, or raters by their own."),
    ] = "public",
    resume: Annotated[
        bool, typer.Option("--resume", help="Continue the run in --out from its last checkpoint.")
    ] = False,
) -> None:
    r"""Train [bold]an attacker[/] by reinforcement learning, evolution or gradients, and save it to
    play it anywhere.

    Written: [green]attacker.json attacker.safetensors curve.csv curve.png config.json[/],
    checkpoints, and, except by learners of coalitions, a log for TensorBoard. The score is the mean
    reward per round in held-out games, in which the best script plays, too. Ctrl-C ends a run
    early: the best attacker so far is saved and scored. A second Ctrl-C ends at once. A run
    continues with [cyan]--resume --out DIR[/]; to continue several runs, give the whole command
    again with [cyan]--resume[/]. On the same machine, the same seed gives the same result to the
    last bit if the run is not interrupted.

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
    [cyan]roletrust train CollusionAttack --learner evolution-strategy --objective mislead
    --model role-trust[/]

    [dim]# five seeds, for one rung of a ladder[/]
    [cyan]roletrust train CollusionAttack --stealth-weight 2 --runs 5 --out results/colluders[/]

    [dim]# a coalition for the worlds of the benchmark, and its measurement[/]
    [cyan]roletrust train standard:coalition --model block --out results/mine[/]
    [cyan]roletrust benchmark block --attack learned:path=results/mine[/]

    [dim]# play the trained attacker[/]
    [cyan]roletrust play --attack sr_2=learned:path=results/rater[/]
    """
    require(
        "training",
        "train",
        "torch",
        "stable_baselines3",
        "sb3_contrib",
        "safetensors",
        "tensorboard",
    )
    import torch

    from roletrust_agents.learned.cards import Price, TaskCard
    from roletrust_agents.training.runs import Run, RunFolder
    from roletrust_agents.training.settings import make_settings

    torch.set_num_threads(1)  # networks of this size gain little from two
    run = None
    if task is None and not resume:
        raise ValueError(
            f"name a task: {', '.join(task_names())}; or give --resume to continue the run in --out"
        )
    if task is None:
        allowed = ("--out", "--resume", "--runs")  # a run that is continued has its own options
        if wrong := [name for name in given_options(context) if name not in allowed]:
            raise ValueError(
                f"{', '.join(wrong)}: a run that is continued keeps its options; name a task to "
                "begin another"
            )
    if task is not None:
        task_id = task if ":" in task else find_task(task)
        name, changes = parse_parameters(learner or ("evolution" if ":" in task else "PPO"))
        algo: Any = name.lower().replace(" ", "-")
        if algo not in map(str.lower, _ALGORITHMS):
            raise ValueError(f"unknown learner {name!r}{suggest(name, _ALGORITHMS)}")
        defaults = _of_worlds(context, task, algo) if ":" in task else TASKS[task_id].defaults
        tuned = make_settings(task_id, algo, {**changes, **({"steps": steps} if steps else {})})
        rules = make_scenario(scenario or defaults["scenario"])
        if fields := parse_settings(settings or []):
            rules = rules.change(**fields)
        models = [_model_card(model_name, rules) for model_name in model or ["role-trust"]]
        if len(models) > 1 and not _is_coalition(algo):
            many, several = (
                f"--model is given {len(models)} times",
                "train against several trust models",
            )
            raise ValueError(f"{many}; only {', '.join(_COALITIONS)} {several}")
        run = Run(
            algo=algo,
            steps=tuned.steps,
            seed=seed,
            settings=tuned.model_dump(mode="json"),
            task=TaskCard(
                id=task_id,
                compromised=tuple(compromised or defaults["compromised"]),
                objective=objective or defaults["objective"],
                stealth=Price(weight=stealth_weight, tolerance=stealth_tolerance),
                knowledge=knowledge,
                accomplices=tuple(accomplice or ()),
                consumers=defaults.get("consumers", consumers),
            ),
            trust_model=models[0],
            further_models=tuple(models[1:]),
            scenario=rules,
        )
        run = _with_engine(run)
    planned = [run.model_copy(update={"seed": seed + k}) if run else None for k in range(runs)]
    folders = [RunFolder(out / f"seed-{seed + k}" if runs > 1 else out) for k in range(runs)]
    for card, folder in [
        (folder.run(plan, resume), folder) for plan, folder in zip(planned, folders, strict=True)
    ]:
        try:
            completed = _train(card, folder)
        except KeyboardInterrupt:  # before the first score, or again
            completed = False
        if not completed:
            again = (
                shlex.join(["--resume", "--out", str(out)])
                if runs == 1
                else "the same command and --resume"
            )
            words = "Stopped before the first score; nothing is kept."
            if folder.last() is not None:
                words = (
                    f"Stopped. The training so far is kept; continue with: roletrust train {again}"
                )
            tell(words, where=errors)
            raise typer.Exit(130)


def _of_worlds(context: typer.Context, task: str, algo: str) -> dict[str, Any]:
    """Return the arguments of the task in the first world of a setting of a suite.

    Raises:
        ValueError: There is no such setting, the learner trains in one world only, or an option is
            given that the suite decides.
    """
    from roletrust_agents.training.settings import OF_WORLDS

    if algo not in OF_WORLDS:
        raise ValueError(
            f"--learner is {algo}; in the worlds of {task} it must be one of {', '.join(OF_WORLDS)}"
        )
    allowed = ("--learner", "--steps", "--seed", "--runs", "--out", "--model", "--resume")
    if wrong := [name for name in given_options(context) if name not in ("task", *allowed)]:
        raise ValueError(f"{', '.join(wrong)}: the suite decides this; leave it out for {task}")
    world = setting_worlds(task)[0]
    return {
        "scenario": world.scenario,
        "compromised": world.compromised,
        "objective": "mislead",
        "consumers": "received",
    }


def _with_engine(run: "Run") -> "Run":
    """Return a run with the fastest engine, which a line names. Coalitions train by the rules."""
    from roletrust_agents.learned.saved import task_from_card
    from roletrust_agents.training.runs import fastest_engine

    if _is_coalition(run.algo):
        return run
    engine, reason = fastest_engine(task_from_card(run.task, run.trust_model, run.scenario))
    tell(
        f"Engine for training: {engine}{reason and f' ({reason})'}; scores are played by the rules"
    )
    return run.model_copy(update={"engine": engine})


def _is_coalition(algo: str) -> bool:
    return algo in map(str.lower, _COALITIONS)


def _train(run: "Run", folder: "RunFolder") -> bool:
    """Train a run from its last checkpoint or from the beginning, and save and compare the best
    attacker. Return whether the training is completed; Ctrl-C ends it early.
    """
    from roletrust_agents.learned import save_attacker
    from roletrust_agents.learned.saved import task_from_card
    from roletrust_agents.training import coalition_loop, loop
    from roletrust_agents.training.runs import versions, write_bytes
    from roletrust_agents.training.yardsticks import yardsticks
    from roletrust_experiments.plots.learners import learning_figure

    learner = coalition_loop if _is_coalition(run.algo) else loop
    learner.check_games(run)
    game = task_from_card(
        run.task, run.trust_model, run.scenario
    ).game  # raises before anything is written
    folder.prepare()
    if folder.config() is None:
        about = {
            "command": "roletrust train",
            "run": run.model_dump(mode="json"),
            "learner_packages": versions(),
        }
        folder.begin({**about, **provenance(game, run.seed)})
    name = run.task.id.removeprefix("RoleTrust/").removesuffix("-v0")
    title = f"{name}, {run.algo}, seed {run.seed}"
    with progress_bar() as progress:
        job = progress.add_task(title, total=run.steps)

        def show(report: "TrainingReport") -> None:
            scores = [point.score for point in report.curve]
            score = f": score {scores[-1]:.4f}, best {max(scores):.4f}" if scores else ""
            progress.update(job, completed=report.steps, description=title + score)

        attacker, curve = learner.train(run, folder, show)
    write_csv(folder.path / "curve.csv", ("steps", "seconds", "score", "half_95"), curve)
    write_figure(folder.path / "curve.png", learning_figure(run.algo, attacker, curve))
    save_attacker(attacker, folder.path / "attacker", write_bytes)
    score = attacker.card.score
    tell(
        f"{title}: score {score.mean:.4f} ± {score.half_95:.4f} in {score.games} held-out games; "
        f"{attacker.card.training.seconds:.0f} s"
    )
    others = yardsticks(attacker)
    shown = ", ".join(f"{yardstick.name} {yardstick.score:.4f}" for yardstick in others)
    tell(f"In the same games: {shown}")
    tell(f"Written to {folder.path}: attacker.json, attacker.safetensors, curve.csv, curve.png")
    completed: bool = attacker.card.training.steps == run.steps
    script = next((other for other in others if other.is_script), None)
    if completed and script and score.mean - score.half_95 <= script.score:
        tell(
            "The attacker is not better than the script by more than its interval "
            f"({score.mean:.4f} ± {score.half_95:.4f} against {script.score:.4f}): play the "
            f"script, or train longer, such as --steps {2 * run.steps}"
        )
    if (
        len(run.task.compromised) == 1
        and run.task.knowledge == "black_box"
        and run.scenario.name in scenarios()
    ):
        attack = f"{run.task.compromised[0]}=learned:path={value_text(str(folder.path))}"
        tell(
            f"Next: {shlex.join(['roletrust', 'play', run.scenario.name, '--attack', attack, '--video'])}"  # noqa: E501
        )
    return completed


def _model_card(text: str, rules: Scenario) -> "ModelCard":
    from roletrust_agents.learned.cards import ModelCard

    registry, name, parameters = read_trust_model(text, rules)
    if registry is not trust_models:
        raise ValueError(
            f"--model {text}: a saved attacker refers to its trust model by name, so that no code "
            "runs to find it; "
            f"declare the model as an entry point in the group {trust_models.group!r}"
        )
    return ModelCard(name=name, parameters=parameters)
