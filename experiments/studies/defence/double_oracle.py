"""The game of defences and attackers that both grow: policy-space response oracles on whole games.

After Lanctot et al. (2017): the payoffs of all known trust models against all known attackers are a matrix game, which
is solved; each side then trains a best response to the other's mixture, and the matrix grows.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, NamedTuple

import numpy as np

from roletrust_agents.training.defence import AttackerMixture as Mixture
from roletrust_agents.training.defence import Climb, Floats, train_defence
from roletrust_agents.training.defence_learners import learner_of
from roletrust_env.benchmarking.known_attacks import KnownAttack
from roletrust_env.benchmarking.worst_case import Condition
from studies.defence.fronts import Front
from studies.defence.response import respond_by_attack
from studies.equilibrium import Payoffs, Solution, solve
from studies.study import Run

_PAYOFF, _ATTACK, _DEFENCE = 1, 2, 3
"""Kinds of random numbers: of the matrix, and of the two trainings."""

Keep = Callable[[str, Run], None]
"""Function that stores a finished run under a key."""


@dataclass(frozen=True)
class Setup:
    """Settings of a game.

    Attributes:
        learners: Names of what the defence trains, see `learner_of`.
        fixed: Specs of the trust models that the defence has at the beginning.
        iterations: Number of times that both sides respond.
        budget: Number of game rounds of the training of an attacker in one condition.
        climb: Size of the training of a defence.
        games: Number of games that choose, and of others that measure.
        explored: Share of all known opponents alike in the mixture that a training meets, besides the equilibrium, so
            that a defence does not forget an attack that is in no equilibrium now.
        seed: Random seed.
    """

    learners: tuple[str, ...]
    fixed: tuple[str, ...]
    iterations: int
    budget: int
    climb: Climb
    games: int
    explored: float
    seed: int

    def plain(self) -> dict[str, Any]:
        """Return the settings that decide the runs, as plain data. A run with more iterations continues another."""
        return {key: value for key, value in asdict(self).items() if key != "iterations"}


class Known(NamedTuple):
    """What both sides know at an iteration.

    Attributes:
        defences: Spec of each trust model by its name, in the order in which they came.
        attackers: Attackers of each condition, in the order in which they came.
    """

    defences: Mapping[str, str]
    attackers: tuple[tuple[KnownAttack, ...], ...]


def label(learner: str, k: int) -> str:
    """Return the name of the defence that a learner trains in iteration k, counted from 0."""
    return f"{learner}, trained {k + 1}"


class Game:
    """A game in progress: the runs so far, and what they say.

    Args:
        fronts: Conditions.
        setup: Settings.
        runs: Runs that are there, by key.
        keep: Function that stores a finished run.
    """

    def __init__(self, fronts: Sequence[Front], setup: Setup, runs: Mapping[str, Run], keep: Keep) -> None:
        self.fronts, self.setup, self.runs, self._keep = tuple(fronts), setup, dict(runs), keep

    @property
    def stages(self) -> int:
        """Number of values of `play`."""
        each = len(self.fronts) + len(self.setup.learners) + 1
        return len(self.fronts) + 1 + self.setup.iterations * each

    def play(self) -> Iterator[str]:
        """Play what is missing, and yield a few words after each stage, also after those that are there already."""
        for front in self.fronts:
            self.once(f"start|{front.name}", self._begun, front)
            yield f"attackers of the beginning, {front.name}"
        self.fill(0)
        yield "payoffs of the beginning"
        for k in range(self.setup.iterations):
            solution = self.solution(k)
            for c, front in enumerate(self.fronts):
                self.once(f"attack|{k}|{front.name}", self._attack, k, c, solution)
                yield f"iteration {k + 1}: an attacker, {front.name}"
            for name in self.setup.learners:
                self.once(f"defence|{k}|{name}", self._defence, k, name, solution)
                yield f"iteration {k + 1}: a defence, {name}"
            self.fill(k + 1)
            yield f"iteration {k + 1}: payoffs"

    def known(self, k: int) -> Known:
        """Return what is known after k iterations."""
        defences = {spec: spec for spec in self.setup.fixed}
        for i in range(k):
            defences |= {label(name, i): self.runs[f"defence|{i}|{name}"]["spec"] for name in self.setup.learners}
        attackers = []
        for front in self.fronts:
            begun = [KnownAttack(**fields) for fields in self.runs[f"start|{front.name}"]["attackers"]]
            runs = [self.runs[f"attack|{i}|{front.name}"]["attacker"] for i in range(k)]
            attackers.append((*begun, *(KnownAttack(**fields) for fields in runs)))
        return Known(defences, tuple(attackers))

    def fill(self, k: int) -> None:
        """Play all pairs of what is known after k iterations that have not met."""
        known = self.known(k)
        for front, attackers in zip(self.fronts, known.attackers, strict=True):
            for name, spec in known.defences.items():
                key = f"payoff|{front.name}|{name}"
                before = self.runs.get(key, {})
                missing = [one for one in attackers if one.name not in before]
                if missing:
                    found = front.skills(spec, missing, self.seed(_PAYOFF), self.setup.games)
                    met = {name: [part.tolist() for part in skills] for name, skills in found.items()}
                    self._store(key, {**before, **met})

    def payoffs(self, k: int) -> list[Payoffs]:
        """Return the matrix of each condition after k iterations."""
        known, found = self.known(k), []
        for front, attackers in zip(self.fronts, known.attackers, strict=True):
            names = tuple(one.name for one in attackers)
            rows = [[self.runs[f"payoff|{front.name}|{one}"][name] for name in names] for one in known.defences]
            chosen, measured = np.moveaxis(np.array(rows), 2, 0)
            where = front.condition
            found.append(Payoffs(Condition(where.scenario, where.track, where.share), names, chosen, measured))
        return found

    def solution(self, k: int) -> Solution:
        """Return the equilibrium after k iterations, in the games that choose."""
        return solve([one.chosen.mean(axis=2) for one in self.payoffs(k)])

    def seed(self, *place: int) -> int:
        """Return the seed of a place in the game: its first number is the kind, see `_PAYOFF`."""
        return int(np.random.SeedSequence((self.setup.seed, *place)).generate_state(1)[0])

    def once(self, key: str, play: Callable[..., Run], *arguments: Any) -> None:
        """Play a run and keep it, unless it is there.

        Args:
            key: Key of the run.
            play: Function that plays it.
            *arguments: Arguments of the function.
        """
        if key not in self.runs:
            self._store(key, play(*arguments))

    def _begun(self, front: Front) -> Run:
        found = front.beginners(self.setup.fixed, self.seed(_PAYOFF), self.setup.games)
        return {"attackers": [one.model_dump() for one in found]}

    def _attack(self, k: int, c: int, solution: Solution) -> Run:
        front, known = self.fronts[c], self.known(k)
        shares = dict(zip(known.defences, solution.models.tolist(), strict=True))
        arguments = {name: front.arguments(spec) for name, spec in known.defences.items()}
        seed = self.seed(_ATTACK, k, c)
        attacker, rounds = respond_by_attack(arguments, shares, known.attackers[c], self.setup.budget, seed)
        return {"attacker": front.known(f"learned in iteration {k + 1}", attacker).model_dump(), "rounds": rounds}

    def _defence(self, k: int, name: str, solution: Solution) -> Run:
        learner, known = learner_of(name), self.known(k)
        mixtures = [
            Mixture(front.arguments(self.setup.fixed[0]), attackers, self._explored(weights))
            for front, attackers, weights in zip(self.fronts, known.attackers, solution.attacks, strict=True)
        ]
        start = np.array(self.runs[f"defence|{k - 1}|{name}"]["vector"]) if k else learner.start()
        seed = self.seed(_DEFENCE, k, self.setup.learners.index(name))
        trained = train_defence(learner, mixtures, start, self.setup.climb, seed)
        scores = {"score": trained.score, "start": trained.start, "rounds": trained.rounds}
        return {"spec": learner.spec(trained.vector), "vector": trained.vector.tolist(), **scores}

    def _explored(self, weights: Floats) -> Floats:
        share = self.setup.explored
        mixed: Floats = (1 - share) * weights / weights.sum() + share / len(weights)
        return mixed

    def _store(self, key: str, run: Run) -> None:
        self.runs[key] = run
        self._keep(key, run)
