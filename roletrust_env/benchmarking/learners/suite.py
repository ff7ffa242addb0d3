"""Suites for learners and their trials. A trial is one learner on one task with one budget and one
seed.
"""

from collections.abc import Callable
from math import inf
from time import perf_counter
from typing import Annotated, Any, ClassVar, Literal, NamedTuple, Self

from pydantic import Field, PositiveInt, model_validator

from roletrust_env.benchmarking.learners.learner import (
    HONEST_PLAY,
    is_search,
    make_search_method,
    registry,
)
from roletrust_env.benchmarking.schema import (
    AttackResult,
    CellResult,
    Label,
    SuiteSchema,
    check_unique,
)
from roletrust_env.envs.attack_env import TASKS
from roletrust_env.evaluation.measurement import TaskArguments
from roletrust_env.evaluation.search import UnsuitableError, bounds, find, search_methods
from roletrust_env.evaluation.specs import named_factory
from roletrust_env.game.attack_task import Objective
from roletrust_env.game.make_task import Observation, make_task
from roletrust_env.world import make_scenario
from roletrust_env.world.group import FrozenModel


class Trial(NamedTuple):
    """Smallest unit of a benchmark of learners, independent of all other trials.

    Attributes:
        task: Name of the task in the suite.
        learner: Name of the learner in the suite, or `HONEST_PLAY` or a bound, which have
            no budget.
        budget: Budget in game rounds.
        seed: Random seed.
    """

    task: str
    learner: str
    budget: int
    seed: int

    @property
    def key(self) -> str:
        """Unique key of the trial in its suite."""
        return "|".join(map(str, self))


class SuiteTask(FrozenModel):
    """Attack task with changes of its arguments and its scenario."""

    task: Literal["ProviderAttack", "RaterAttack", "DualAttack", "CollusionAttack"]
    """Name of the task, whose Gymnasium id is `RoleTrust/NAME-v0`."""
    preset: str = ""
    """Name of a preset scenario. Empty means that of the task."""
    set: dict[str, Any] = Field(default_factory=dict)
    """Changed fields of the scenario."""
    compromised: tuple[str, ...] = ()
    """Names of the compromised agents. Empty means those of the task."""
    objective: Objective | None = None
    """Objective. None means that of the task."""
    observation: Observation = "agents"
    """Observation and action of learners, see `make_task`. Coalitions by evolution or PPO have
    their own always."""
    stealth: dict[str, float] = Field(default_factory=dict)
    """`weight` and `tolerance` of the penalty for detection. Empty means no penalty."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        make_task(**self.arguments())
        return self

    @property
    def id(self) -> str:
        """Gymnasium id of the task."""
        return f"RoleTrust/{self.task}-v0"

    def arguments(self) -> TaskArguments:
        """Return the arguments of the task, see `roletrust_env.make_task`."""
        changes = {
            "compromised": self.compromised,
            "objective": self.objective,
            "stealth": self.stealth,
        }
        arguments = {
            **TASKS[self.id].defaults,
            **{name: value for name, value in changes.items() if value},
        }
        scenario = make_scenario(self.preset or arguments["scenario"])
        scenario = scenario.change(**self.set) if self.set else scenario
        return {**arguments, "scenario": scenario, "observation": self.observation}


class LearnersSuite(SuiteSchema):
    """Benchmark of learners: tasks x learners x budgets x seeds.

    A learner learns from scratch for each budget, so it can plan for the budget. Its score is that
    of the final policy, without exploration, in held-out games.
    """

    cell_type: ClassVar = Trial
    measured_scores: ClassVar = {"score": (-inf, inf)}  # `Number` bounds it
    kind: Literal["learners"] = "learners"
    """Type of the suite."""
    tasks: Annotated[dict[Label, SuiteTask], Field(min_length=1)]
    """Tasks by their name in the suite."""
    learners: Annotated[tuple[Label, ...], Field(min_length=1)]
    """Names of search methods or installed learners, or `package.module:Class`, with parameters or
    without."""
    budgets: Annotated[tuple[PositiveInt, ...], Field(min_length=1)] = (25_000, 50_000, 100_000)
    """Budgets of each learner in game rounds (rounds x games). The last one is used for the
    ranking."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        check_unique(learners=self.learners)
        if list(self.budgets) != sorted(set(self.budgets)):
            raise ValueError(f"budgets must be increasing, not {self.budgets}")
        if references := {HONEST_PLAY, *bounds.names()} & {*self.learners}:
            raise ValueError(
                f"learners must not contain {references.pop()!r}, which is always played"
            )
        return self

    @property
    def title(self) -> str:
        """Title of a figure of the results."""
        return f"Learners, suite {self.name}, {len(self.seeds)} seeds"

    def cells(self) -> list[Trial]:
        """Return all trials. The longest come first, so that all workers end at about the same
        time.
        """
        trials = [
            Trial(task, learner, budget, seed)
            for budget in reversed(self.budgets)
            for seed in self.seeds
            for learner in self.learners
            for task in self.tasks
        ]
        trials += [Trial(task, HONEST_PLAY, 0, seed) for task in self.tasks for seed in self.seeds]
        return trials + [
            Trial(task, bound, 0, self.seeds[0]) for task in self.tasks for bound in bounds.names()
        ]

    def factories(self) -> dict[str, Callable[..., Any]]:
        """Return the factories of the plug-in learners, by type and name."""
        known = search_methods.names()
        plugins = [name for name in self.learners if name.partition(":")[0] not in known]
        kinds = {name: search_methods if is_search(name) else registry for name in plugins}
        return {f"learner {name}": named_factory(kind, name) for name, kind in kinds.items()}

    def rules(self, cell: Trial) -> "LearnersSuite":
        """Return all fields that the result of a trial depends on: the whole suite."""
        return self


def play_trial(suite: LearnersSuite, trial: Trial) -> CellResult:
    """Play a trial.

    Raises:
        ValueError: The name of the learner is unknown, or the learner fails.
    """
    began, task = perf_counter(), suite.tasks[trial.task]
    method, arguments = make_search_method(trial.learner, task.id), task.arguments()
    try:
        attempt = find(method, arguments, budget=trial.budget, seed=trial.seed, games=suite.games)
    except UnsuitableError as error:
        return CellResult((), perf_counter() - began, unsuitable=str(error))
    measured: dict[str, list[float | None]] = {"score": attempt.scores.tolist()}
    if attempt.bound is not None:
        measured["bound"] = [attempt.bound]
    row = AttackResult(trial.learner, attempt.description, attempt.rounds, {}, measured)
    steps = attempt.rounds + suite.games * arguments["scenario"].max_cycles
    return CellResult((row,), perf_counter() - began, env_steps=steps)
