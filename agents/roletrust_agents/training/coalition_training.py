"""What trainings of the network of a coalition have in common: tasks, the start, validation, and
the best network.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from typing import Generic, NamedTuple

import numpy as np
import numpy.typing as npt

from roletrust_agents.learned.coalition_attacker import CoalitionAttacker
from roletrust_agents.learned.deep_set import DeepSet, DeepSetArchitecture, random_weights
from roletrust_agents.training.settings import CoalitionSettings, CoalitionSettingsT
from roletrust_env.evaluation.measurement import SEARCHED, mean_rewards
from roletrust_env.game.attack_task import AttackTask
from roletrust_env.metrics.confidence import GameMean, over_games

Floats = npt.NDArray[np.float64]

_VALIDATION, _START, _AGAIN = 1_000_000_000, 1_000_000_001, 1_000_000_002
"""Places of the games for validation and of those that choose the start, beside the numbers of the
steps."""

_START_GAMES = 4  # but no more than a validation has
# share of the quotient: with all of it, an attack that changes nothing is as good as the start
_AIM = 0.8
_LEADING, _WIDE_GAMES = (
    16,
    16,
)  # starts of wide networks that are tried again, and games of each before that
_KNOWN = (
    4  # known networks that are validated at the beginning, as far as a tenth of the rounds allows
)
_TASKS_AT_ONCE = 2
_CELLS = 400_000  # limit on the ratings of a round in one batch


def start_games(settings: CoalitionSettings, known: int) -> int:
    """Return the largest number of games of the start of a wide network where the budget is
    small.
    """
    return known * min(_START_GAMES, settings.validation) + 2 * settings.validation


class Validated(NamedTuple):
    """A network and its score in the games for validation."""

    weights: Floats
    score: float


class CoalitionTraining(ABC, Generic[CoalitionSettingsT]):
    """A training in progress: steps that improve weights, and validations that keep the best ones.

    With several tasks a step plays two of them in turn; the result is an attacker for all.

    Args:
        tasks: Tasks with the same reward, one or more.
        settings: Settings.
        seed: Random seed.
        budget: Number of rounds that the whole training may play.
        known: Weights of known networks to start from, shape (n,) each, besides the random ones.

    Attributes:
        settings: Settings.
        architecture: Architecture of the network.
        steps: Number of steps so far.
        rounds: Number of rounds that were played.
        best: Best validated network; None before the first validation. The best known networks are
            validated first, for a training can end below its start.
    """

    def __init__(
        self,
        tasks: Sequence[AttackTask],
        settings: CoalitionSettingsT,
        seed: int,
        budget: int,
        known: Sequence[Floats] = (),
    ) -> None:
        self.tasks, self.settings, self.seed, self.budget = tuple(tasks), settings, seed, budget
        self.architecture = DeepSetArchitecture.of(settings.units, wide=settings.wide)
        self.steps = self.rounds = 0
        self.best: Validated | None = None
        fitting = [weights for weights in known if len(weights) == self.architecture.size]
        self._known, self._starts = fitting, self._order(fitting)
        if settings.wide and self.tasks[0].objective == "mislead":
            self.tasks = tuple(self._aimed(task) for task in self.tasks)
        self._validate_known(fitting)
        self._begin()

    @abstractmethod
    def _begin(self) -> None:
        """Make what the training needs besides; the networks to start from are in order, the best
        first.
        """

    @property
    @abstractmethod
    def weights(self) -> Floats:
        """The weights that a validation measures, shape (n,)."""

    @abstractmethod
    def step(self) -> None:
        """Play the games of a step, and learn from them."""

    @abstractmethod
    def state(self) -> bytes:
        """Return what `restore` needs, beside the best network."""

    @abstractmethod
    def restore(self, state: bytes) -> None:
        """Continue a new training with the same arguments from the output of `state`."""

    @property
    def most_rounds(self) -> int:
        """Largest number of rounds of a step, with a validation after it."""
        at_once = self.step_games * len(self.turn)
        return (at_once + self.settings.validation * len(self.tasks)) * self.length

    @property
    def step_games(self) -> int:
        """Number of games of the next step with one task."""
        return self.settings.step_games

    @property
    def network(self) -> DeepSet:
        """The best validated network, on NumPy in single precision."""
        return self.networks(self.weights if self.best is None else self.best.weights)

    @property
    def turn(self) -> list[int]:
        """Indices of the tasks of the next step."""
        many = len(self.tasks)
        return [(_TASKS_AT_ONCE * self.steps + k) % many for k in range(min(_TASKS_AT_ONCE, many))]

    @property
    def length(self) -> int:
        """Mean number of rounds of a game."""
        return round(float(np.mean([task.game.scenario.max_cycles for task in self.tasks])))

    @property
    def done(self) -> float:
        """Share of the budget that is played."""
        return min(1.0, self.rounds / self.budget)

    def within(self, rounds: int) -> Iterator[bool]:
        """Step while a number of rounds allows a further step, and validate when it is due and at
        the end.

        Args:
            rounds: Number of rounds, those so far included.

        Yields:
            Whether the step was validated.
        """
        while self.rounds + self.most_rounds <= rounds:
            self.step()
            judged = self.due() or self.rounds + self.most_rounds > rounds
            if judged:
                self.validate()
            yield judged

    def due(self) -> bool:
        """Return whether a validation is due."""
        return self.steps % self.settings.validate_every == 0

    def validate(self) -> GameMean:
        """Return the score of the weights in the games for validation, and keep them if they are
        the best.
        """
        return self._validate(self.weights.copy())

    def _validate(self, weights: Floats) -> GameMean:
        games = self.settings.validation
        network = self.networks(weights[None, :])
        played = [self.play(task, network, games, _VALIDATION)[0] for task in self.tasks]
        score = over_games(np.mean(played, axis=0))
        self.rounds += games * len(self.tasks) * self.length
        if self.best is None or score.mean > self.best.score:
            self.best = Validated(weights, float(score.mean))
        return score

    def networks(self, weights: Floats) -> DeepSet:
        """Return the network of weights of shape (n,), or K networks of shape (K, n)."""
        return DeepSet.unflatten(self.architecture, weights.astype(np.float32))

    def play(self, task: AttackTask, networks: DeepSet, games: int, place: int) -> Floats:
        """Return the scores of K networks in G games, shape (K, G). As many play at once as fit."""
        step = max(1, _CELLS // (task.game.roster.n_raters * task.game.roster.n_providers * games))
        rows, parts = len(networks.weights["layer2.bias"]), []
        for at in range(0, rows, step):
            part = DeepSet(
                networks.architecture,
                {name: w[at : at + step] for name, w in networks.weights.items()},
            )
            batch, seed = (min(step, rows - at), games), (self.seed, place)
            parts.append(mean_rewards(task, CoalitionAttacker(part), seed, batch, SEARCHED)[0])
        scores: Floats = np.concatenate(parts).astype(np.float64)
        return scores

    def _validate_known(self, known: list[Floats]) -> None:
        """Validate the best of the known networks."""
        each = self.settings.validation * self.length * len(self.tasks)
        first = [
            weights
            for weights in self._starts
            if any(weights is known_weights for known_weights in known)
        ]
        for weights in first[: min(_KNOWN, self.budget // 10 // each)]:
            self._validate(weights)

    def _order(self, known: list[Floats]) -> list[Floats]:
        """Return the known networks and random ones, the best first."""
        games = min(_START_GAMES, self.settings.validation)
        each = games * self.length * len(self.tasks)
        many = max(0, min(self.settings.candidates, self.budget // 10 // each - len(known)))
        random = np.random.default_rng(self.seed)
        candidates: list[Floats] = [
            *known,
            *(random_weights(self.architecture, random) for _ in range(max(many, not known))),
        ]
        if len(candidates) == 1:
            return candidates
        wide = (
            self.settings.wide
        )  # has several starts for each known network: a few games tell them apart badly
        if wide:
            games = min(
                _WIDE_GAMES,
                max(games, self.budget // 8 // (len(candidates) * self.length * len(self.tasks))),
            )
        order = np.argsort(-self._scores(candidates, games, _START), kind="stable")
        leading = [candidates[k] for k in order[:_LEADING]]
        again = min(
            self.settings.validation,
            self.budget // 8 // (len(leading) * self.length * len(self.tasks)),
        )
        if wide and again > games:
            order[:_LEADING] = order[
                np.argsort(-self._scores(leading, again, _AGAIN), kind="stable")
            ]
        return [candidates[k] for k in order]

    def _aimed(self, task: AttackTask) -> AttackTask:
        """Return a task in which attacks count by the skill that they leave to consumers, near that
        of the best start.

        The method is that of Dinkelbach (1967) for quotients, with one step.
        """
        network, games = self.networks(self._starts[0][None, :]), self.settings.validation
        lost, best_possible = (
            self.play(task.with_blind_share(share), network, games, _AGAIN).mean()
            for share in (0.0, 1.0)
        )
        self.rounds += 2 * games * self.length
        return task.with_blind_share(
            _AIM * min(1.0, max(0.0, lost / max(lost - best_possible, 1e-9)))
        )

    def _scores(self, candidates: list[Floats], games: int, place: int) -> Floats:
        """Return the mean score of each candidate in games with each task."""
        networks = self.networks(np.stack(candidates))
        played = [self.play(task, networks, games, place) for task in self.tasks]
        self.rounds += len(candidates) * games * self.length * len(self.tasks)
        means: Floats = np.mean(played, axis=(0, 2))
        return means
