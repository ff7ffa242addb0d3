"""Search over scripted attacks and their parameters in all selection worlds at once.

All scripted attacks are tried first. Then CMA-ES (Hansen and Ostermeier, 2001; package `cma`)
changes the parameters of the most harmful ones, one in each start. All attacks meet the same games,
so that they compare.
"""

import warnings
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from roletrust_env.benchmarking.play import CellPlay
from roletrust_env.evaluation.agreed import DIGITS, AgreedScripts
from roletrust_env.evaluation.attackers import Attacker
from roletrust_env.metrics.score import mean_or_nan

_POPULATION = 8

_SPREAD = 0.3
"""Standard deviation of the first generation of CMA-ES, whose mean is the middle of all ranges."""

_UNDEFINED = 1000.0
"""Skill in place of one that is undefined, which no attacker wants."""

FINALISTS = 4
"""Number of the best attacks that are tried again in all games of the selection worlds. The best of
many noisy scores is biased."""

Floats = npt.NDArray[np.float64]


class FoundAttack(NamedTuple):
    """An attack of a cell.

    Attributes:
        name: Name in results.
        attack: The attack, for any world.
        words: Short description.
        rounds: Number of game rounds that were played to find it.
        progress: Course of its search: the rounds played, and the lowest mean skill so far.
    """

    name: str
    attack: Attacker
    words: str
    rounds: int = 0
    progress: tuple[tuple[int, float], ...] = ()


def search(play: CellPlay, bases: Sequence[tuple[str, ...]]) -> Iterator[FoundAttack]:
    """Yield the attack that each start of a search finds.

    Start k changes the parameters of the k-th most harmful base, so that two starts that agree show
    more than two of the same base. The budget is that of the suite.

    Args:
        play: Worlds of the cell.
        bases: Specs of scripted attacks that are played together.
    """
    task, defaults = play.task("selection", 0), _Trial(play)
    defaults.play([AgreedScripts(base) for base in bases])
    order = np.argsort(defaults.skills, kind="stable")
    for start in range(play.suite.search.starts):
        trial = defaults.copy()
        base = bases[order[start % len(bases)]]
        if size := AgreedScripts(base).scripts(task).size:
            _evolve(trial, base, size, play.suite.search.candidates, start)
        finalists = [trial.attacks[k] for k in np.argsort(trial.skills, kind="stable")[:FINALISTS]]
        skills = mean_or_nan(play.measure("selection", finalists).scores["skill"], axis=0)
        attack = finalists[int(np.argmin(np.where(np.isnan(skills), np.inf, skills)))]
        yield FoundAttack(
            f"search {start + 1}",
            attack,
            attack.describe(task),
            trial.rounds,
            tuple(trial.progress),
        )


class _Trial:
    """Attacks that were tried in the selection worlds.

    Attributes:
        attacks: The attacks.
        skills: Their mean skills.
        rounds: Number of game rounds that were played.
        progress: See `FoundAttack.progress`.
    """

    def __init__(self, play: CellPlay) -> None:
        self.attacks: list[AgreedScripts] = []
        self.skills: list[float] = []
        self.rounds, self.progress = 0, list[tuple[int, float]]()
        self._play = play

    def copy(self) -> "_Trial":
        """Return a trial that goes on from here, apart from this one."""
        trial = _Trial(self._play)
        trial.attacks, trial.skills = list(self.attacks), list(self.skills)
        trial.rounds, trial.progress = self.rounds, list(self.progress)
        return trial

    def play(self, attacks: Sequence[AgreedScripts]) -> Floats:
        """Return the mean skill of each attack."""
        before, games = self._play.steps, self._play.suite.search.games
        scores = self._play.measure("selection", attacks, games).scores["skill"]
        skills: Floats = mean_or_nan(scores, axis=0)
        self.attacks += attacks
        self.skills += skills.tolist()
        self.rounds += self._play.steps - before
        self.progress.append((self.rounds, min(self.skills)))
        return skills


def _evolve(trial: _Trial, base: tuple[str, ...], size: int, candidates: int, start: int) -> None:
    """Change the parameters of an attack by CMA-ES until the budget is spent."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # it warns about missing plots
        import cma  # type: ignore[import-untyped]
    dimensions = max(2, size)  # CMA-ES needs two; a surplus one has no effect
    options = {"bounds": [0, 1], "popsize": _POPULATION, "seed": 1 + start, "verbose": -9}
    strategy: Any = cma.CMAEvolutionStrategy(np.full(dimensions, 0.5), _SPREAD, options)
    for _ in range(max(1, candidates // _POPULATION)):
        generation = strategy.ask()
        points = [_point(point[:size]) for point in generation]
        skills = trial.play([AgreedScripts(base, p) for p in points])
        strategy.tell(generation, np.where(np.isnan(skills), _UNDEFINED, skills).tolist())


def _point(values: Floats) -> tuple[float, ...]:
    """Return a point as its record has it, so that a record plays the same attack."""
    return tuple(round(float(x), DIGITS) for x in values)
