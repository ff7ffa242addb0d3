"""Training of a defence: a trust model with numbers that are learned, against a mixture of attackers."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol, Self

import numpy as np
import numpy.typing as npt

from roletrust_agents.training.adam import Adam
from roletrust_agents.training.evolution_strategy import falling_rate, slope_of
from roletrust_env.benchmark.attackers import known_batches
from roletrust_env.benchmark.known_attacks import KnownAttack
from roletrust_env.evaluation.attacked_games import SEARCHED, TaskArguments, mean_rewards
from roletrust_env.evaluation.attackers import Attacker
from roletrust_env.game.make_task import make_task
from roletrust_env.trust import TrustModel

Floats = npt.NDArray[np.float64]

_VALIDATION, _DRAW = 1_000_000_000, 1
"""Place of the games for validation beside the numbers of the steps, and the random numbers that draw attackers."""

_AT_ONCE = 2  # conditions of a step


class Learner(Protocol):
    """A family of trust models, one for each vector of numbers."""

    @property
    def name(self) -> str:
        """Name in tables."""
        ...

    def start(self) -> Floats:
        """Return the vector from which a training begins, shape (n,)."""
        ...

    def spec(self, vector: Floats) -> str:
        """Return the trust model of a vector as a text that `parse_trust_model` reads."""
        ...

    def model(self, vector: Floats, initial: float) -> TrustModel[Any]:
        """Return the trust model of a vector.

        Args:
            vector: Vector, shape (n,).
            initial: Trust before any rating, which the scenario says.
        """
        ...


class Front(NamedTuple):
    """A condition in which a defence is trained, and the mixture of attackers there.

    Attributes:
        arguments: Arguments of the attack task, with a `Scenario`; the trust model in it is replaced.
        attackers: Attackers.
        weights: Probability of each attacker, shape (A,).
    """

    arguments: TaskArguments
    attackers: tuple[KnownAttack, ...]
    weights: Floats


@dataclass(frozen=True)
class Climb:
    """Size of a training.

    Attributes:
        steps: Number of steps.
        pairs: Number of pairs of candidates of a step.
        attackers: Number of attackers that a step draws from the mixture of a condition.
        games: Number of games against each of them.
        spread: Standard deviation of the candidates in each number.
        learning_rate: Initial learning rate of Adam.
        validation: Number of games against each attacker that choose the best vector.
        validate_every: Number of steps between two validations.
    """

    steps: int = 30
    pairs: int = 8
    attackers: int = 6
    games: int = 4
    spread: float = 0.1
    learning_rate: float = 0.05
    validation: int = 12
    validate_every: int = 10


class Trained(NamedTuple):
    """A trained defence.

    Attributes:
        vector: Its numbers, shape (n,).
        score: Mean reward in the games for validation: the loss of consumers, with the sign that higher is better.
        start: The same of the vector from which the training began.
        rounds: Number of game rounds that were played.
    """

    vector: Floats
    score: float
    start: float
    rounds: int


def train_defence(
    learner: Learner,
    fronts: Sequence[Front],
    start: Floats,
    climb: Climb,
    seed: int,
    on_step: Callable[[], None] = lambda: None,
) -> Trained:
    """Train a defence by an evolution strategy, see `EvolutionStrategy`, against mixtures of attackers.

    A step plays two conditions in turn. All candidates meet the same attackers in the same games. The result is the
    best vector in the games for validation, where all attackers play and count by their weights; the start is
    validated, too, so that no training ends below it there.

    Args:
        learner: What is trained.
        fronts: Conditions and attackers, one or more.
        start: Vector to begin with, shape (n,).
        climb: Size of the training.
        seed: Random seed.
        on_step: Called after every step.
    """
    matches = [_Match.of(front) for front in fronts]
    adam, rounds = Adam(start), 0

    def validated(vector: Floats) -> float:
        nonlocal rounds
        rounds += sum(one.rounds(climb.validation) for one in matches)
        return float(np.mean([one.score(learner, vector, climb.validation, (seed, _VALIDATION)) for one in matches]))

    first = best = validated(start)
    kept = start
    for step in range(climb.steps):
        noise = np.random.default_rng((seed, step)).standard_normal((climb.pairs, len(start)))
        candidates = adam.weights + climb.spread * np.concatenate([noise, -noise])
        chosen = [fronts[(_AT_ONCE * step + k) % len(fronts)] for k in range(min(_AT_ONCE, len(fronts)))]
        drawn = [_Match.of(_drawn(front, climb.attackers, (seed, step, _DRAW))) for front in chosen]
        rounds += len(candidates) * sum(one.rounds(climb.games) for one in drawn)
        scores = [
            np.mean([one.score(learner, vector, climb.games, (seed, step)) for one in drawn]) for vector in candidates
        ]
        rate = falling_rate(climb.learning_rate, step / climb.steps)
        adam.climb(slope_of(np.array(scores), noise, climb.spread), rate)
        if (step + 1) % climb.validate_every == 0 or step + 1 == climb.steps:
            score = validated(adam.weights)
            if score > best:
                kept, best = adam.weights, score
        on_step()
    return Trained(kept, best, first, rounds)


def _drawn(front: Front, many: int, seed: tuple[int, ...]) -> Front:
    """Return a condition with attackers that are drawn from its mixture; each counts as often as it is drawn."""
    counts = np.random.default_rng(seed).multinomial(many, front.weights / front.weights.sum())
    some = tuple(one for one, count in zip(front.attackers, counts, strict=True) if count)
    return Front(front.arguments, some, counts[counts > 0] / many)


class _Match(NamedTuple):
    """A condition with its attackers, those of a kind side by side.

    Attributes:
        arguments: Arguments of the attack task.
        batches: Attackers that play side by side, and their weights.
    """

    arguments: TaskArguments
    batches: tuple[tuple[Attacker, Floats], ...]

    @classmethod
    def of(cls, front: Front) -> Self:
        """Return the match of a condition."""
        weights = dict(zip((one.name for one in front.attackers), front.weights, strict=True))
        batches = known_batches(make_task(**front.arguments), front.attackers, 1)
        return cls(
            front.arguments,
            tuple((one.attacker, np.array([weights[name] for name in one.names])) for one in batches),
        )

    def rounds(self, games: int) -> int:
        """Return the number of game rounds of a score."""
        length: int = self.arguments["scenario"].max_cycles
        return sum(len(weights) for _, weights in self.batches) * games * length

    def score(self, learner: Learner, vector: Floats, games: int, seed: tuple[int, ...]) -> float:
        """Return the mean reward of a defence: what the attackers win, with the other sign."""
        model = learner.model(vector, self.arguments["scenario"].initial_trust)
        task, lost = make_task(**{**self.arguments, "trust_model": model}), 0.0
        for attacker, weights in self.batches:
            rewards = mean_rewards(task, attacker, seed, (len(weights), games), SEARCHED)[0]
            lost += float(weights @ rewards.mean(axis=1).astype(np.float64))
        return -lost
