"""Training of a defence: a trust model with numbers that are learned, against a mixture of
attackers.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from roletrust_agents.training.adam_training import Adam, falling_rate, slope_of
from roletrust_env.benchmarking.known_attacks import KnownAttack
from roletrust_env.evaluation.attackers import read_record
from roletrust_env.evaluation.measurement import SEARCHED, TaskArguments, mean_rewards
from roletrust_env.game.make_task import make_task
from roletrust_env.trust import TrustModel

Floats = npt.NDArray[np.float64]

_VALIDATION, _DRAW = 1_000_000_000, 1
"""Place of the games for validation beside the numbers of the steps, and the random numbers that
draw attackers."""

_AT_ONCE = 2  # conditions of a step


class DefenceLearner(Protocol):
    """A family of trust models, one for each vector of numbers."""

    @property
    def name(self) -> str:
        """Name in tables."""

    def start(self) -> Floats:
        """Return the vector from which a training begins, shape (n,)."""

    def spec(self, vector: Floats) -> str:
        """Return the trust model of a vector as a text that `parse_trust_model` reads."""

    def models(self, vectors: Floats, initial: float) -> TrustModel[Any]:
        """Return the trust models of K vectors as one model, for games of shape (K, G) in single
        precision.

        Args:
            vectors: Vectors, shape (K, n).
            initial: Trust before any rating, which the scenario says.
        """


class AttackerMixture(NamedTuple):
    """A condition in which a defence is trained, and the mixture of attackers there.

    Attributes:
        arguments: Arguments of the attack task, with a `Scenario`; the trust model in it is
            replaced.
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
        score: Mean reward in the games for validation: the loss of consumers, with the sign that
            higher is better.
        start: The same of the vector from which the training began.
        rounds: Number of game rounds that were played.
    """

    vector: Floats
    score: float
    start: float
    rounds: int


def train_defence(
    learner: DefenceLearner,
    fronts: Sequence[AttackerMixture],
    start: Floats,
    climb: Climb,
    seed: int,
    on_step: Callable[[], None] = lambda: None,
) -> Trained:
    """Train a defence by an evolution strategy, see `EvolutionStrategy`, against mixtures of
    attackers.

    A step plays two conditions in turn. All candidates meet the same attackers in the same games.
    The result is the best vector in the games for validation, where all attackers play and count by
    their weights; the start is validated, too, so that no training ends below it there.

    Args:
        learner: What is trained.
        fronts: Conditions and attackers, one or more.
        start: Vector to begin with, shape (n,).
        climb: Size of the training.
        seed: Random seed.
        on_step: Called after every step.
    """
    adam, rounds = Adam(start), 0

    def scores(
        places: Sequence[AttackerMixture], vectors: Floats, games: int, place: int
    ) -> Floats:
        nonlocal rounds
        rounds += (
            len(vectors) * games * sum(len(front.attackers) * _length(front) for front in places)
        )
        rewards = [_rewards(front, learner, vectors, games, (seed, place)) for front in places]
        return np.asarray(np.mean(rewards, axis=0))

    first = best = float(scores(fronts, start[None, :], climb.validation, _VALIDATION)[0])
    best_weights = start
    for step in range(climb.steps):
        noise = np.random.default_rng((seed, step)).standard_normal((climb.pairs, len(start)))
        candidates = adam.weights + climb.spread * np.concatenate([noise, -noise])
        turn = [
            fronts[(_AT_ONCE * step + k) % len(fronts)] for k in range(min(_AT_ONCE, len(fronts)))
        ]
        drawn = [_drawn(front, climb.attackers, (seed, step, _DRAW)) for front in turn]
        rate = falling_rate(climb.learning_rate, step / climb.steps)
        adam.climb(
            slope_of(scores(drawn, candidates, climb.games, step), noise, climb.spread), rate
        )
        if (step + 1) % climb.validate_every == 0 or step + 1 == climb.steps:
            score = float(scores(fronts, adam.weights[None, :], climb.validation, _VALIDATION)[0])
            if score > best:
                best_weights, best = adam.weights, score
        on_step()
    return Trained(best_weights, best, first, rounds)


def _drawn(front: AttackerMixture, many: int, seed: tuple[int, ...]) -> AttackerMixture:
    """Return a condition with attackers that are drawn from its mixture; each counts as often as it
    is drawn.
    """
    counts = np.random.default_rng(seed).multinomial(many, front.weights / front.weights.sum())
    drawn = tuple(
        attacker for attacker, count in zip(front.attackers, counts, strict=True) if count
    )
    return AttackerMixture(front.arguments, drawn, counts[counts > 0] / many)


def _rewards(
    front: AttackerMixture,
    learner: DefenceLearner,
    vectors: Floats,
    games: int,
    seed: tuple[int, ...],
) -> Floats:
    """Return the mean reward of K defences, shape (K,): what the attackers win, with the other
    sign.
    """
    model = learner.models(vectors, front.arguments["scenario"].initial_trust)
    task, lost = make_task(**{**front.arguments, "trust_model": model}), np.zeros(len(vectors))
    for attacker, weight in zip(front.attackers, front.weights, strict=True):
        rewards = mean_rewards(
            task, read_record(attacker.record), seed, (len(vectors), games), SEARCHED
        )[0]
        lost += weight * rewards.mean(axis=1)
    return -lost


def _length(front: AttackerMixture) -> int:
    """Return the number of rounds of a game."""
    length: int = front.arguments["scenario"].max_cycles
    return length
