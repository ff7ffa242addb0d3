"""Attack tasks as Gymnasium environments."""

from collections.abc import Mapping
from copy import deepcopy
from types import MappingProxyType
from typing import Any, ClassVar

import gymnasium
import numpy as np
import numpy.typing as npt
from gymnasium.envs.registration import EnvSpec

from roletrust_env.envs.actions import check_action
from roletrust_env.envs.arguments import Engine, is_compiled, refuse_unknown
from roletrust_env.envs.spec import TaskSpec
from roletrust_env.envs.spectator import RENDERING, RenderMode, Spectator
from roletrust_env.envs.task_batch import TaskRound, compile_task, task_spaces
from roletrust_env.errors import suggest
from roletrust_env.game.attack_task import AttackTask, TaskState
from roletrust_env.game.make_task import make_task
from roletrust_env.game.state import State
from roletrust_env.parameters import whole_number
from roletrust_env.randomness import Random

Vector = npt.NDArray[np.float32]


class AttackEnv(gymnasium.Env[Vector, Vector]):
    """An attack by one learner, which controls the compromised agents of a game; all other agents
    are scripted.

    ## Description

    The base of the tasks `RoleTrust/ProviderAttack-v0`, `RoleTrust/RaterAttack-v0`,
    `RoleTrust/DualAttack-v0` and `RoleTrust/CollusionAttack-v0`, which differ in the compromised
    agents and in the objective. The game is that of `RoleTrustParallelEnv`: qualities and ratings
    are chosen at once, and ratings are for the services of the step before.

    ## Action Space

    `Box(0, 1, (A,), float32)`: for each compromised agent in turn its quality, if it provides, then
    its ratings of the P providers, if it rates. The wrappers `RescaleClipAction` and
    `DiscretizeLevels` of `roletrust_env` change the action space.

    ## Observation Space

    `Box(0, 1, (K,), float32)`, by `knowledge`:

    | knowledge | observation |
    |---|---|
    | `black_box` | the observation of each compromised agent in turn, as in `RoleTrustParallelEnv` |
    | `grey_box` | in addition the published trust of all raters (S) and of all providers (P) |
    | `white_box` | in addition the whole state, the trust model's memory included; unbounded |

    With `observation="coalition"` the compromised agents are one mind: `Box(-1, 1, (15 P,),
    float32)` holds 15 features of each provider, feature by feature, and the action has a lie about
    each provider if the coalition rates, then a quality for each provider if it provides. With
    `observation="accounts"` it also observes its providers' accounts of the raters, and decides on
    silence and treatment, and on claims where reports are open. See
    `roletrust_env.game.coalition.Coalition`.

    ## Rewards

    The reward is the objective minus the stealth weight times the cost.

    | objective | value |
    |---|---|
    | `damage` | mean over the honest providers of 1 - ToP |
    | `exploit` | mean over the own providers of the published ToP at which a service was sold times 1 - its quality |
    | `promote` | the same for the accomplices |
    | `mislead` | best quality on offer, minus that of the provider with the highest ToP published before |

    The cost is the mean over the compromised agents of max(0, gap - tolerance). The gap of an agent
    is the mean trust of the honest agents of its role minus its own trust; the larger gap counts if
    it has both roles.

    ## Starting State

    Every agent has the initial trust, and there are no services and no ratings yet.

    ## Episode End

    Truncation after the scenario's `max_cycles` steps, the value of `spec.max_episode_steps`.
    Termination when all compromised agents are gone for good: they left, or admission control cut
    them off. With a `continuation` below 1 also after each step with probability 1 -
    `continuation`; no observation tells when.

    ## Information

    `objective`, and `cost`, the unweighted cost, which libraries for safe learning expect.

    ## Arguments

    See `make_task`; the default of `like` is NumPy's float64. In addition `render_mode`: `"human"`,
    `"rgb_array"` or `"ansi"`, where the learner's agents are marked; and `engine`: `"rules"` or
    `"compiled"`, which plays the same rounds faster, to the rounding of the dtype.

    ## Version History

    - v0: first version.
    """  # noqa: E501

    metadata = {**RENDERING}  # noqa: RUF012 - as Gymnasium has it

    defaults: ClassVar[Mapping[str, Any]] = MappingProxyType({})
    """Default arguments of `make_task`."""

    def __init__(
        self, *, render_mode: RenderMode | None = None, engine: Engine = "rules", **arguments: Any
    ) -> None:
        refuse_unknown(type(self), arguments, make_task)
        if not isinstance(arguments.get("like"), np.ndarray | None):
            raise ValueError(
                "like is no array of NumPy, which this environment needs; make_vec plays tensors"
            )
        arguments["like"] = np.zeros(()) if arguments.get("like") is None else arguments["like"]
        self.task = make_task(**{**self.defaults, **arguments})
        self.observation_space, self.action_space = task_spaces(self.task)  # type: ignore[assignment]
        self.render_mode = render_mode
        self.metadata = deepcopy(self.metadata)  # wrappers add render modes
        self.engine = engine
        self._compiled = compile_task(self.task) if is_compiled(engine) else None
        self._played: TaskState | None = None  # by the rules; the compiled engine has its own
        self._random: Random | None = None
        self._playing, self._end, self._length = False, 0, 0
        self._spectator = Spectator(self.task.game, render_mode)
        self._spectator.attackers = self.task.compromised
        self._spec: EnvSpec | None = None

    def __repr__(self) -> str:
        task = repr(self.task).replace(type(self.task).__name__, type(self).__name__, 1)
        return task if self._compiled is None else f"{task[:-1]}, engine: {self.engine})"

    def _repr_html_(self) -> str:
        return self._spectator.html(repr(self), self._games())

    @property
    def spec(self) -> EnvSpec | None:
        """The specification of Gymnasium, with the length of an episode."""
        return self._spec

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:
        # The registry cannot know the length, and Gymnasium would cut longer games off at the one
        # it knew.
        self._spec = spec and TaskSpec.of(
            spec, max_episode_steps=self.task.game.scenario.max_cycles
        )

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Vector, dict[str, Any]]:
        """Begin a new episode; see `gymnasium.Env.reset`."""
        super().reset(seed=None if seed is None else whole_number("seed", seed))
        if seed is not None or self._random is None:
            self._random = Random(self.np_random, self.task.game.like)
        state = self.task.start(self.task.game.draw(self._random, start=True), self._random)
        if self._compiled is not None:
            self._compiled.begin(state)
        self._played = state
        self._playing, self._end = True, int(self.task.game.random_end(self._random))
        self._length = min(self._end, self.task.game.scenario.max_cycles)
        if self.render_mode is not None:
            self._spectator.follow(state.game)
        return self.task.observe(state).astype(np.float32), {"objective": 0.0, "cost": 0.0}

    def step(self, action: Vector) -> tuple[Vector, float, bool, bool, dict[str, Any]]:
        """Play one round; see `gymnasium.Env.step`.

        Raises:
            ValueError: The action has the wrong shape, or holds NaN or a value outside [0, 1].
                Nothing has changed then.
            RuntimeError: `reset` was not called, or the episode is over.
        """
        action = check_action(action, self.action_space.shape or ())
        if not self._playing:
            raise RuntimeError("call reset() before step(): the episode has not begun or is over")
        outcome, rounds, seen, _ = self._play(action)
        caught, round = bool(outcome.caught), int(rounds)
        over = round >= self._length
        self._playing = not (caught or over)
        terminated = caught or (over and round >= self._end)
        if self.render_mode is not None:
            self._spectator.follow(self._current().game)
        info = {"objective": float(outcome.objective), "cost": float(outcome.cost)}
        observation = seen.astype(np.float32)
        return observation, float(outcome.reward), terminated, over and not terminated, info

    def _play(self, action: Vector) -> TaskRound:
        """Play one round with a valid action."""
        assert self._played is not None  # there is an episode
        assert self._random is not None
        if self._compiled is not None:
            played: TaskRound = self._compiled.play(
                action, self._random.round_key(), random=self._random
            )
            return played.checked()
        noise = self.task.game.draw(self._random)
        self._played, outcome = self.task.step(self._played, action, noise, self._random)
        return TaskRound(outcome, self._played.game.round, self.task.observe(self._played))

    def _games(self) -> State | None:
        """Return the state of the game; None before the first episode."""
        return None if self._played is None else self._current().game

    def _current(self) -> TaskState:
        assert self._played is not None  # there is an episode
        state: TaskState = self._played if self._compiled is None else self._compiled.state
        return state

    def render(self) -> Any:
        """Show the state of the game by `render_mode`."""
        return self._spectator.render()

    def close(self) -> None:
        """Close the window, if there is one."""
        self._spectator.close()


class ProviderAttackEnv(AttackEnv):
    """An attack by one compromised provider, which sells bad services while it is trusted.

    ## Description

    `RoleTrust/ProviderAttack-v0`. By default the learner is `sp_2` in `paper-3x3`, and its
    objective is `exploit`: to be trusted while it serves badly. The on-off attack is one solution.

    ## Action Space

    `Box(0, 1, (1,), float32)`: the quality of its next service.

    ## Observation Space

    `Box(0, 1, (4 + 2 S,), float32)` at `knowledge="black_box"`: the provider's, see
    `RoleTrustParallelEnv`; more at the other levels, see `AttackEnv`.

    ## Rewards

    Published ToP at which the service was sold, times 1 - its quality, minus the stealth cost.
    Without that cost it is in [0, 1].

    ## Starting State, Episode End, Information, Arguments

    See `AttackEnv`.

    ## Version History

    - v0: first version.
    """

    defaults: ClassVar[Mapping[str, Any]] = MappingProxyType(
        {"scenario": "paper-3x3", "compromised": ("sp_2",), "objective": "exploit"}
    )


class RaterAttackEnv(AttackEnv):
    """An attack by one compromised rater on the trust of the honest providers.

    ## Description

    `RoleTrust/RaterAttack-v0`. By default the learner is `sr_2` in `paper-3x3`, and its objective
    is `damage`. Without a stealth cost the best attack there is to rate every provider 0; with one,
    the rater's trust has to stay near that of the others.

    ## Action Space

    `Box(0, 1, (P,), float32)`: its ratings of the providers.

    ## Observation Space

    `Box(0, 1, (2 + 5 P,), float32)` at `knowledge="black_box"`: the rater's, see
    `RoleTrustParallelEnv`; more at the other levels, see `AttackEnv`.

    ## Rewards

    Mean over the honest providers of 1 - ToP, minus the stealth cost.

    ## Starting State, Episode End, Information, Arguments

    See `AttackEnv`.

    ## Version History

    - v0: first version.
    """

    defaults: ClassVar[Mapping[str, Any]] = MappingProxyType(
        {"scenario": "paper-3x3", "compromised": ("sr_2",), "objective": "damage"}
    )


class DualAttackEnv(AttackEnv):
    """An attack by one compromised agent with both roles, by its services and its ratings.

    ## Description

    `RoleTrust/DualAttack-v0`. By default the learner is `srsp_5` in `peers`, and its objective is
    `exploit`: it can serve badly, and by its ratings move the trust of the others.

    ## Action Space

    `Box(0, 1, (1 + P,), float32)`: the quality of its next service, then its ratings; its rating of
    itself is ignored.

    ## Observation Space

    `Box(0, 1, (1 + 4 + 2 S + 2 + 5 P,), float32)` at `knowledge="black_box"`: the SR+SP agent's,
    see `RoleTrustParallelEnv`; more at the other levels, see `AttackEnv`.

    ## Rewards

    Published ToP at which the service was sold, times 1 - its quality, minus the stealth cost.

    ## Starting State, Episode End, Information, Arguments

    See `AttackEnv`.

    ## Version History

    - v0: first version.
    """

    defaults: ClassVar[Mapping[str, Any]] = MappingProxyType(
        {"scenario": "peers", "compromised": ("srsp_5",), "objective": "exploit"}
    )


class CollusionAttackEnv(AttackEnv):
    """An attack by compromised raters and providers, which one learner controls together.

    ## Description

    `RoleTrust/CollusionAttack-v0`. By default the learner controls two raters and a provider,
    `sr_8`, `sr_9` and `sp_9`, in `crowd-10x10`, and its objective is `damage`. Without a stealth
    cost no attack is known that exceeds the script `collusion`, which rates every honest provider
    0. With one, the trust of its agents has to stay near that of the others.

    ## Action Space

    `Box(0, 1, (A,), float32)`, one joint action: for each compromised agent in turn its quality, if
    it provides, then its P ratings, if it rates. By default A = 21.

    ## Observation Space

    `Box(0, 1, (K,), float32)` at `knowledge="black_box"`: the observations of the compromised
    agents in turn, see `RoleTrustParallelEnv`; more at the other levels, see `AttackEnv`.

    ## Rewards

    Mean over the honest providers of 1 - ToP, minus the stealth cost.

    ## Starting State, Episode End, Information, Arguments

    See `AttackEnv`.

    ## Version History

    - v0: first version.
    """

    defaults: ClassVar[Mapping[str, Any]] = MappingProxyType(
        {"scenario": "crowd-10x10", "compromised": ("sr_8", "sr_9", "sp_9"), "objective": "damage"}
    )


TASKS: dict[str, type[AttackEnv]] = {
    "RoleTrust/ProviderAttack-v0": ProviderAttackEnv,
    "RoleTrust/RaterAttack-v0": RaterAttackEnv,
    "RoleTrust/DualAttack-v0": DualAttackEnv,
    "RoleTrust/CollusionAttack-v0": CollusionAttackEnv,
}
"""The environments of the attack tasks, by the id in Gymnasium."""


def find_task(name: str) -> str:
    """Return the id of an attack task from its id or its short name in any case.

    Raises:
        ValueError: There is no such task.

    Example:
        >>> find_task("rater-attack")
        'RoleTrust/RaterAttack-v0'
    """
    short = {_short(task_id).lower(): task_id for task_id in TASKS}
    try:
        return short[_short(name).lower().replace("-", "")]
    except KeyError:
        raise ValueError(f"unknown task {name!r}{suggest(name, map(_short, TASKS))}") from None


def _short(task_id: str) -> str:
    return task_id.removeprefix("RoleTrust/").removesuffix("-v0")


def task_by_id(task_id: str, arguments: Mapping[str, Any]) -> AttackTask:
    """Return the attack task of an id in Gymnasium.

    Args:
        task_id: One of `TASKS`.
        arguments: Arguments of `make_task`, which replace the defaults of the task.

    Raises:
        ValueError: The id or a name is unknown, or a value is not allowed.
    """
    if task_id not in TASKS:
        raise ValueError(f"unknown task {task_id!r}{suggest(task_id, TASKS)}")
    return make_task(**{**TASKS[task_id].defaults, **arguments})
