"""Training of an attacker, from a configuration over checkpoints to a saved attacker."""

import json
import warnings
from collections.abc import Callable, Iterator
from importlib.metadata import version
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
from pydantic import BaseModel, ConfigDict, ValidationError
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.buffers import ReplayBuffer
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import configure

from roletrust_agents.learned.cards import (
    Card,
    InputCard,
    ModelCard,
    ScoreCard,
    TaskCard,
    TrainingCard,
    observation_fields,
)
from roletrust_agents.learned.network import Network
from roletrust_agents.learned.policy import play_task
from roletrust_agents.learned.saved import SavedAttacker, digest, read_weights, task_from_card, weights_bytes
from roletrust_agents.training.experience import Narrowing, StaggeredGames
from roletrust_agents.training.learners import (
    make_model,
    network_of,
    normalising_rounds,
    parameters_bytes,
    set_parameters,
)
from roletrust_agents.training.runs import Checkpoint, RunFolder
from roletrust_agents.training.settings import Algo, OnPolicySettings, make_settings
from roletrust_env import Scenario, __version__
from roletrust_env.errors import explain
from roletrust_env.evaluation.resources import some, try_out
from roletrust_env.game.attack_task import AttackTask
from roletrust_env.metrics.confidence import over_games

_EVALUATIONS = 20
"""Number of measurements of the score during training."""

_GAMES, _LAST_GAMES = 16, 256
"""Numbers of held-out games: for a score during training, which chooses the best network, and for the last score."""

MANY = 1000
"""Number of games of a learner that fits into any memory."""

_FEW = 4  # games of a learner that is made to measure its memory


class Run(BaseModel):
    """Everything that determines the result of a training run, except the software."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    algo: Algo
    steps: int
    seed: int
    settings: dict[str, Any]
    task: TaskCard
    trust_model: ModelCard
    scenario: Scenario

    @classmethod
    def read(cls, data: Any) -> "Run":
        """Return a run from the output of `model_dump`.

        Raises:
            ValueError: A field is missing or not allowed.
        """
        try:
            return cls.model_validate_json(json.dumps(data))  # strict, but for JSON's lists
        except ValidationError as error:
            raise ValueError(f"the run folder's config.json: {explain(error)}") from None


class Point(NamedTuple):
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


class Report(NamedTuple):
    """Progress of the training."""

    steps: int
    curve: list[Point]


OnReport = Callable[[Report], None]


def train(run: Run, folder: RunFolder, on_report: OnReport) -> tuple[SavedAttacker, list[Point]]:
    """Train from the folder's last checkpoint, or from the beginning, to the end.

    Args:
        run: Run to train.
        folder: Folder for checkpoints and the log of TensorBoard.
        on_report: Called with the progress after every rollout.

    Returns:
        The attacker with the best score during training, measured again in new games, and the learning curve.
    """
    task = task_from_card(run.task, run.trust_model, run.scenario)
    settings = make_settings(run.task.id, run.algo, run.settings)
    env = StaggeredGames(task, settings.games)
    model = make_model(run.algo, settings, env, run.seed)
    watch = _Watch(run, task, folder, on_report)
    last = folder.last()
    if last is not None:
        watch.take_up(last, model)
    model.set_random_seed(int(np.random.SeedSequence([run.seed, 0, model.num_timesteps]).generate_state(1)[0]))
    model.set_logger(configure(str(folder.path / "tensorboard"), ["tensorboard"]))
    if model.num_timesteps < run.steps:
        callbacks: list[BaseCallback] = [watch]
        if isinstance(settings, OnPolicySettings) and settings.log_std_last is not None:
            callbacks.append(Narrowing(settings.log_std_init, settings.log_std_last, run.steps))
        model.learn(run.steps - model.num_timesteps, callback=callbacks, reset_num_timesteps=last is None)
    return _finish(run, task, watch.best(), watch.curve), watch.curve


def game_memory(run: Run) -> float:
    """Return the memory of each game of the learner in bytes: to play, and twice the data that an update needs."""
    task = task_from_card(run.task, run.trust_model, run.scenario)
    settings = make_settings(run.task.id, run.algo, run.settings).model_copy(update={"games": _FEW})

    def played(games: int) -> Iterator[object]:
        env = StaggeredGames(task, games)
        yield env.reset()
        while True:
            yield env.step(np.zeros((games, task.action_size), np.float32))

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # batches that do not fit so few games
        model = make_model(run.algo, settings, StaggeredGames(task, _FEW), run.seed)
    kept = getattr(model, "rollout_buffer", None)
    buffers = [part.nbytes for part in vars(kept).values() if isinstance(part, np.ndarray)] if kept else []
    return try_out(played, some(task.game)).memory + 2 * sum(buffers) / _FEW


class _Watch(BaseCallback):
    """Callback that measures the score, reports progress and saves checkpoints."""

    def __init__(self, run: Run, task: AttackTask, folder: RunFolder, on_report: OnReport) -> None:
        super().__init__()
        self.curve: list[Point] = []
        self._run, self._task, self._folder, self._on_report = run, task, folder, on_report
        self._best: Network | None = None
        self._seconds_before = 0.0
        self._began = perf_counter()
        self._every = max(1, run.steps // _EVALUATIONS)

    def best(self) -> Network:
        """Return the network with the best score so far."""
        return self._best if self._best is not None else network_of(self.model)

    def take_up(self, checkpoint: Checkpoint, model: BaseAlgorithm) -> None:
        """Continue from a checkpoint."""
        set_parameters(model, checkpoint.files["parameters.pt"])
        model.num_timesteps = checkpoint.steps
        model._n_updates = checkpoint.notes["updates"]
        if isinstance(buffer := getattr(model, "replay_buffer", None), ReplayBuffer):
            _fill(buffer, checkpoint)
        self.curve = [Point(*row) for row in checkpoint.notes["curve"]]
        self._seconds_before = self.curve[-1].seconds
        now, weights = network_of(model), read_weights(checkpoint.files["best.safetensors"])
        self._best = Network(now.architecture, now.mean, now.variance, weights)

    def _on_rollout_start(self) -> None:
        """Measure when it is time; the learner has just been updated, or has not begun."""
        if self.num_timesteps > 0 and self.num_timesteps >= self._due():
            self._measure()
        self._on_report(Report(self.num_timesteps, self.curve))

    def _on_training_end(self) -> None:
        if not self.curve or self.curve[-1].steps < self.num_timesteps:
            self._measure()
        self._on_report(Report(self.num_timesteps, self.curve))

    def _on_step(self) -> bool:
        return True

    def _due(self) -> int:
        return (self.curve[-1].steps if self.curve else 0) + self._every

    def _measure(self) -> None:
        """Measure the score of the current network, and save a checkpoint."""
        seconds = self._seconds_before + perf_counter() - self._began
        network = network_of(self.model)
        scores = over_games(_play(self._task, network, games=_GAMES, key=(self._run.seed, 1)))
        point = Point(self.num_timesteps, seconds, float(scores.mean), float(scores.half))
        if not self.curve or point.score > max(point.score for point in self.curve):
            self._best = network
        self.curve.append(point)
        self.logger.record("eval/score", point.score)
        files = {"parameters.pt": parameters_bytes(self.model), "best.safetensors": weights_bytes(self.best())}
        if isinstance(buffer := getattr(self.model, "replay_buffer", None), ReplayBuffer):
            files |= {f"replay.{name}": np.ascontiguousarray(getattr(buffer, name)).tobytes() for name in _REPLAY}
        notes = {"updates": self.model._n_updates, "curve": [list(point) for point in self.curve]}
        if isinstance(buffer, ReplayBuffer):
            notes |= {"position": buffer.pos, "full": buffer.full}
        self._folder.save(Checkpoint(self.num_timesteps, files, notes))


_REPLAY = ("observations", "next_observations", "actions", "rewards", "dones", "timeouts")


def _fill(buffer: ReplayBuffer, checkpoint: Checkpoint) -> None:
    """Restore the replay buffer."""
    buffer.pos, buffer.full = checkpoint.notes["position"], checkpoint.notes["full"]
    for name in _REPLAY:
        rows = getattr(buffer, name)
        rows[:] = np.frombuffer(checkpoint.files[f"replay.{name}"], rows.dtype).reshape(rows.shape)


def _play(task: AttackTask, network: Network | None, *, games: int, key: tuple[int, int]) -> Any:
    """Return the scores of games; `key` separates training, scores during training and last scores."""
    return play_task(task, network, games=games, seed=int(np.random.SeedSequence(key).generate_state(1)[0]))


def _finish(run: Run, task: AttackTask, network: Network, curve: list[Point]) -> SavedAttacker:
    """Return the attacker with its card, measured in games that chose nothing."""
    key = (run.seed, 2)
    scores = over_games(_play(task, network, games=_LAST_GAMES, key=key))
    honest = over_games(_play(task, None, games=_LAST_GAMES, key=key))
    played = curve[-1].steps + len(curve) * _GAMES * run.scenario.max_cycles + normalising_rounds(task)
    card = Card(
        package_version=__version__,
        task=run.task,
        trust_model=run.trust_model,
        scenario=run.scenario,
        observation=InputCard(
            fields=observation_fields(
                run.scenario, run.task.compromised, run.task.knowledge, network.architecture.inputs
            ),
            mean=tuple(network.mean.tolist()),
            variance=tuple(network.variance.tolist()),
        ),
        architecture=network.architecture,
        training=TrainingCard(
            algorithm=run.algo,
            steps=run.steps,
            rounds=played,
            seed=run.seed,
            seconds=round(curve[-1].seconds, 1),
            settings={name: _plain(value) for name, value in run.settings.items()},
            versions=versions(),
        ),
        score=ScoreCard(
            mean=float(scores.mean),
            half_95=float(scores.half),
            games=_LAST_GAMES,
            seed=int(np.random.SeedSequence(key).generate_state(1)[0]),
            honest=float(honest.mean),
        ),
        weights_sha256=digest(weights_bytes(network)),
    )
    return SavedAttacker(card, network)


def _plain(value: Any) -> int | float | str:
    return value if isinstance(value, int | float) else str(value)


def versions() -> dict[str, str]:
    """Return the versions of the packages that affect training."""
    return {name: version(name) for name in ("torch", "stable-baselines3", "sb3-contrib", "gymnasium", "numpy")}
