"""Training an attacker: from a configuration to a saved attacker, by way of checkpoints."""

import json
import warnings
from collections.abc import Callable, Iterator
from importlib.metadata import version
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
from pydantic import BaseModel, ConfigDict, ValidationError
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
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.buffers import ReplayBuffer
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import configure

from roletrust_env import Scenario, __version__
from roletrust_env.errors import explain
from roletrust_env.evaluation.resources import some, try_out
from roletrust_env.game.attack_task import AttackTask
from roletrust_env.metrics.confidence import over_games
from roletrust_experiments.training.experience import Narrowing, StaggeredGames
from roletrust_experiments.training.learners import (
    make_model,
    network_of,
    normalising_rounds,
    parameters_bytes,
    set_parameters,
)
from roletrust_experiments.training.runs import Checkpoint, RunFolder
from roletrust_experiments.training.settings import Algo, OnPolicySettings, make_settings

_EVALUATIONS = 20
"""How often the score is measured on the way."""

_GAMES, _LAST_GAMES = 16, 256
"""Held-out games that a score on the way, by which the best is chosen, and the last one, is measured in."""

MANY = 1000
"""Games of a learner that any memory holds."""

_FEW = 4  # games that a learner is made for, only to see what it keeps of them


class Run(BaseModel):
    """All that decides what comes out of a training run, but for the software."""

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
        """A run of what `model_dump` made of it.

        Raises:
            ValueError: something is missing or not allowed.
        """
        try:
            return cls.model_validate_json(json.dumps(data))  # strict, but for JSON's lists
        except ValidationError as error:
            raise ValueError(f"the run folder's config.json: {explain(error)}") from None


class Point(NamedTuple):
    """A point of the learning curve.

    Attributes:
        steps: rounds played so far.
        seconds: of training so far, of all its parts if it was interrupted.
        score: mean reward per round in held-out games, without exploration.
        half_95: half the 95% confidence interval; NaN of one game.
    """

    steps: int
    seconds: float
    score: float
    half_95: float


class Report(NamedTuple):
    """How far training is."""

    steps: int
    curve: list[Point]


Tell = Callable[[Report], None]


def train(run: Run, folder: RunFolder, tell: Tell) -> tuple[SavedAttacker, list[Point]]:
    """Train from the folder's last checkpoint, or from the beginning, to the end.

    Args:
        run: what to train.
        folder: for checkpoints and TensorBoard's log.
        tell: is told how far it is after every rollout.

    Returns:
        The attacker that scored best on the way, with a score in games of their own luck; and the learning curve.
    """
    task = task_from_card(run.task, run.trust_model, run.scenario)
    settings = make_settings(run.task.id, run.algo, run.settings)
    env = StaggeredGames(task, settings.games)
    model = make_model(run.algo, settings, env, run.seed)
    watch = _Watch(run, task, folder, tell)
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
    """The memory that each of the learner's games takes, bytes: to play, and twice what is kept of it for an update."""
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
    """Measures, tells and keeps checkpoints."""

    def __init__(self, run: Run, task: AttackTask, folder: RunFolder, tell: Tell) -> None:
        super().__init__()
        self.curve: list[Point] = []
        self._run, self._task, self._folder, self._tell = run, task, folder, tell
        self._best: Network | None = None
        self._seconds_before = 0.0
        self._began = perf_counter()
        self._every = max(1, run.steps // _EVALUATIONS)

    def best(self) -> Network:
        """The network that scored best so far."""
        return self._best if self._best is not None else network_of(self.model)

    def take_up(self, checkpoint: Checkpoint, model: BaseAlgorithm) -> None:
        """Go on from a checkpoint."""
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
        """The learner has just been updated, or has not begun."""
        if self.num_timesteps > 0 and self.num_timesteps >= self._due():
            self._measure()
        self._tell(Report(self.num_timesteps, self.curve))

    def _on_training_end(self) -> None:
        if not self.curve or self.curve[-1].steps < self.num_timesteps:
            self._measure()
        self._tell(Report(self.num_timesteps, self.curve))

    def _on_step(self) -> bool:
        return True

    def _due(self) -> int:
        return (self.curve[-1].steps if self.curve else 0) + self._every

    def _measure(self) -> None:
        """Score the learner as it is now, and keep a checkpoint."""
        seconds = self._seconds_before + perf_counter() - self._began
        network = network_of(self.model)
        scores = over_games(_play(self._task, network, games=_GAMES, luck=(self._run.seed, 1)))
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
    """Put back what the learner remembers."""
    buffer.pos, buffer.full = checkpoint.notes["position"], checkpoint.notes["full"]
    for name in _REPLAY:
        rows = getattr(buffer, name)
        rows[:] = np.frombuffer(checkpoint.files[f"replay.{name}"], rows.dtype).reshape(rows.shape)


def _play(task: AttackTask, network: Network | None, *, games: int, luck: tuple[int, int]) -> Any:
    """The scores of some games; `luck` keeps training, scores on the way and last scores apart."""
    return play_task(task, network, games=games, seed=int(np.random.SeedSequence(luck).generate_state(1)[0]))


def _finish(run: Run, task: AttackTask, network: Network, curve: list[Point]) -> SavedAttacker:
    """The attacker with its card, scored in games that nothing was chosen by."""
    luck = (run.seed, 2)
    scores = over_games(_play(task, network, games=_LAST_GAMES, luck=luck))
    honest = over_games(_play(task, None, games=_LAST_GAMES, luck=luck))
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
            seed=int(np.random.SeedSequence(luck).generate_state(1)[0]),
            honest=float(honest.mean),
        ),
        weights_sha256=digest(weights_bytes(network)),
    )
    return SavedAttacker(card, network)


def _plain(value: Any) -> int | float | str:
    return value if isinstance(value, int | float) else str(value)


def versions() -> dict[str, str]:
    """The packages that decide what is learned."""
    return {name: version(name) for name in ("torch", "stable-baselines3", "sb3-contrib", "gymnasium", "numpy")}
