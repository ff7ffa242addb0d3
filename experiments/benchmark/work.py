"""Playing a cell: from its name in a suite to what was measured, the same wherever it is played."""

from time import perf_counter
from typing import Any, NamedTuple

from agents.ladder.rungs import HELD_OUT, Arguments, UnsuitableError, exact_task
from experiments.benchmark.battery import Found, aim, as_lists, scripted, searching, suited
from experiments.benchmark.cells import HONEST, Cell, attacks, place
from experiments.benchmark.play import CHOOSING, measure, measure_honest
from experiments.benchmark.suite import Suite
from experiments.naming import parse_kinds, parse_trust_model
from roletrust_env.game.attack import AttackTask


class Row(NamedTuple):
    """What one attack came to.

    Attributes:
        attack: its name: that of a script, or of the rung that found it.
        words: what it is, in a few words.
        rounds: game rounds that were played to find it.
        chosen: its scores in the games in which the worst case is chosen, by the names of `play.MEASURED`.
        measured: the same in the games in which it is measured.
    """

    attack: str
    words: str
    rounds: int
    chosen: dict[str, list[float | None]]
    measured: dict[str, list[float | None]]


class Done(NamedTuple):
    """What became of a cell.

    Attributes:
        rows: an attack each.
        seconds: that it took, by the clock on the wall.
        unsuitable: why the rung does not apply; empty if it does.
        failed: what went wrong; empty if nothing did.
        env_steps: rounds x games that were played in all.
    """

    rows: tuple[Row, ...]
    seconds: float
    unsuitable: str = ""
    failed: str = ""
    env_steps: int = 0


def play_cell(suite: Suite, cell: Cell) -> Done:
    """Play a cell.

    Args:
        suite: that it is of.
        cell: to be played.

    Raises:
        ValueError: a name of the suite is unknown, or a trust model or an attacker of another package fails.
    """
    began = perf_counter()
    scenario, compromised = place(suite, cell)
    arguments: dict[str, Any] = {
        "scenario": scenario,
        "trust_model": parse_trust_model(cell.model, scenario),
        "compromised": compromised or (_anybody(scenario),),
        "objective": aim(cell.rung, suite.tracks[cell.track].roles),
    }
    task = exact_task(arguments)
    if cell.rung == HONEST:
        scores = as_lists(measure_honest(task, cell.seed, suite.games), 0)
        rows = [Row(HONEST, "everyone honest", 0, scores, scores)]
        return Done(tuple(rows), perf_counter() - began, env_steps=suite.games * scenario.max_cycles)
    rows, steps = [], 0
    try:
        for found, words in _attacks(suite, cell, task, arguments):
            batch = len(found.names), suite.games
            chosen, measured = (measure(task, found.attacker, cell.seed, batch, kind) for kind in (CHOOSING, HELD_OUT))
            for k, name in enumerate(found.names):
                rows.append(Row(name, words[k], found.rounds, as_lists(chosen, k), as_lists(measured, k)))
            steps += found.rounds + 2 * (len(found.names) + 1) * suite.games * scenario.max_cycles
    except UnsuitableError as error:
        return Done((), perf_counter() - began, unsuitable=str(error))
    return Done(tuple(rows), perf_counter() - began, env_steps=steps)


def _attacks(suite: Suite, cell: Cell, task: AttackTask, arguments: Arguments) -> Any:
    """The attacks of a cell, with what they are in words."""
    names = attacks(suite)
    kinds = dict(zip(names, parse_kinds(names, task.game.scenario), strict=True))
    kinds = suited(task, kinds, identities=suite.tracks[cell.track].reserve > 0)
    if cell.rung == "scripted":
        for found in scripted(task, kinds, suite.games):
            yield found, ["at its defaults"] * len(found.names)
        return
    rung = searching(cell.rung, list(kinds.values()))
    attempt = rung.attack(arguments, suite.budget, cell.seed, lambda rounds: None)
    yield Found((cell.rung,), attempt.attacker, attempt.rounds), [attempt.words]


def _anybody(scenario: Any) -> str:
    """Some agent; the attack tasks take one also where it is honest."""
    from roletrust_env.world.roster import Roster

    return Roster.of(scenario).first_names[0]
