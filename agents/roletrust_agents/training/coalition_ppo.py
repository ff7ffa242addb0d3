"""PPO for a coalition as one mind: a training with checkpoints, and a search method with a budget
of rounds.
"""

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np

from roletrust_agents.learned.coalition_attacker import CoalitionAttacker
from roletrust_agents.learned.deep_set import DeepSet
from roletrust_agents.training.coalition_training import CoalitionTraining, Floats
from roletrust_agents.training.settings import CoalitionPPOSettings, Start, settings_of
from roletrust_agents.training.universal import (
    best_universal,
    choice_rounds,
    starts_of,
    universal_coalitions,
)
from roletrust_env.evaluation.measurement import (
    SEARCHED,
    TaskArguments,
    check_games_memory,
    mean_rewards,
)
from roletrust_env.evaluation.search import Budget, SearchResult, UnsuitableError
from roletrust_env.game.coalition_task import CoalitionTask
from roletrust_env.game.make_task import make_task
from roletrust_env.memory import check_memory
from roletrust_env.parameters import refuse_unknown_parameters

_CRITIC_UNITS = 24
_BATCHES = 4  # of a rollout
_GAMES, _FEWEST_GAMES, _UPDATES = 32, 4, 60
"""Number of games of a rollout, the fewest, and the number of updates that is worth fewer games."""
_COMPARED, _VALIDATION, _MOST_VALIDATION_GAMES = 5, 8, 200
"""Number of networks that are compared, share of the budget for it (1 of 8), and most games for
each."""
_LEAST = 40
"""Number of whole games that a budget must have."""
_LAST_RATE = 0.1
"""Learning rate at the end, as a share of the initial one."""


def make_ppo(
    task: CoalitionTask,
    settings: CoalitionPPOSettings,
    learning_rate: Callable[[float], float],
    seed: int,
    first: DeepSet | None,
) -> Any:
    """Return PPO of Stable-Baselines3 for a coalition, before its training.

    Args:
        task: Task of the coalition.
        settings: Settings.
        learning_rate: Function of the share of the training that is left, in the sense of
            Stable-Baselines3.
        seed: Random seed.
        first: Network to begin with; None is a random one whose mean actions are near the truth.

    Raises:
        UnsuitableError: A rollout has a single round, or a wide coalition has claims to decide on.
        ValueError: A rollout does not fit into the memory.
    """
    from stable_baselines3 import PPO

    from roletrust_agents.training.coalition_policy import (
        CoalitionPolicy,
        begin_with,
        policy_arguments,
    )
    from roletrust_agents.training.experience import WholeGames, update_memory

    check_games_memory(task, settings.games)
    rounds, spread = task.game.scenario.max_cycles, float(np.log(settings.first_spread))
    if settings.games * rounds < 2:
        raise UnsuitableError("a rollout of one round is too short for PPO; give more games")
    if task.coalition.claims:
        reports = task.game.scenario.ratings.open
        raise UnsuitableError(
            f"the network decides on no claims, and ratings.open is {reports}; give wide=false"
        )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the last batch may be smaller than the others
        model = PPO(
            CoalitionPolicy,
            WholeGames(task, settings.games, seed=seed),
            learning_rate=learning_rate,
            n_steps=rounds,
            batch_size=max(2, settings.games * rounds // _BATCHES),
            n_epochs=settings.n_epochs,
            gamma=settings.gamma,
            gae_lambda=settings.gae_lambda,
            clip_range=settings.clip_range,
            policy_kwargs=policy_arguments(task, settings.units, _CRITIC_UNITS, spread),
            seed=seed,
            device="cpu",
        )
    check_memory(
        "games", settings.games, update_memory(model) / settings.games
    )  # zeros take none until they are used
    if first is not None:
        policy: Any = model.policy
        begin_with(policy, first)
    return model


class CoalitionPpoTraining(CoalitionTraining[CoalitionPPOSettings]):
    """PPO of a coalition in progress: a step is a rollout of whole games with each task of the
    turn, and its update.

    It validates its start, too. The random numbers of a step follow from the seed and the number of
    the step, so that a run continues to the last bit. For the arguments see `CoalitionTraining`;
    the tasks are those of a coalition.
    """

    def _begin(self) -> None:
        from roletrust_agents.training.experience import WholeGames

        tasks = [task for task in self.tasks if isinstance(task, CoalitionTask)]
        if len(tasks) < len(self.tasks):
            raise ValueError('PPO of a coalition is for tasks with observation="coalition"')
        if self.settings.start != "random" and not self._known:
            raise UnsuitableError(
                f"no universal coalition has {self.settings.units} units; give start=random"
            )
        self._first = self.networks(self._starts[0]) if self.settings.start != "random" else None
        self._games = [WholeGames(task, self.settings.games) for task in tasks]
        self._ppo = make_ppo(tasks[0], self.settings, self._rate, self.seed, self._first)
        if self.best is None:
            self.validate()

    def _rate(self, left: float) -> float:
        """Return the learning rate; Stable-Baselines3 knows only what is left of the present
        step.
        """
        return self.settings.first_rate * (1 - (1 - _LAST_RATE) * self.done)

    @property
    def weights(self) -> Floats:
        """See `CoalitionTraining.weights`."""
        from roletrust_agents.training.coalition_policy import deep_set_of

        weights: Floats = deep_set_of(self._ppo.policy, self._first).flatten().astype(np.float64)
        return weights

    def step(self) -> None:
        """Play and learn. See `CoalitionTraining.step`."""
        for k in self.turn:
            self._ppo.set_env(self._games[k])
            self._ppo.set_random_seed(
                int(np.random.SeedSequence([self.seed, self.steps, k]).generate_state(1)[0])
            )
            self._ppo.learn(self.step_games * self.length, reset_num_timesteps=False)
            self.rounds += self.step_games * self.length
        self.steps += 1

    def state(self) -> bytes:
        """Return the number of steps, the parameters and the state of Adam. See
        `CoalitionTraining.state`.
        """
        from roletrust_agents.training.learners import parameters_bytes

        return self.steps.to_bytes(8, "little") + parameters_bytes(self._ppo)

    def restore(self, state: bytes) -> None:
        """See `CoalitionTraining.restore`."""
        from roletrust_agents.training.learners import set_parameters

        self.steps = int.from_bytes(state[:8], "little")
        set_parameters(self._ppo, state[8:])


@refuse_unknown_parameters
@dataclass(frozen=True)
class CoalitionPpo:
    """PPO (Schulman et al., 2017) on the network of a coalition, with noise that is held over an
    episode.

    The coalition observes and decides as in a task with `observation="coalition"`, and the network
    is a `DeepSet`. Each game keeps its noise over the whole episode, see
    `roletrust_agents.training.coalition_policy`. The result is the best of some networks of the
    training, in the same games for all, and plays without noise. The universal coalition at the
    start is one of them, because a training can end below its start. After a random start, only
    networks of the second half are compared.

    The network does not learn when to call identities in reserve: a universal coalition does so as
    before, and a random network calls none.

    Attributes:
        start: `"universal"` begins with the best of the universal coalitions, `"random"` with a
            random network.
        wide: Whether the network also decides on silence, and on the treatment of each rater.
        learning_rate: Initial learning rate, which falls linearly to a tenth of it; None is 0.003
            for a universal coalition and 0.01 for a random network.
        gamma: Discount factor.
        gae_lambda: Factor of generalised advantage estimation.
        n_epochs: Number of passes over a rollout.
        clip_range: Clip range of the ratio of probabilities.
        spread: Initial standard deviation of the actions, which lie in [-1, 1]; None is 0.2 for a
            universal coalition and 0.5 for a random network.
        name: Name in tables.
    """

    start: Start = "universal"
    wide: bool = True
    learning_rate: float | None = None
    gamma: float = 0.95
    gae_lambda: float = 0.95
    n_epochs: int = 5
    clip_range: float = 0.3
    spread: float | None = None
    name: str = "coalition PPO"
    known_start: ClassVar = True

    def __post_init__(self) -> None:
        """Check the parameters."""
        self._settings()

    def _settings(self) -> CoalitionPPOSettings:
        return settings_of(CoalitionPPOSettings, self)

    def search(self, arguments: TaskArguments, budget: Budget, seed: int) -> SearchResult:
        """See `SearchMethod.search`."""
        from stable_baselines3.common.utils import LinearSchedule

        from roletrust_agents.training.coalition_policy import deep_set_of
        from roletrust_agents.training.experience import AfterUpdates

        settings = self._settings()
        task = _task(arguments, self.name, self.wide)
        rounds = task.game.scenario.max_cycles
        universal = self.start != "random"
        ready = (
            starts_of(universal_coalitions(wide=self.start == "universal"), wide=self.wide)
            if universal
            else {}
        )
        least = _LEAST * rounds + choice_rounds(task, ready)
        if budget.left < least:
            raise UnsuitableError(
                f"the budget of {budget.rounds} rounds is too small for {self.name}; give {least} "
                "or more"
            )
        first = best_universal(task, ready, budget, seed)[1] if universal else None
        plan = _Plan.of(budget.left // rounds, universal)
        rollout = plan.games * rounds
        rate = LinearSchedule(settings.first_rate, _LAST_RATE * settings.first_rate, 1.0)
        model = make_ppo(task, settings.model_copy(update={"games": plan.games}), rate, seed, first)
        policy: Any = model.policy
        scores: list[float] = []
        best: list[DeepSet] = []

        def compare(updates: int) -> None:
            if updates not in plan.compared:
                return
            network = deep_set_of(policy, first)
            reward = mean_rewards(
                task, CoalitionAttacker(network), (seed, 0), (1, plan.validation), SEARCHED
            )[0]
            budget.spend(plan.validation * rounds)
            scores.append(float(reward.mean()))
            if scores[-1] == max(scores):
                best[:] = [network]

        def updated(updates: int) -> None:
            budget.spend(rollout)
            compare(updates)

        compare(0)
        model.learn(plan.updates * rollout, callback=AfterUpdates(rollout, updated))
        return SearchResult(
            CoalitionAttacker(best[0]), budget.spent, f"{self.name} in {budget.spent} rounds"
        )


class _Plan(NamedTuple):
    """How a budget is spent.

    Attributes:
        games: Number of games of a rollout.
        updates: Number of rollouts.
        compared: Numbers of updates after which a network is compared with the best one; 0 is the
            start.
        validation: Number of games of a comparison.
    """

    games: int
    updates: int
    compared: frozenset[int]
    validation: int

    @classmethod
    def of(cls, whole: int, universal: bool) -> Self:
        """Return the plan for a number of games, with a universal coalition as the start or a
        random network.
        """
        validation = min(_MOST_VALIDATION_GAMES, whole // (_VALIDATION * _COMPARED))
        left = whole - validation * _COMPARED
        games = min(_GAMES, max(_FEWEST_GAMES, left // _UPDATES))
        updates = left // games
        begin = 0.0 if universal else 0.5
        compared = frozenset(
            round(updates * (begin + (1 - begin) * k / (_COMPARED - 1))) for k in range(_COMPARED)
        )
        return cls(games, updates, compared, validation)


def _task(arguments: TaskArguments, name: str, wide: bool) -> CoalitionTask:
    """Return the task of the coalition as one mind."""
    knowledge = arguments.get("knowledge", "black_box")
    if knowledge != "black_box":
        raise UnsuitableError(f"{name} is for black_box knowledge, and the task has {knowledge}")
    task = make_task(
        **{**arguments, "observation": "accounts" if wide else "coalition"},
        like=np.zeros((), np.float32),
    )
    assert isinstance(task, CoalitionTask)
    return task
