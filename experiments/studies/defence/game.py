"""The game of defences and attackers that both grow: policy-space response oracles on whole games.

After Lanctot et al. (2017): the payoffs of all known trust models against all known attackers are a
matrix game, which is solved; each side then trains a best response to the other's mixture, and the
matrix grows. At the end, the learned models stand beside fixed ones.
"""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from roletrust_agents.learned.coalition_attacker import CoalitionAttacker
from roletrust_agents.training.adam_training import EvolutionStrategy
from roletrust_agents.training.defence import AttackerMixture, Climb, Floats, train_defence
from roletrust_agents.training.defence_learners import learner_of
from roletrust_agents.training.settings import StrategySettings
from roletrust_agents.training.universal import known_starts
from roletrust_env.benchmarking.known_attacks import KnownAttack
from roletrust_env.benchmarking.worst_case import Condition
from roletrust_env.evaluation.attackers import Attacker
from roletrust_env.game.make_task import make_task
from studies.defence.fronts import Front, Skills
from studies.equilibrium import Payoffs, Solution, solve
from studies.study import Run

_PAYOFF, _ATTACK, _DEFENCE, _OWN = 1, 2, 3, 4
"""Kinds of random numbers: of the matrix, of the two trainings, and of the comparison."""

_LEAST = 0.02  # share of a model below which a training leaves it out


class Options(NamedTuple):
    """The game and its effort.

    Attributes:
        defence: Defences to train: the numbers of a trust model, by its name, or `network`.
        model: Specs of fixed trust models that the defence has at the beginning.
        beside: Specs of further trust models for the comparison at the end.
        suite: Suite with the conditions.
        front: Conditions to train in, as SCENARIO/TRACK/SHARE.
        world: Conditions that are kept for the comparison.
        iterations: Number of times that both sides respond.
        budget: Rounds x games of the training of an attacker in one condition.
        steps: Steps of the training of a defence.
        games: Games that choose, and as many others that measure.
        fresh: The same for the comparison, in fresh games.
        explored: Share of all known attackers alike in what a defence is trained against.
        runs: Number of runs, with the seed of the study and those after it.
    """

    defence: tuple[str, ...] = ("leave-one-out", "first-hand", "network")
    model: tuple[str, ...] = (
        "role-trust",
        "wary-role-trust",
        "leave-one-out",
        "iterative-filtering",
    )
    beside: tuple[str, ...] = ("travos", "own-experience", "first-hand")
    suite: str = "four-worlds"
    front: tuple[str, ...] = (
        "crowd/raters/0.4",
        "crowd/coalition/0.2",
        "market/raters/0.2",
        "market/coalition/0.2",
    )
    world: tuple[str, ...] = (
        "diverse/raters/0.2",
        "diverse/coalition/0.1",
        "large/raters/0.2",
        "large/coalition/0.1",
    )
    iterations: int = 3
    budget: int = 60_000
    steps: int = 20
    games: int = 24
    fresh: int = 24
    explored: float = 0.25
    runs: int = 3


def label(learner: str, k: int) -> str:
    """Return the name of the defence that a learner trains in iteration k, counted from 0."""
    return f"{learner}, trained {k + 1}"


class Game:
    """A game in progress.

    Args:
        asked: Options of the study.
        seed: Random seed.

    Attributes:
        fronts: Conditions of the training.
        defences: Spec of each trust model by its name, in the order in which they came.
        attackers: Attackers of each condition, in the order in which they came.
        trained: Numbers of each learned model by its name.
    """

    def __init__(self, asked: Options, seed: int) -> None:
        self.asked, self._seed = asked, seed
        self.fronts = [Front.parse(asked.suite, name) for name in asked.front]
        self.defences = {spec: spec for spec in asked.model}
        self.attackers = [
            front.beginners(asked.model, self.seed(_PAYOFF), asked.games) for front in self.fronts
        ]
        self.trained: dict[str, Floats] = {}
        self._skills: list[dict[str, dict[str, Skills]]] = [{} for _ in self.fronts]
        self._meet()

    def seed(self, *place: int) -> int:
        """Return the seed of a place in the game: its first number is the kind, see `_PAYOFF`."""
        return int(np.random.SeedSequence((self._seed, *place)).generate_state(1)[0])

    def payoffs(self) -> list[Payoffs]:
        """Return the matrix of each condition."""
        payoffs = []
        for front, attackers, skills in zip(self.fronts, self.attackers, self._skills, strict=True):
            names = tuple(attacker.name for attacker in attackers)
            cells = np.array(
                [[skills[defence][name] for name in names] for defence in self.defences]
            )
            condition = Condition(*front[1:])
            payoffs.append(Payoffs(condition, names, *np.moveaxis(cells, 2, 0)))
        return payoffs

    def respond(self, k: int, solution: Solution) -> None:
        """Let each side train a best response to the other's mixture in iteration k, and play the
        new pairs.
        """
        asked, known = self.asked, [tuple(attackers) for attackers in self.attackers]
        shares = dict(zip(self.defences, solution.models.tolist(), strict=True))
        for c, front in enumerate(self.fronts):
            arguments = {name: front.arguments(spec) for name, spec in self.defences.items()}
            attacker = respond_by_attack(
                arguments, shares, known[c], asked.budget, self.seed(_ATTACK, k, c)
            )
            self.attackers[c].append(front.known(f"learned in iteration {k + 1}", attacker))
        mixtures = [
            AttackerMixture(front.arguments(asked.model[0]), attackers, self._explored(weights))
            for front, attackers, weights in zip(self.fronts, known, solution.attacks, strict=True)
        ]
        for i, name in enumerate(asked.defence):
            learner = learner_of(name)
            start = self.trained[label(name, k - 1)] if k else learner.start()
            trained = train_defence(
                learner, mixtures, start, Climb(steps=asked.steps), self.seed(_DEFENCE, k, i)
            )
            self.trained[label(name, k)] = trained.vector
            self.defences[label(name, k)] = learner.spec(trained.vector)
        self._meet()

    def compare(self, name: str, spec: str) -> Run:
        """Return the skill of a trust model in the games that measure, by column of the comparison,
        shape (G,) each.

        `clean`: nobody attacks. `worst`: under the worst attacker that the game has found, or that
        is trained against this model alone. `strangers`: under the worst attacker that no training
        has met. `worlds`: the same in other conditions.
        """
        asked, skills_of_column = self.asked, dict[str, list[Floats]]()
        seed = self.seed(_OWN)
        for c, (front, attackers) in enumerate(zip(self.fronts, self.attackers, strict=True)):
            arguments = {name: front.arguments(spec)}
            own = respond_by_attack(
                arguments, {name: 1.0}, attackers, asked.budget, self.seed(_OWN, c)
            )
            met = [*attackers, front.known("trained against it alone", own)]
            for column, opponents in (("worst", met), ("strangers", front.strangers(attackers))):
                skills_of_column.setdefault(column, []).append(
                    front.worst(spec, opponents, seed, asked.fresh)
                )
            skills_of_column.setdefault("clean", []).append(front.clean(spec, seed, asked.fresh))
        for world in (Front.parse(asked.suite, name) for name in asked.world):
            skills_of_column.setdefault("worlds", []).append(
                world.worst(spec, world.strangers(()), seed, asked.fresh)
            )
        return {
            column: np.mean(skills, axis=0).tolist() for column, skills in skills_of_column.items()
        }

    def _meet(self) -> None:
        """Play all pairs of trust models and attackers that have not met."""
        for front, attackers, skills in zip(self.fronts, self.attackers, self._skills, strict=True):
            for name, spec in self.defences.items():
                before = skills.setdefault(name, {})
                if missing := [attacker for attacker in attackers if attacker.name not in before]:
                    before |= front.skills(spec, missing, self.seed(_PAYOFF), self.asked.games)

    def _explored(self, weights: Floats) -> Floats:
        share = self.asked.explored
        mixed: Floats = (1 - share) * weights / weights.sum() + share / len(weights)
        return mixed


def play_game(asked: Options, seed: int) -> Run:
    """Play a game to its end, and compare its best models with fixed ones.

    Returns:
        `iterations`: columns of each iteration, see `measure_iteration`. `mixture`: probability of
        each trust model at the end, by its name. `specs`: their specs. `learned`: iteration, from
        0, of the model of each learner that has the best worst case over all known attackers, in
        the games that choose. `vectors`: its numbers. `compared`: see `Game.compare`, by the name
        of the model.
    """
    game, iterations = Game(asked, seed), []
    for k in range(asked.iterations):
        before = game.payoffs()
        solution = solve([payoffs.chosen.mean(axis=2) for payoffs in before])
        game.respond(k, solution)
        iterations.append(measure_iteration(before, solution, game.payoffs()))
    last = game.payoffs()
    worst = dict(zip(game.defences, least(last).tolist(), strict=True))
    learned = {}
    for name in asked.defence:
        values = [worst[label(name, k)] for k in range(asked.iterations)]
        learned[name] = values.index(max(values))
    specs = {label(name, k): game.defences[label(name, k)] for name, k in learned.items()}
    specs |= {spec: spec for spec in (*asked.model, *asked.beside)}
    weights = solve([payoffs.chosen.mean(axis=2) for payoffs in last]).models
    return {
        "iterations": [
            {column: skills.tolist() for column, skills in iteration.items()}
            for iteration in iterations
        ],
        "mixture": dict(zip(game.defences, weights.tolist(), strict=True)),
        "specs": game.defences,
        "learned": learned,
        "vectors": {name: game.trained[label(name, k)].tolist() for name, k in learned.items()},
        "compared": {name: game.compare(name, spec) for name, spec in specs.items()},
    }


def least(payoffs: Sequence[Payoffs]) -> Floats:
    """Return the skill of each trust model under the worst attackers, in the games that choose,
    shape (M,).
    """
    mean: Floats = np.mean([payoff.chosen.mean(axis=2).min(axis=1) for payoff in payoffs], axis=0)
    return mean


def measure_iteration(
    before: Sequence[Payoffs], solution: Solution, after: Sequence[Payoffs]
) -> dict[str, Floats]:
    """Return what an iteration says, in the games that measure, the mean over the conditions, shape
    (G,) each.

    Mixtures and responses are chosen in one set of games, and all numbers are of other games. A
    response is the best of those that are known after the iteration.

    Returns:
        `value`: skill of the defence's mixture against the attackers' mixture. `attack`, `defence`:
        what either side wins by a best response to the other's mixture. `nash_conv`: the sum of
        both, a lower bound of the NashConv of the mixtures in the whole game. `worst`: skill of the
        defence's mixture under the best responses to it. `single`: skill of the trust model that is
        the best one alone, under the worst attackers for it.
    """
    models = len(solution.models)
    value, worst = [], []
    replies = np.zeros(len(after[0].chosen))
    for payoff, weights in zip(after, solution.attacks, strict=True):
        attackers = len(weights)
        mixed, measured = (
            np.tensordot(solution.models, part[:models], 1)
            for part in (payoff.chosen, payoff.measured)
        )
        value.append(weights @ measured[:attackers] / weights.sum())
        worst.append(measured[np.argmin(mixed.mean(axis=1))])
        replies += payoff.chosen.mean(axis=2)[:, :attackers] @ weights / weights.sum()
    best = int(np.argmax(replies))
    replied = [
        weights @ payoff.measured[best, : len(weights)] / weights.sum()
        for payoff, weights in zip(after, solution.attacks, strict=True)
    ]
    alone = int(np.argmax(least(before)))
    single = [
        payoff.measured[alone, np.argmin(payoff.chosen[alone].mean(axis=1))] for payoff in after
    ]
    at, under, reply = (np.mean(part, axis=0) for part in (value, worst, replied))
    wins = {"value": at, "attack": at - under, "defence": reply - at, "nash_conv": reply - under}
    return {**wins, "worst": under, "single": np.mean(single, axis=0)}


def respond_by_attack(
    arguments: Mapping[str, Mapping[str, Any]],
    shares: Mapping[str, float],
    known: Sequence[KnownAttack],
    budget: int,
    seed: int,
) -> Attacker:
    """Train a coalition against a mixture of trust models, from the known coalitions and the
    universal ones.

    Args:
        arguments: Arguments of the attack task against each trust model, by its spec.
        shares: Probability of each trust model, by its spec.
        known: Known attackers of the condition.
        budget: Number of game rounds that the training may play.
        seed: Random seed.

    Raises:
        ValueError: The budget allows no step against so many models.
    """
    many = {model: share for model, share in shares.items() if share >= _LEAST}
    tasks = [make_task(**arguments[model]) for model in many]
    weights = np.array(list(many.values()))
    starts = known_starts("universal", [attack.record for attack in known], wide=False)
    training = EvolutionStrategy(
        tasks,
        StrategySettings(wide=False),
        seed,
        budget,
        starts,
        (weights / weights.sum()).tolist(),
    )
    needed = training.rounds + training.most_rounds
    if needed > budget:
        raise ValueError(
            f"--budget is {budget} rounds; training an attacker against {len(many)} models needs "
            f"{needed} or more"
        )
    for _ in training.within(budget):
        pass
    return CoalitionAttacker(training.network)
