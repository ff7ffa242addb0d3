"""Learned defences beside fixed trust models: the same attackers and budgets, and attackers that nobody has met."""

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from roletrust_agents.training.defence import Floats
from roletrust_env.benchmarking.known_attacks import KnownAttack
from roletrust_env.metrics.confidence import Interval
from studies.defence.double_oracle import Game, label
from studies.defence.fronts import Front
from studies.defence.progress import Measured, best_trained, over_runs
from studies.defence.response import respond_by_attack
from studies.study import Run

_OWN = 4  # random numbers of the trainings against one model, see `double_oracle`
_HELD_OUT = "held out"


class Row(NamedTuple):
    """A trust model, or its lead over another one, as means of skill over conditions, games and runs.

    The 95% intervals cover games, and other trainings if there are several runs.

    Attributes:
        name: Name of the trust model.
        clean: Skill where nobody attacks, in the conditions of the training.
        worst: Skill under the worst attacker that the game has found, or that is trained against this model alone
            with the same budget, in the same conditions.
        strangers: Skill under the worst attacker that no training has met, in the same conditions; None where a
            condition has none.
        worlds: The same in other conditions; None without any.
    """

    name: str
    clean: Interval
    worst: Interval
    strangers: Interval | None = None
    worlds: Interval | None = None


class Comparison:
    """Models beside each other after a game.

    Args:
        game: Game that is played to its end.
        beside: Specs of further trust models.
        worlds: Conditions that no training has met.
        games: Number of games that choose the worst attacker, and of others that measure.

    Attributes:
        models: Spec of each trust model by its name.
        learned: Iteration, from 0, of the best model of each learner.
        fixed: Specs of the other trust models.
    """

    def __init__(self, game: Game, beside: Sequence[str], worlds: Sequence[Front], games: int) -> None:
        self._game, self._worlds, self._games = game, tuple(worlds), games
        last = self._iterations = game.setup.iterations
        self._seen = f"seen|{last}"
        self.learned = {name: best_trained(game, name) for name in game.setup.learners}
        known = game.known(last).defences
        learned = {one: known[one] for one in (label(name, k) for name, k in self.learned.items())}
        self.fixed = tuple(dict.fromkeys((*game.setup.fixed, *beside)))
        self.models = learned | {spec: spec for spec in self.fixed}

    @property
    def stages(self) -> int:
        """Number of values of `play`."""
        return len(self.models) * (len(self._game.fronts) + len(self._worlds))

    def play(self) -> Iterator[str]:
        """Play what is missing, and yield a few words after each stage."""
        population = self._game.known(self._iterations).attackers
        for name, spec in self.models.items():
            for c, (front, attackers) in enumerate(zip(self._game.fronts, population, strict=True)):
                own = f"own|{self._iterations}|{front.name}|{name}"
                self._game.once(own, self._own, c, name, spec)
                met = [*attackers, KnownAttack(**self._game.runs[own]["attacker"])]
                self._meet(self._seen, front, name, spec, met)
                self._meet(_HELD_OUT, front, name, spec, front.strangers(attackers))
                self._game.once(f"clean|{front.name}|{name}", self._clean, front, spec)
                yield f"{name} in {front.name}"
            for front in self._worlds:
                self._meet(_HELD_OUT, front, name, spec, front.strangers(()))
                yield f"{name} in {front.name}"

    def measured(self, name: str) -> Measured:
        """Return the skill of a trust model in the games that measure, without the columns that have no attackers."""
        fronts, runs = self._game.fronts, self._game.runs
        found = {
            "clean": np.mean([runs[f"clean|{front.name}|{name}"]["skill"] for front in fronts], axis=0),
            "worst": self._worst(self._seen, fronts, name),
        }
        for column, held_out in (("strangers", fronts), ("worlds", self._worlds)):
            if held_out and all(f"{_HELD_OUT}|{front.name}|{name}" in runs for front in held_out):
                found[column] = self._worst(_HELD_OUT, held_out, name)
        return found

    def _own(self, c: int, name: str, spec: str) -> Run:
        """Train an attacker against one model, with the budget of an attacker in the game."""
        game = self._game
        front, known = game.fronts[c], game.known(self._iterations).attackers[c]
        seed = game.seed(_OWN, c)
        attacker, rounds = respond_by_attack({name: front.arguments(spec)}, {name: 1.0}, known, game.setup.budget, seed)
        return {"attacker": front.known("trained against it alone", attacker).model_dump(), "rounds": rounds}

    def _meet(self, kind: str, front: Front, name: str, spec: str, attackers: Sequence[KnownAttack]) -> None:
        if attackers:
            self._game.once(f"{kind}|{front.name}|{name}", self._met, front, spec, attackers)

    def _met(self, front: Front, spec: str, attackers: Sequence[KnownAttack]) -> Run:
        found = front.skills(spec, attackers, self._game.seed(_OWN), self._games)
        return {attack: [part.tolist() for part in skills] for attack, skills in found.items()}

    def _clean(self, front: Front, spec: str) -> Run:
        return {"skill": front.clean(spec, self._game.seed(_OWN), self._games).tolist()}

    def _worst(self, kind: str, fronts: Sequence[Front], name: str) -> Floats:
        """Return the skill in the games that measure, each condition under the attack that is worst in the others."""
        met = [self._game.runs[f"{kind}|{front.name}|{name}"].values() for front in fronts]
        worst = [min(attacks, key=lambda halves: float(np.mean(halves[0])))[1] for attacks in met]
        mean: Floats = np.mean(worst, axis=0)
        return mean


def names_of(runs: Sequence[Comparison]) -> dict[str, str]:
    """Return the name of the model of each learner; that of several runs does not say in which iteration it came."""
    many = len(runs) > 1
    return {name: f"{name}, trained" if many else label(name, k) for name, k in runs[0].learned.items()}


def rows(runs: Sequence[Comparison]) -> list[Row]:
    """Return the models over runs with other seeds, the best worst case first."""
    learned = {name: _of_learner(runs, learner) for learner, name in names_of(runs).items()}
    # Apart from the fixed ones: each run trains its own learned models, so their means vary more.
    return sorted([*_rows(learned), *_rows(_of_fixed(runs))], key=lambda row: -row.worst.value)


def leads(runs: Sequence[Comparison]) -> dict[str, list[Row]]:
    """Return by how much the model of each learner is above each fixed one, in the same games."""
    found, fixed = {}, _of_fixed(runs)
    for learner, name in names_of(runs).items():
        ours = _of_learner(runs, learner)
        pairs = {other: zip(ours, theirs, strict=True) for other, theirs in fixed.items()}
        found[name] = _rows({o: [{c: a[c] - b[c] for c in a} for a, b in each] for o, each in pairs.items()})
    return found


def _of_learner(runs: Sequence[Comparison], learner: str) -> list[Measured]:
    return [run.measured(label(learner, run.learned[learner])) for run in runs]


def _of_fixed(runs: Sequence[Comparison]) -> dict[str, list[Measured]]:
    return {name: [run.measured(name) for run in runs] for name in runs[0].fixed}


def _rows(measured: Mapping[str, Sequence[Measured]]) -> list[Row]:
    return [Row(name, **columns) for name, columns in over_runs(measured).items()]
