"""Folders of training runs, and what a run is."""

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from importlib.metadata import version
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
from pydantic import Field, ValidationError

from roletrust_agents.learned.cards import (
    Card,
    Count,
    InputCard,
    ModelCard,
    ScoreCard,
    TaskCard,
    TrainingCard,
    observation_fields,
)
from roletrust_agents.learned.deep_set import DeepSet
from roletrust_agents.learned.network import Network
from roletrust_agents.learned.policy import play_task
from roletrust_agents.learned.saved import SavedAttacker, digest
from roletrust_agents.learned.weights import weights_bytes
from roletrust_agents.training.settings import Algo
from roletrust_env import Scenario, __version__
from roletrust_env.envs.arguments import Engine
from roletrust_env.envs.task_batch import compile_batch
from roletrust_env.errors import short, validation_message
from roletrust_env.game.attack_task import AttackTask
from roletrust_env.metrics.confidence import GameMean, over_games
from roletrust_env.storage.arrays import load_arrays, save_arrays
from roletrust_env.storage.files import (
    clear_unfinished,
    prepare_folder,
    replacing,
    write_json,
)
from roletrust_env.storage.untrusted import UntrustedModel, parse_json

_KEPT = 2
"""Number of checkpoints on disk: the last one, and one to fall back on if the last is damaged."""

_NOTES = "notes.json"


class Checkpoint(NamedTuple):
    """State from which training continues.

    Attributes:
        steps: Number of rounds so far.
        files: Contents of its files by name.
        notes: Plain data.
    """

    steps: int
    files: Mapping[str, bytes]
    notes: Mapping[str, Any]


class RunFolder:
    """The files of one run.

    Args:
        path: Path of the folder; it is created when something is written.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._checkpoints = path / "checkpoints"

    def config(self) -> dict[str, Any] | None:
        """Return the configuration of the run; None in a new folder.

        Raises:
            ValueError: The file is broken.
        """
        file = self.path / "config.json"
        if not file.exists():
            return None
        try:
            config = parse_json(file.read_bytes())
        except ValueError as error:
            raise ValueError(
                f"{file} is broken ({error}); start again with another --out"
            ) from None
        if not isinstance(config, dict):
            raise ValueError(f"{file} holds no run; start again with another --out")
        return config

    def run(self, planned: "Run") -> "Run":
        """Return the planned run, or the same one that the folder holds, with its engine.

        Raises:
            ValueError: The folder holds another run.
        """
        config = self.config()
        if config is None:
            return planned
        run = Run.read(config.get("run"))
        fields = run.model_dump(mode="json", exclude={"engine"})
        wanted = planned.model_dump(mode="json", exclude={"engine"})
        if different := [name for name in fields if fields[name] != wanted[name]]:
            raise ValueError(
                f"{self.path} holds another run (not the same: {', '.join(different)}); choose "
                "another --out"
            )
        return run

    def prepare(self) -> None:
        """Check that the run can be written, and remove unfinished files of a killed run.

        Raises:
            OSError: The folder cannot be written.
        """
        prepare_folder(self.path)
        clear_unfinished(self._checkpoints)

    def begin(self, config: Mapping[str, Any]) -> None:
        """Write the configuration of the run."""
        write_json(self.path / "config.json", config)

    def save(self, checkpoint: Checkpoint) -> None:
        """Add a checkpoint, either complete or not at all, and remove all but the last two."""
        files = {**checkpoint.files, _NOTES: json.dumps(checkpoint.notes).encode()}
        arrays = {name: np.frombuffer(data, np.uint8) for name, data in files.items()}
        save_arrays(self._checkpoints / f"{checkpoint.steps:012d}.npz", arrays)
        for old in self._found()[_KEPT:]:
            old.unlink()

    def last(self) -> Checkpoint | None:
        """Return the newest undamaged checkpoint; None if there is none."""
        for path in self._found():
            with suppress(ValueError, OSError):
                files = {name: data.tobytes() for name, data in load_arrays(path).items()}
                notes = json.loads(files.pop(_NOTES))
                return Checkpoint(int(path.stem), files, notes)
        return None

    @contextmanager
    def restoring(self) -> Iterator[Checkpoint | None]:
        """Yield the last checkpoint, from which the run is restored in the context; None if there
        is none.

        Raises:
            ValueError: It cannot be. Its checksums are right, so it is of another run.
        """
        try:
            yield self.last()
        except Exception as error:  # torch raises many kinds
            raise ValueError(
                f"the checkpoints in {self.path} are not of this run ({type(error).__name__}: "
                f"{short(str(error).partition(chr(10))[0])}); start again with another --out"
            ) from None

    def _found(self) -> list[Path]:
        """Return the files of checkpoints, the newest first."""
        return sorted(self._checkpoints.glob("[0-9]*.npz"), reverse=True)


def write_bytes(path: Path, data: bytes) -> None:
    """Write a file whole or not at all."""
    with replacing(path) as temporary:
        temporary.write_bytes(data)


GAMES = 16
"""Number of held-out games for a score during training, which chooses the best network."""

_LAST_GAMES = 256  # for the last score


class Run(UntrustedModel):
    """Everything that determines the result of a training run, except the software."""

    algo: Algo
    steps: Annotated[int, Field(ge=1, le=10**12)]
    seed: Count
    settings: dict[str, Any]
    task: TaskCard
    trust_model: ModelCard
    further_models: tuple[ModelCard, ...] = ()
    scenario: Scenario
    engine: Engine = "rules"

    @classmethod
    def read(cls, data: Any) -> "Run":
        """Return a run from the output of `model_dump`.

        Raises:
            ValueError: A field is missing or not allowed.
        """
        try:
            return cls.model_validate_json(json.dumps(data))  # strict, but for JSON's lists
        except ValidationError as error:
            raise ValueError(f"the run folder's config.json: {validation_message(error)}") from None


def fastest_engine(task: AttackTask) -> Engine:
    """Return the fastest engine for batches of a task."""
    try:
        compile_batch(task)
    except ValueError:
        return "rules"
    return "compiled"


class CurvePoint(NamedTuple):
    """A point of the learning curve.

    Attributes:
        steps: Number of rounds so far.
        seconds: Training time so far, including the time before interruptions.
        score: Mean reward per round in held-out games, without exploration.
        half_95: Half the 95% confidence interval; NaN for one game.
    """

    steps: int
    seconds: float
    score: float
    half_95: float


class TrainingReport(NamedTuple):
    """Progress of the training.

    Attributes:
        steps: Number of rounds so far.
        total: Number of rounds after which the training ends.
        curve: Learning curve so far.
    """

    steps: int
    total: int
    curve: list[CurvePoint]


OnReport = Callable[[TrainingReport], None]


@contextmanager
def interruptible(curve: Sequence[CurvePoint]) -> Iterator[None]:
    """Let Ctrl-C end the context without an error, unless the learning curve is empty."""
    try:
        yield
    except KeyboardInterrupt:
        if not curve:
            raise


def score_of(task: AttackTask, network: Network | DeepSet, seed: int) -> GameMean:
    """Return the score of a network during training."""
    return over_games(_play(task, network, games=GAMES, key=(seed, 1)))


def _play(
    task: AttackTask, network: Network | DeepSet | None, *, games: int, key: tuple[int, int]
) -> Any:
    """Return the scores of games; `key` separates training, scores during training and last
    scores.
    """
    return play_task(
        task, network, games=games, seed=int(np.random.SeedSequence(key).generate_state(1)[0])
    )


def finish(
    run: Run,
    tasks: Sequence[AttackTask],
    network: Network | DeepSet,
    curve: list[CurvePoint],
    rounds: int,
) -> SavedAttacker:
    """Return the attacker with its card, measured in games that chose nothing.

    Args:
        run: Run that has ended, or was stopped after its last point of the curve.
        tasks: Tasks of the run, which share its last games.
        network: Network that was found.
        curve: Learning curve.
        rounds: Number of all rounds that were played.
    """
    key, each = (run.seed, 2), _LAST_GAMES // len(tasks)
    scores, honest = (
        over_games(np.concatenate([_play(task, who, games=each, key=key) for task in tasks]))
        for who in (network, None)
    )
    card = Card(
        package_version=__version__,
        task=run.task,
        trust_model=run.trust_model,
        further_models=run.further_models,
        scenario=run.scenario,
        observation=_input_card(run, network) if isinstance(network, Network) else None,
        architecture=network.architecture,
        training=TrainingCard(
            algorithm=run.algo,
            steps=min(run.steps, curve[-1].steps),
            rounds=rounds,
            seed=run.seed,
            seconds=round(curve[-1].seconds, 1),
            settings={name: _plain(value) for name, value in run.settings.items()},
            versions=versions(),
        ),
        score=ScoreCard(
            mean=float(scores.mean),
            half_95=float(scores.half),
            games=each * len(tasks),
            seed=int(np.random.SeedSequence(key).generate_state(1)[0]),
            honest=float(honest.mean),
        ),
        weights_sha256=digest(weights_bytes(network)),
    )
    return SavedAttacker(card, network)


def _input_card(run: Run, network: Network) -> InputCard:
    fields = observation_fields(
        run.scenario, run.task.compromised, run.task.knowledge, network.architecture.inputs
    )
    return InputCard(
        fields=fields, mean=tuple(network.mean.tolist()), variance=tuple(network.variance.tolist())
    )


def _plain(value: Any) -> int | float | str:
    return value if isinstance(value, int | float) else str(value)


def versions() -> dict[str, str]:
    """Return the versions of the packages that affect training."""
    return {
        name: version(name)
        for name in ("torch", "stable-baselines3", "sb3-contrib", "gymnasium", "numpy")
    }
