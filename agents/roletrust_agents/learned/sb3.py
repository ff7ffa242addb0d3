"""Models of Stable-Baselines3 at play: one call makes a policy or an attacker of a model and its
task.
"""

from typing import Any

import numpy as np

from roletrust_agents.learned.coalition_attacker import NetworkAttacker
from roletrust_agents.learned.network import Floats
from roletrust_agents.learned.policy import LearnedPolicy, policy_for
from roletrust_env.arrays import Array, namespace
from roletrust_env.envs.task_batch import task_spaces
from roletrust_env.evaluation.attackers import Attacker
from roletrust_env.game.attack_task import AttackTask


def policy_of(model: Any, task: AttackTask) -> LearnedPolicy:
    """Return the policy of a trained model of Stable-Baselines3, to be seated at an agent of a
    `JointPolicy`.

    The policy plays wherever a scripted one plays: in `JointPolicy`, in `Player`, in `evaluate` and
    in every batch. It acts without exploration.

    Args:
        model: Trained model, such as `PPO`, `SAC` or `RecurrentPPO`, with the spaces of
            `AttackVecEnv(task, ...)`. The statistics of a `VecNormalize` around that environment
            are applied, too.
        task: Task that the model was trained in, with one compromised agent and the knowledge
            `"black_box"`.

    Raises:
        ValueError: The task has several compromised agents or another knowledge, for which there is
            `attacker_of`; or the spaces of the model are not those of the task.

    Example:
        >>> from roletrust_env import AttackVecEnv, JointPolicy, make_task, record
        >>> from stable_baselines3 import PPO
        >>> task = make_task("paper-3x3", ("sp_2",), objective="exploit")
        >>> model = PPO("MlpPolicy", AttackVecEnv(task, 8), n_steps=25, batch_size=200).learn(200)
        >>> history = record(JointPolicy(task.game, {"sp_2": policy_of(model, task)}), task.game.random(0))
        >>> history.top.shape
        (240, 3)
    """  # noqa: E501
    _check_task(task)
    if len(task.compromised) > 1 or task.knowledge != "black_box":
        raise ValueError(
            f"the task compromises {', '.join(task.compromised)} with {task.knowledge} knowledge; "
            "a policy is for one "
            "agent with black_box knowledge. Use attacker_of(model, task), which decides for all "
            "of them"
        )
    role = task.game.roster.role(task.compromised[0])
    return policy_for(role, SB3Decider(model, task), task.game.layout, _described(model, task))


def attacker_of(model: Any, task: AttackTask) -> Attacker:
    """Return the attacker of a trained model of Stable-Baselines3, which decides for all
    compromised agents at once.

    Args:
        model: Trained model, see `policy_of`.
        task: Task that the model was trained in, with any number of compromised agents and any
            knowledge.

    Raises:
        ValueError: The spaces of the model are not those of the task.

    Example:
        >>> from roletrust_env import AttackVecEnv, make_task
        >>> from roletrust_env.evaluation.measurement import HELD_OUT, mean_rewards
        >>> from stable_baselines3 import PPO
        >>> task = make_task("crowd-10x10", ("sr_8", "sr_9", "sp_9"), max_cycles=20)
        >>> model = PPO("MlpPolicy", AttackVecEnv(task, 8), n_steps=25, batch_size=200).learn(200)
        >>> reward, objective, cost = mean_rewards(task, attacker_of(model, task), 0, (1, 5), HELD_OUT)
        >>> reward.shape
        (1, 5)
    """  # noqa: E501
    return NetworkAttacker(SB3Decider(model, task), task.knowledge)


def _check_task(task: Any) -> None:
    if not isinstance(task, AttackTask):
        raise ValueError(f"task must be an AttackTask, such as make_task() makes, got {task!r}")


class SB3Decider:
    """The `predict` of a model, as a function from observations to actions of a task, the batch
    last.

    Args:
        model: Trained model, see `policy_of`.
        task: Task whose spaces the model must have.

    Raises:
        ValueError: `model` is not a model or `task` not a task, or their spaces differ.
    """

    def __init__(self, model: Any, task: AttackTask) -> None:
        _check_task(task)
        for needed in ("predict", "observation_space", "action_space"):
            if not hasattr(model, needed):
                raise ValueError(
                    f"model is {model!r}; it must be a trained model of Stable-Baselines3, with "
                    f"{needed}"
                )
        seen, action = task_spaces(task)
        if model.observation_space.shape != seen.shape:
            raise ValueError(
                f"the model observes {model.observation_space}; the task shows {seen}. Train it in "
                "AttackVecEnv(task, "
                "...) of the same task, without stacked frames"
            )
        low = getattr(model.action_space, "low", None)
        if (
            model.action_space.shape != action.shape
            or low is None
            or float(low.min()) not in (-1.0, 0.0)
        ):
            raise ValueError(
                f"the model acts in {model.action_space}; the task needs {action}, or the same "
                "from -1 on"
            )
        self._model, self._scaled, self._size = model, float(low.min()) < 0, seen.shape
        self._memory: tuple[int, ...] = tuple(getattr(model.policy, "lstm_hidden_state_shape", ()))
        self._normalising = model.get_vec_normalize_env()

    @property
    def has_memory(self) -> bool:
        """True if the model is recurrent."""
        return bool(self._memory)

    def begin(self, like: Array) -> Array | None:
        """Return the memory before the first observation, zeros of shape (2 L H, ...); None without
        an LSTM.
        """
        if not self._memory:
            return None
        layers, _, units = self._memory
        return namespace(like).stack([0 * like] * (2 * layers * units))

    def __call__(
        self, observation: Array, memory: Array | None = None
    ) -> tuple[Array, Array | None]:
        """Return the actions in [0, 1], (A, ...), for observations, (K, ...), and the new
        memory.
        """
        xp, batch = namespace(observation), tuple(observation.shape[1:])
        if observation.shape[:1] != self._size:
            raise ValueError(
                f"the observation has {observation.shape[0]} entries, not {self._size[0]}"
            )
        rows = np.ascontiguousarray(_rows(observation), np.float32)
        if self._normalising is not None:
            rows = self._normalising.normalize_obs(rows)
        state, first = None, np.zeros(len(rows), bool)
        if memory is not None:
            layers, _, units = self._memory
            both = _rows(memory).reshape(len(rows), 2, layers, units).astype(np.float32)
            state = tuple(np.ascontiguousarray(both[:, k].swapaxes(0, 1)) for k in range(2))
        chosen, state = self._model.predict(
            rows, state=state, episode_start=first, deterministic=True
        )
        action = chosen * 0.5 + 0.5 if self._scaled else chosen
        if memory is not None and state is not None:
            after = np.stack([part.swapaxes(0, 1) for part in state], axis=1).reshape(len(rows), -1)
            memory = _as(xp, memory, after.T, (-1, *batch))
        return _as(xp, observation, np.clip(action, 0.0, 1.0).T, (-1, *batch)), memory


def _rows(array: Array) -> Floats:
    """Return the entries of each game as a row, in NumPy, (games, K)."""
    flat: Any = array.reshape(array.shape[0], -1)
    if not isinstance(flat, np.ndarray):
        flat = flat.detach().cpu().numpy()
    rows: Floats = flat.T
    return rows


def _as(xp: Any, like: Array, values: Floats, shape: tuple[int, ...]) -> Array:
    """Values of NumPy in the library, dtype and device of another array."""
    return xp.asarray(
        np.ascontiguousarray(values).reshape(shape), dtype=like.dtype, device=like.device
    )


def _described(model: Any, task: AttackTask) -> str:
    """Return the algorithm, the training steps and the task, in a few words."""
    steps = getattr(model, "num_timesteps", 0)
    return (
        f"{type(model).__name__} after {steps} steps, {task.compromised[0]} in "
        f"{task.game.scenario.name}"
    )
