"""Training of an attacker as one call, in a folder from which an interrupted run continues."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from pydantic import ValidationError

from roletrust_agents.learned.cards import ModelCard, TaskCard
from roletrust_agents.learned.saved import SavedAttacker, save_attacker, task_from_card
from roletrust_agents.training import coalition_loop, loop, yardsticks
from roletrust_agents.training.runs import (
    CurvePoint,
    OnReport,
    Run,
    RunFolder,
    fastest_engine,
    versions,
    write_bytes,
)
from roletrust_agents.training.settings import OF_WORLDS, make_settings
from roletrust_agents.training.yardsticks import Yardstick
from roletrust_env.benchmarking.suite_files import setting_worlds
from roletrust_env.envs.attack_env import TASKS, find_task
from roletrust_env.errors import suggest, validation_message
from roletrust_env.evaluation.specs import parse_parameters, read_trust_model
from roletrust_env.parameters import whole_number
from roletrust_env.storage.files import write_csv, write_lock
from roletrust_env.storage.markdown import ShownAsMarkdown, markdown_table, plain
from roletrust_env.storage.provenance import provenance
from roletrust_env.trust.model import registry as trust_models
from roletrust_env.world import Scenario, make_scenario

_OF_COALITIONS = ("evolution", "evolution-strategy", "coalition-PPO")

_OF_WORLDS = {"objective": "mislead", "consumers": "received"}
"""What the benchmark measures."""

LEARNERS = ("PPO", "SAC", "recurrent-PPO", *_OF_COALITIONS)
"""Names of the learners; those after the first three train the network of a coalition."""


@dataclass(frozen=True, repr=False)
class Training(ShownAsMarkdown):
    """A trained attacker, with its scores.

    Attributes:
        attacker: Attacker with the best score during the training, measured again in new games.
        curve: Learning curve.
        yardsticks: Scores of honest play, of the best script, and of the optimum where it is known,
            in the games of the attacker's own score.
        folder: Folder of the run.
        completed: Whether all rounds were played; else the same call continues.
    """

    attacker: SavedAttacker
    curve: Sequence[CurvePoint]
    yardsticks: Sequence[Yardstick]
    folder: Path
    completed: bool

    @property
    def title(self) -> str:
        """Name of the task, the learner and the seed."""
        card = self.attacker.card
        name = card.task.id.removeprefix("RoleTrust/").removesuffix("-v0")
        return f"{name}, {card.training.algorithm}, seed {card.training.seed}"

    @property
    def script(self) -> Yardstick | None:
        """Best script; None where no script fits."""
        return next((one for one in self.yardsticks if one.is_script), None)

    @property
    def beats_script(self) -> bool:
        """Whether the attacker is better than the best script by more than its interval."""
        score = self.attacker.card.score
        return self.script is None or score.mean - score.half_95 > self.script.score

    def summary(self) -> str:
        """Return the scores in a few sentences."""
        score, seconds = self.attacker.card.score, self.attacker.card.training.seconds
        shown = f"{score.mean:.4f} ± {score.half_95:.4f}"
        others = ", ".join(f"{one.name} {one.score:.4f}" for one in self.yardsticks)
        lines = [
            f"{self.title}: score {shown} in {score.games} held-out games; {seconds:.0f} s.",
            f"In the same games: {others}.",
        ]
        if self.script and self.completed and not self.beats_script:
            lines.append(
                "The attacker is not better than the script by more than its interval: play the "
                "script, or train longer."
            )
        return "\n".join(lines)

    def _repr_markdown_(self) -> str:
        score = self.attacker.card.score
        rows = [("attacker", f"{score.mean:.4f} ± {score.half_95:.4f}")]
        rows += [(plain(one.name), f"{one.score:.4f}") for one in self.yardsticks]
        return markdown_table((plain(self.title), "score"), rows, 1)


def train(
    task: str,
    *,
    learner: str | None = None,
    steps: int | None = None,
    model: str | Sequence[str] = "role-trust",
    seed: int = 0,
    out: str | Path = "results/train",
    on_report: OnReport | None = None,
    **arguments: Any,
) -> Training:
    """Train an attacker by reinforcement learning or evolution, and save it.

    The folder gets `attacker.json` and `attacker.safetensors`, `curve.csv`, `config.json`, and
    checkpoints; learners of Stable-Baselines3 also write a log for TensorBoard. The score is the
    mean reward per round in held-out games. The same call continues an interrupted run. On one
    machine the same seed gives the same attacker to the last bit if the run is not interrupted.
    Ctrl-C ends a run early: the best attacker so far is saved and scored.

    Args:
        task: Id or short name of an attack task, such as `"RaterAttack"`; or a setting of a suite,
            such as `"standard:coalition"`, with all its selection worlds.
        learner: One of `LEARNERS`, also with settings, such as `"SAC:gamma=0.9"`; None is PPO, and
            evolution in the worlds of a suite.
        steps: Minimum number of rounds over all games; None is the tuned number.
        model: Trust model `NAME[:key=value,...]`; several for learners of coalitions.
        seed: Random seed, at least 0.
        out: Folder of the run.
        on_report: Called with the progress after each rollout or generation.
        **arguments: Arguments of the task as for `gymnasium.make`, such as
            `scenario="crowd-10x10"`, `stealth={"weight": 2.0}` or `max_cycles=200`, see
            `make_task`. The worlds of a suite have none.

    Raises:
        ValueError: A name is unknown, a value is not allowed, the folder has another run, or the
            games do not fit into the memory.
        KeyboardInterrupt: Ctrl-C before the first score, or a second one.

    Example:
        >>> import tempfile
        >>> from roletrust_agents import train
        >>> training = train(
        ...     "ProviderAttack",
        ...     learner="PPO:games=8,hidden=[8],n_steps=10,batch_size=40,n_epochs=1",
        ...     steps=80,
        ...     max_cycles=10,
        ...     out=tempfile.mkdtemp(),
        ... )
        >>> training.completed, training.attacker.card.task.compromised
        (True, ('sp_2',))
    """
    torch.set_num_threads(1)  # networks of this size gain little from two
    of_worlds = ":" in task
    name, settings = parse_parameters(
        ("evolution" if of_worlds else "PPO") if learner is None else learner
    )
    algo: Any = name.lower().replace(" ", "-")
    if algo not in map(str.lower, LEARNERS):
        raise ValueError(f"unknown learner {name!r}{suggest(name, LEARNERS)}")
    if of_worlds:
        if algo not in OF_WORLDS:
            raise ValueError(
                f"learner is {name}; in the worlds of {task} it must be one of "
                f"{', '.join(OF_WORLDS)}"
            )
        if arguments:
            raise ValueError(f"{', '.join(arguments)}: the suite decides this for {task}")
        world = setting_worlds(task)[0]
        given: dict[str, Any] = {
            "scenario": world.scenario,
            "compromised": world.compromised,
            **_OF_WORLDS,
        }
    else:
        task = find_task(task)
        given = {**TASKS[task].defaults, **arguments}
    rules = make_scenario(given.pop("scenario"))
    card = _task_card(task, {key: given.pop(key) for key in TaskCard.model_fields if key in given})
    rules = rules.change(**given) if given else rules
    models = [_model_card(each, rules) for each in ([model] if isinstance(model, str) else model)]
    if len(models) != 1 and not (models and _is_coalition(algo)):
        raise ValueError(
            f"model names {len(models)} trust models; it must be one, or several for "
            f"{', '.join(_OF_COALITIONS)}"
        )
    tuned = make_settings(task, algo, {**settings, **({} if steps is None else {"steps": steps})})
    run = Run(
        algo=algo,
        steps=tuned.steps,
        seed=whole_number("seed", seed),
        settings=tuned.model_dump(mode="json"),
        task=card,
        trust_model=models[0],
        further_models=tuple(models[1:]),
        scenario=rules,
    )
    return _train(run, RunFolder(Path(out)), on_report or (lambda report: None))


def _train(run: Run, folder: RunFolder, on_report: OnReport) -> Training:
    """Train a run from its last checkpoint or from the beginning, and save and compare it."""
    learner = coalition_loop if _is_coalition(run.algo) else loop
    learner.check_games(run)
    task = task_from_card(run.task, run.trust_model, run.scenario)
    if not _is_coalition(run.algo):  # coalitions train by the rules
        run = run.model_copy(update={"engine": fastest_engine(task)})
    run = folder.run(run)
    folder.prepare()
    with write_lock(folder.path / "checkpoints"):
        if folder.config() is None:
            about = {"run": run.model_dump(mode="json"), "learner_packages": versions()}
            folder.begin({"command": "roletrust train", **about, **provenance(task.game, run.seed)})
        attacker, curve = learner.train(run, folder, on_report)
        write_csv(folder.path / "curve.csv", CurvePoint._fields, curve)
        save_attacker(attacker, folder.path / "attacker", write_bytes)
    completed = attacker.card.training.steps == run.steps
    return Training(attacker, curve, yardsticks.yardsticks(attacker), folder.path, completed)


def _task_card(task_id: str, fields: Mapping[str, Any]) -> TaskCard:
    """Return the card of a task.

    Raises:
        ValueError: A value is not allowed.
    """
    try:
        return TaskCard.model_validate_json(json.dumps({"id": task_id, **fields}))
    except (ValidationError, TypeError) as error:
        wrong = validation_message(error) if isinstance(error, ValidationError) else str(error)
        raise ValueError(f"task {task_id}: {wrong}") from None


def _model_card(text: str, rules: Scenario) -> ModelCard:
    registry, name, parameters = read_trust_model(text, rules)
    if registry is not trust_models:
        raise ValueError(
            f"model {text}: a saved attacker refers to its trust model by name, so that no code "
            "runs to find it; declare the model as an entry point in the group "
            f"{trust_models.group!r}"
        )
    return ModelCard(name=name, parameters=parameters)


def _is_coalition(algo: str) -> bool:
    return algo in map(str.lower, _OF_COALITIONS)
