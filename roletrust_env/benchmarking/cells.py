"""How a cell is played: its attacks, and their scores in each world.

The result depends only on the suite and the cell, not on the machine or the order.
"""

from collections.abc import Iterator, Mapping, Sequence
from itertools import product
from time import perf_counter

import numpy as np

from roletrust_env.benchmarking.play import CellPlay, Floats
from roletrust_env.benchmarking.schema import AttackResult, CellResult, plain_numbers, reason
from roletrust_env.benchmarking.search import FoundAttack, search
from roletrust_env.benchmarking.suite import Cell, Suite
from roletrust_env.evaluation.agreed import AgreedScripts, with_missing_roles
from roletrust_env.evaluation.attackers import read_record, record_of
from roletrust_env.evaluation.scripts import Scripts
from roletrust_env.evaluation.search import UnsuitableError
from roletrust_env.game.attack_task import AttackTask
from roletrust_env.metrics.score import mean_or_nan


def play_cell(
    suite: Suite,
    cell: Cell,
    *,
    isolated: bool = False,
    records: Mapping[str, str] | None = None,
) -> CellResult:
    """Play a cell.

    Args:
        suite: Suite of the cell.
        cell: Cell to play.
        isolated: Give a trust model of another package a process of its own, see `IsolatedModel`.
        records: Records of attackers by name, which play in place of those that the cell finds.

    Raises:
        ValueError: A name in the suite is unknown, the record is not valid, or a trust model or an
            attacker of a plug-in fails.
    """
    began, play = perf_counter(), CellPlay(suite, cell, isolated=isolated)
    try:
        candidates = (
            list(find_attacks(play))
            if records is None
            else [FoundAttack(name, read_record(text), "") for name, text in records.items()]
        )
    except UnsuitableError as error:
        return CellResult((), perf_counter() - began, unsuitable=str(error))
    rows, failed = _results(play, candidates)
    seconds, errors = perf_counter() - began, "; ".join(failed)
    return CellResult(tuple(rows), seconds, failed=errors, env_steps=play.steps)


def find_attacks(play: CellPlay) -> Iterator[FoundAttack]:
    """Yield the attacks of a cell.

    Raises:
        UnsuitableError: The way to attack does not apply to the cell.
        ValueError: A name is unknown, or a record is not valid.
    """
    suite, cell = play.suite, play.cell
    honest = FoundAttack("honest", AgreedScripts(), "all agents play honestly")
    if cell.method == "honest":
        yield honest
    elif cell.method == "scripts":
        yield honest
        task = play.task("selection", 0)
        for name in playable(suite, cell, task):
            attack = AgreedScripts(with_missing_roles(task, name, suite.usual))
            yield FoundAttack(name, attack, attack.describe(task))
    elif cell.method == "search":
        bases = pairs(suite, cell, play.task("selection", 0))
        if not bases:
            raise UnsuitableError("the suite has no attack for this setting")
        yield from search(play, bases)
    else:
        yield honest
        task = play.task("selection", 0)
        for found in suite.replayed_in(cell.setting):
            attacker = read_record(found.record)
            own = attacker.describe(task) if isinstance(attacker, AgreedScripts) else "replayed"
            words = f"{own}, found by {found.finder}" if found.finder else own
            yield FoundAttack(found.name, attacker, words)


def playable(suite: Suite, cell: Cell, task: AttackTask) -> list[str]:
    """Return the scripted attacks that the compromised agents of a cell can play.

    In a setting with identities in reserve they are those that use them, in any other one those
    that do not.
    """
    identities, names = suite.settings[cell.setting].reserve > 0, []
    for name in suite.attacks:
        try:
            policies = AgreedScripts((name,)).policies(task).values()
        except ValueError:  # wrong role, or no ring of agents
            continue
        if any(policy.reserve for policy in policies) == identities:
            names.append(name)
    return names


def check_attacks(suite: Suite) -> None:
    """Check that each scripted attack of a suite can be played in some setting.

    Raises:
        ValueError: An attack cannot, such as one that was trained for another number of agents.
    """
    tasks = [
        CellPlay(suite, Cell(suite.solo["common"], "common", name, "scripts")).task("selection", 0)
        for name, setting in suite.settings.items()
        if setting.roles
    ]
    for attack in suite.attacks:
        reasons = list[str]()
        for task in tasks:
            try:
                AgreedScripts((attack,)).policies(task)
            except ValueError as error:
                reasons.append(str(error))
        if len(reasons) == len(tasks):
            raise ValueError(
                f"attack {attack} fits no setting of the suite {suite.name}: {reasons[-1]}"
            )


def pairs(suite: Suite, cell: Cell, task: AttackTask) -> list[tuple[str, ...]]:
    """Return the scripted attacks of a cell that cover all compromised roles: alone, or two
    together.
    """
    names = playable(suite, cell, task)
    roles = {name: AgreedScripts((name,)).scripts(task).roles for name in names}
    compromised = Scripts.of(task).roles
    alone: list[tuple[str, ...]] = [(name,) for name in names if roles[name] == compromised]
    both: list[tuple[str, ...]] = [
        (serving, rating)
        for serving, rating in product(names, names)
        if (roles[serving], roles[rating]) == ((True, False), (False, True)) and all(compromised)
    ]
    return alone + both


def _results(
    play: CellPlay, candidates: Sequence[FoundAttack]
) -> tuple[list[AttackResult], list[str]]:
    """Return the results of attacks, and the error messages of those that failed.

    All are tried in the selection worlds. Only the worst one is measured in the other worlds; the
    others have no measured scores.
    """
    skills, failed = _selection_skills(play, candidates)
    rows = [
        AttackResult(
            found.name,
            found.words,
            found.rounds,
            {"skill": plain_numbers(skills[k])},
            {},
            progress=found.progress,
            record=record_of(found.attack),
        )
        for k, found in enumerate(candidates)
        if k in skills
    ]
    means = [mean_or_nan(skills[k], axis=0) for k in skills]
    worst = int(np.argmin(np.where(np.isnan(means), np.inf, means)))
    played = play.measure("measured", [candidates[list(skills)[worst]].attack])
    rows[worst] = rows[worst]._replace(
        measured={name: plain_numbers(values[:, 0]) for name, values in played.scores.items()},
        by_round=[
            None if x is None else round(x, 4) for x in plain_numbers(played.regret_by_round[:, 0])
        ],
    )
    return rows, failed


def _selection_skills(
    play: CellPlay, candidates: Sequence[FoundAttack]
) -> tuple[dict[int, Floats], list[str]]:
    """Return the skill in each selection world by the number of the candidate, and the error
    messages of candidates that failed.

    An attack that fails does not affect the others: each of them is then tried by itself.

    Raises:
        Exception: All attacks fail.
    """
    try:
        skills = play.measure("selection", [found.attack for found in candidates]).scores["skill"]
        return dict(enumerate(skills.T)), []
    except Exception as error:  # plug-in code may raise anything
        if len(candidates) == 1:
            raise
        alone, failed = dict[int, Floats](), list[str]()
        for k, found in enumerate(candidates):
            try:
                alone[k] = play.measure("selection", [found.attack]).scores["skill"][:, 0]
            except Exception as own_error:
                failed.append(f"attack {found.name}: {reason(own_error)}")
        if not alone:
            raise error
        return alone, failed
