"""A suite for learners, and its trials: what one of them learns on one task with one budget and one seed."""

from typing import Annotated, Any, Literal, NamedTuple, Self

from pydantic import Field, PositiveInt, model_validator

from roletrust_env import make_scenario
from roletrust_env.benchmark.schema import SuiteSchema, Text, check_unique
from roletrust_env.envs.tasks import TASKS
from roletrust_env.evaluation.attacked_games import TaskArguments
from roletrust_env.game.attack_task import make_task
from roletrust_env.world.base_model import FrozenModel

FOOT = "honest play"
"""Where every share is 0."""

TOPS = ("exact", "best known")
"""The optimum or a proven bound, where every share is 1; each is known on some tasks only."""


class Task(FrozenModel):
    """One of the tasks that Gymnasium knows."""

    task: Literal["ProviderAttack", "RaterAttack", "DualAttack", "CollusionAttack"]
    """Its name there, `RoleTrust/NAME-v0`."""
    set: dict[str, Any] = Field(default_factory=dict)
    """Fields of its scenario that are changed."""
    stealth: dict[str, float] = Field(default_factory=dict)
    """`weight` and `tolerance`: the price of being told apart; none is free."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        make_task(**self.arguments())
        return self

    @property
    def id(self) -> str:
        """By which Gymnasium finds it."""
        return f"RoleTrust/{self.task}-v0"

    def arguments(self) -> TaskArguments:
        """All that makes it, see `roletrust_env.make_task`."""
        defaults = TASKS[self.id].defaults
        scenario = make_scenario(defaults["scenario"])
        scenario = scenario.change(**self.set) if self.set else scenario
        return {**defaults, "scenario": scenario, "stealth": self.stealth or None}


class LearnersSuite(SuiteSchema):
    """A benchmark of learners: tasks x learners x budgets x seeds.

    Each learns anew for each budget, so that a learner may plan for what it has; what it then plays in games that it
    has not seen, without exploring, is its score.
    """

    kind: Literal["learners"] = "learners"
    """Of suite."""
    tasks: Annotated[dict[Text, Task], Field(min_length=1)]
    """By the name that they have in the suite."""
    learners: Annotated[tuple[Text, ...], Field(min_length=1)]
    """Names of `contestants.BUILT_IN`, of installed packages, or `package.module:Class`."""
    budgets: Annotated[tuple[PositiveInt, ...], Field(min_length=1)] = (25_000, 50_000, 100_000)
    """Game rounds, rounds x games, that each learner may play; the last one is the headline's."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        check_unique(learners=self.learners)
        if list(self.budgets) != sorted(set(self.budgets)):
            raise ValueError(f"budgets must rise; they are {self.budgets}")
        if known := {FOOT, *TOPS} & {*self.learners}:
            raise ValueError(f"learners has {known.pop()!r}, which is played anyway")
        return self


class Trial(NamedTuple):
    """What can be played apart from all else, and anywhere.

    Attributes:
        task: its name in the suite.
        learner: its name in the suite; or `FOOT` or one of `TOPS`, which play no games.
        budget: game rounds that it may play.
        seed: of all luck.
    """

    task: str
    learner: str
    budget: int
    seed: int

    @property
    def key(self) -> str:
        """What tells it from all others of its suite."""
        return "|".join(map(str, self))


def trials(suite: LearnersSuite) -> list[Trial]:
    """All trials of a suite, the longest first: at the end no worker is left alone with one."""
    found = [
        Trial(task, learner, budget, seed)
        for budget in reversed(suite.budgets)
        for seed in suite.seeds
        for learner in suite.learners
        for task in suite.tasks
    ]
    found += [Trial(task, FOOT, 0, seed) for task in suite.tasks for seed in suite.seeds]
    return found + [Trial(task, top, 0, suite.seeds[0]) for task in suite.tasks for top in TOPS]
