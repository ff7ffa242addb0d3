"""Search over scripted attacks and their parameters in all selection worlds at once.

A start tries random attacks first. Then CMA-ES (Hansen and Ostermeier, 2001; package `cma`) changes
the parameters of the best one. All attacks meet the same games, so that they compare.
"""

import warnings
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from roletrust_env.benchmarking.play import CellPlay
from roletrust_env.evaluation.agreed import DIGITS, AgreedScripts
from roletrust_env.evaluation.attackers import Attacker
from roletrust_env.metrics.score import mean_or_nan

_POPULATION = 12
_DEFAULTS = 0.25
"""Share of the random attacks that have their default parameters."""

_SPREAD = 0.2
"""Standard deviation of the first generation of CMA-ES."""

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


def search(play: CellPlay, bases: Sequence[tuple[str, ...]], start: int) -> FoundAttack:
    """Return the attack that a start of a search finds.

    Args:
        play: Worlds of the cell.
        bases: Specs of scripted attacks that are played together.
        start: Number of the start, which seeds its random numbers. The budget is that of the
            suite.
    """
    random = np.random.default_rng((play.suite.worlds.seed, start))
    trial = _Trial(play)
    task, budget = play.task("selection", 0), play.suite.search.candidates
    sizes = [AgreedScripts(base).scripts(task).size for base in bases]
    drawn = []
    for _ in range(max(1, budget // 2)):
        k = int(random.integers(len(bases)))
        default = not sizes[k] or random.random() < _DEFAULTS
        drawn.append(AgreedScripts(bases[k], None if default else _point(random.random(sizes[k]))))
    trial.play(drawn)
    best = trial.attacks[int(np.argmin(trial.skills))]
    size = sizes[list(bases).index(best.attacks)]
    middle = np.full(size, 0.5) if best.point is None else np.array(best.point)
    if size:
        _evolve(trial, best.attacks, middle, budget, int(random.integers(1, 2**31)))
    finalists = [trial.attacks[k] for k in np.argsort(trial.skills, kind="stable")[:FINALISTS]]
    skills = mean_or_nan(play.measure("selection", finalists).scores["skill"], axis=0)
    attack = finalists[int(np.argmin(skills))]
    return FoundAttack(
        f"search {start + 1}", attack, attack.describe(task), trial.rounds, tuple(trial.progress)
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


def _evolve(trial: _Trial, base: tuple[str, ...], start: Floats, budget: int, seed: int) -> None:
    """Change the parameters of an attack by CMA-ES until the budget is spent."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # it warns about missing plots
        import cma  # type: ignore[import-untyped]
    surplus = max(0, 2 - len(start))  # CMA-ES needs two coordinates; a surplus one has no effect
    options = {"bounds": [0, 1], "popsize": _POPULATION, "seed": seed, "verbose": -9}
    strategy: Any = cma.CMAEvolutionStrategy(
        np.pad(start, (0, surplus), constant_values=0.5), _SPREAD, options
    )
    while budget - len(trial.attacks) >= _POPULATION:
        generation = strategy.ask()
        points = [_point(point[: len(start)]) for point in generation]
        strategy.tell(generation, trial.play([AgreedScripts(base, p) for p in points]).tolist())


def _point(values: Floats) -> tuple[float, ...]:
    """Return a point as its record has it, so that a record plays the same attack."""
    return tuple(round(float(x), DIGITS) for x in values)
