"""`roletrust train`: train an attacker."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from roletrust_experiments.commands.console import errors, progress_bar, tell
from roletrust_experiments.commands.extras import require
from roletrust_experiments.commands.options import (
    NAMED,
    Out,
    Seed,
    further_arguments,
    keyword_option,
)
from roletrust_experiments.plots.figure_files import write_figure

if TYPE_CHECKING:
    from roletrust_agents.training.runs import TrainingReport

_TASK = {
    "scenario": "name or file in place of the task's own",
    "compromised": 'agents of the attacker, such as ["sr_2"]',
    "objective": "damage, exploit, promote or mislead",
    "accomplices": "providers of promote",
    "stealth": "price of a trust gap, such as {weight = 2.0}",
    "knowledge": "black_box, grey_box or white_box",
    "consumers": "public, raters or received",
}


def train(
    task: Annotated[
        str,
        typer.Argument(
            help="ProviderAttack, RaterAttack, DualAttack or CollusionAttack; or a setting of a "
            "suite, such as standard:coalition, with all its selection worlds."
        ),
    ],
    learner: Annotated[
        str | None,
        typer.Option(
            metavar=NAMED,
            help="PPO, SAC or recurrent-PPO; for coalitions evolution, evolution-strategy "
            "or coalition-PPO. By default PPO, and evolution in the worlds of a suite.",
        ),
    ] = None,
    model: Annotated[
        list[str],
        typer.Option(metavar=NAMED, help="Trust model; repeat for more, against coalitions."),
    ] = ["role-trust"],  # noqa: B006 - typer copies it
    settings: Annotated[
        list[str] | None,
        keyword_option("--set", {**_TASK, "FIELD": "a field of the scenario, as in play"}),
    ] = None,
    steps: Annotated[
        int | None, typer.Option(min=1, help="Minimum number of rounds; by default the tuned one.")
    ] = None,
    seed: Seed = 0,
    out: Out = Path("results/train"),
) -> None:
    """Train [bold]an attacker[/] by reinforcement learning or evolution, and save it to play it
    anywhere.

    Written: [green]attacker.json attacker.safetensors curve.csv curve.png config.json[/],
    checkpoints, and, except by learners of coalitions, a log for TensorBoard. The score is the mean
    reward per round in held-out games, in which the best script plays, too. Ctrl-C ends a run
    early: the best attacker so far is saved and scored. The same command continues the run.

    [bold]Examples[/]

    [dim]# a provider that sells bad service while it is trusted[/]
    [cyan]roletrust train ProviderAttack --set max_cycles=200[/]

    [dim]# a rater that lies without being detected, and a game with it[/]
    [cyan]roletrust train RaterAttack --set 'stealth={weight=2.0}' --out results/rater[/]
    [cyan]roletrust play --attack sr_2=learned:path=results/rater[/]

    [dim]# another learner, with settings of its own[/]
    [cyan]roletrust train RaterAttack --learner SAC:gamma=0.9,gradient_steps=2 --out results/sac[/]

    [dim]# a coalition for the worlds of the benchmark, and its measurement[/]
    [cyan]roletrust train standard:coalition --model block --out results/mine[/]
    [cyan]roletrust benchmark block --attack learned:path=results/mine[/]
    """
    packages = "torch", "stable_baselines3", "sb3_contrib", "safetensors", "tensorboard"
    require("training", "train", *packages)
    from roletrust_agents.training.train import train as train_attacker
    from roletrust_experiments.plots.learners import learning_figure

    arguments = further_arguments(settings, train_attacker)
    with progress_bar() as progress:
        job = progress.add_task(task, total=steps)

        def show(report: "TrainingReport") -> None:
            scores = [point.score for point in report.curve]
            score = f": score {scores[-1]:.4f}, best {max(scores):.4f}" if scores else ""
            progress.update(
                job, completed=report.steps, total=report.total, description=task + score
            )

        try:
            training = train_attacker(
                task,
                learner=learner,
                steps=steps,
                model=model,
                seed=seed,
                out=out,
                on_report=show,
                **arguments,
            )
        except KeyboardInterrupt:
            tell("Stopped before the first score, or while it was taken.", where=errors)
            raise typer.Exit(130) from None
    attacker = training.attacker
    write_figure(
        out / "curve.png",
        learning_figure(attacker.card.training.algorithm, attacker, training.curve),
    )
    for line in training.summary().splitlines():
        tell(line)
    tell(f"Written to {out}: attacker.json, attacker.safetensors, curve.csv, curve.png")
    if not training.completed:
        tell("Stopped. The same command continues.", where=errors)
        raise typer.Exit(130)
