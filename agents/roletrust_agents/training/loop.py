"""Training of an attacker by a learner of Stable-Baselines3, with checkpoints from which it
continues.
"""

import warnings
from collections.abc import Iterator
from time import perf_counter

import numpy as np
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.buffers import ReplayBuffer
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import configure

from roletrust_agents.learned.network import Network
from roletrust_agents.learned.saved import SavedAttacker, task_from_card
from roletrust_agents.learned.weights import read_weights, weights_bytes
from roletrust_agents.training.experience import Narrowing, StaggeredGames, update_memory
from roletrust_agents.training.learners import (
    make_model,
    network_of,
    normalising_rounds,
    parameters_bytes,
    set_parameters,
)
from roletrust_agents.training.runs import (
    GAMES,
    Checkpoint,
    CurvePoint,
    OnReport,
    Run,
    RunFolder,
    TrainingReport,
    finish,
    interruptible,
    score_of,
)
from roletrust_agents.training.settings import OnPolicySettings, learner_settings
from roletrust_env.evaluation.resources import trial_size, try_out
from roletrust_env.game.attack_task import AttackTask
from roletrust_env.memory import check_memory

_EVALUATIONS = 20
"""Number of measurements of the score during training."""

MANY = 1000
"""Number of games of a learner that fits into any memory."""

_FEW = 4  # games of a learner that is made to measure its memory


def train(
    run: Run, folder: RunFolder, on_report: OnReport
) -> tuple[SavedAttacker, list[CurvePoint]]:
    """Train from the folder's last checkpoint, or from the beginning, to the end or to Ctrl-C.

    Args:
        run: Run to train.
        folder: Folder for checkpoints and the log of TensorBoard.
        on_report: Called with the progress after every rollout.

    Returns:
        The attacker with the best score during training, measured again in new games, and the
        learning curve.
    """
    task = task_from_card(run.task, run.trust_model, run.scenario)
    settings = learner_settings(run.task.id, run.algo, run.settings)
    env = StaggeredGames(task, settings.games, engine=run.engine)
    model = make_model(run.algo, settings, env, run.seed)
    watch = _Watch(run, task, folder, on_report)
    with folder.restoring() as last:
        if last is not None:
            watch.take_up(last, model)
    model.set_random_seed(
        int(np.random.SeedSequence([run.seed, 0, model.num_timesteps]).generate_state(1)[0])
    )
    model.set_logger(configure(str(folder.path / "tensorboard"), ["tensorboard"]))
    if model.num_timesteps < run.steps:
        callbacks: list[BaseCallback] = [watch]
        if isinstance(settings, OnPolicySettings) and settings.log_std_last is not None:
            callbacks.append(Narrowing(settings.log_std_init, settings.log_std_last, run.steps))
        with interruptible(watch.curve):
            model.learn(
                run.steps - model.num_timesteps,
                callback=callbacks,
                reset_num_timesteps=last is None,
            )
    curve = watch.curve
    rounds = (
        curve[-1].steps + len(curve) * GAMES * run.scenario.max_cycles + normalising_rounds(task)
    )
    return finish(run, [task], watch.best(), curve, rounds), curve


def check_games(run: Run) -> None:
    """Refuse a run whose games do not fit into the memory: to play, and to update. See
    `check_memory`.
    """
    games = run.settings["games"]
    if games > MANY:
        check_memory("--learner games", games, _game_memory(run))


def _game_memory(run: Run) -> float:
    """Return the memory of each game of the learner in bytes."""
    task = task_from_card(run.task, run.trust_model, run.scenario)
    settings = learner_settings(run.task.id, run.algo, run.settings).model_copy(
        update={"games": _FEW}
    )

    def played(games: int) -> Iterator[object]:
        env = StaggeredGames(task, games)
        yield env.reset()
        while True:
            yield env.step(np.zeros((games, task.action_size), np.float32))

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # batches that do not fit so few games
        model = make_model(run.algo, settings, StaggeredGames(task, _FEW), run.seed)
    return try_out(played, trial_size(task.game)).memory + update_memory(model) / _FEW


class _Watch(BaseCallback):
    """Callback that measures the score, reports progress and saves checkpoints."""

    def __init__(self, run: Run, task: AttackTask, folder: RunFolder, on_report: OnReport) -> None:
        super().__init__()
        self.curve: list[CurvePoint] = []
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
        self.curve = [CurvePoint(*row) for row in checkpoint.notes["curve"]]
        self._seconds_before = self.curve[-1].seconds
        now, weights = network_of(model), read_weights(checkpoint.files["best.safetensors"])
        self._best = Network(now.architecture, now.mean, now.variance, weights)

    def _on_rollout_start(self) -> None:
        """Measure when it is time; the learner has just been updated, or has not begun."""
        if self.num_timesteps > 0 and self.num_timesteps >= self._due():
            self._measure()
        self._on_report(TrainingReport(self.num_timesteps, self._run.steps, self.curve))

    def _on_training_end(self) -> None:
        if not self.curve or self.curve[-1].steps < self.num_timesteps:
            self._measure()
        self._on_report(TrainingReport(self.num_timesteps, self._run.steps, self.curve))

    def _on_step(self) -> bool:
        return True

    def _due(self) -> int:
        return (self.curve[-1].steps if self.curve else 0) + self._every

    def _measure(self) -> None:
        """Measure the score of the current network, and save a checkpoint."""
        seconds = self._seconds_before + perf_counter() - self._began
        network = network_of(self.model)
        scores = score_of(self._task, network, self._run.seed)
        point = CurvePoint(self.num_timesteps, seconds, float(scores.mean), float(scores.half))
        if not self.curve or point.score > max(point.score for point in self.curve):
            self._best = network
        self.curve.append(point)
        self.logger.record("eval/score", point.score)
        files = {
            "parameters.pt": parameters_bytes(self.model),
            "best.safetensors": weights_bytes(self.best()),
        }
        if isinstance(buffer := getattr(self.model, "replay_buffer", None), ReplayBuffer):
            files |= {
                f"replay.{name}": np.ascontiguousarray(getattr(buffer, name)).tobytes()
                for name in _REPLAY
            }
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
