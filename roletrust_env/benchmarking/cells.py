"""How a cell is played: its attacks, scripted, known or found by a search with a budget, and their
scores.

The result depends only on the suite and the cell, not on the machine or the order.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import cache
from itertools import islice
from time import perf_counter
from typing import Any, NamedTuple, TypeVar

from roletrust_env.benchmarking.known_attacks import KnownAttack
from roletrust_env.benchmarking.schema import AttackResult, CellResult, plain_numbers, reason
from roletrust_env.benchmarking.store import StoredCell
from roletrust_env.benchmarking.suite import (
    HONEST,
    PLANNER,
    WITHOUT_SEARCH,
    Cell,
    Suite,
    attacked_scenario,
)
from roletrust_env.benchmarking.worst_case import attack_scores, worst_cases
from roletrust_env.errors import suggest
from roletrust_env.evaluation.attackers import (
    Attacker,
    Scripted,
    SideBySide,
    Stackable,
    read_record,
    record_of,
    side_by_side,
)
from roletrust_env.evaluation.isolated import IsolatedModel
from roletrust_env.evaluation.measurement import (
    GameRecord,
    SplitScores,
    TaskArguments,
    exact_task,
    measure,
    measure_honest,
    score,
    watch,
    watch_honest,
)
from roletrust_env.evaluation.scripts import AttackKind, Scripts, with_paper
from roletrust_env.evaluation.search import (
    Budget,
    Progress,
    SearchMethod,
    UnsuitableError,
    search_methods,
)
from roletrust_env.evaluation.specs import is_own_model, parse_kinds, parse_named, parse_trust_model
from roletrust_env.game.attack_task import AttackTask, Objective
from roletrust_env.game.policy import Policy
from roletrust_env.metrics.consumers import share_of_best
from roletrust_env.trust.model_checks import needs_watching
from roletrust_env.trust.random_order import RandomOrder
from roletrust_env.world.roster import Roster

Item = TypeVar("Item")

_COMMON = 0, 1
"""Seed of the games that all seeds of a suite have in common."""

COMMON_GAMES = 5
"""Number of these games, as a multiple of those of the suite: few games differ by more than starts
do."""

_FURTHER = 2
"""Second part of the seed of further games that measure the worst attacks of a track."""

_CELLS = 200_000
"""Maximum number of ratings that are computed at once in a round."""


class AttackBatch(NamedTuple):
    """Attacks that are measured together.

    Attributes:
        names: Names of the K attacks.
        attacker: Attacker that plays the k-th attack in the k-th row of games.
        rounds: Number of game rounds that were played to find the attacks.
        words: Short description of the attacks.
        record: Record of the attacker if a search found it, see `AttackResult`.
        progress: Course of the search.
    """

    names: tuple[str, ...]
    attacker: Attacker
    rounds: int
    words: str
    record: str = ""
    progress: Progress = ()

    def split(self) -> "Iterator[AttackBatch]":
        """Yield a batch of its own for each attack."""
        for k, name in enumerate(self.names):
            stacked = self.attacker if isinstance(self.attacker, Stackable) else None
            attacker = stacked.row(k) if stacked else Scripted(side_by_side([self.scripts(k)]))
            yield AttackBatch((name,), attacker, self.rounds, self.words)

    def scripts(self, k: int) -> dict[str, Policy]:
        """Return the policies of the k-th scripted attack, by the name of the agent."""
        policies = self.attacker.policies if isinstance(self.attacker, Scripted) else {}
        return {agent: p.policies[k] for agent, p in policies.items() if isinstance(p, SideBySide)}


def cell_kinds(suite: Suite, cell: Cell, task: AttackTask) -> dict[str, AttackKind]:
    """Return the kinds of scripted attacks of a suite that the compromised agents of a cell can
    play, by name.

    In a track with reserve identities they are those that use them, in any other track those that
    do not.
    """
    names, identities = suite.attack_names, suite.tracks[cell.track].reserve > 0
    playable = {}
    for name, kind in zip(names, parse_kinds(names, task.game.scenario), strict=True):
        try:
            policies = Scripts.of(task, [kind]).default.values()
        except ValueError:  # wrong role, or no ring of agents
            continue
        if any(policy.reserve for policy in policies) == identities:
            playable[name] = kind
    return playable


def scripted_batches(
    task: AttackTask, kinds: Mapping[str, AttackKind], games: int
) -> Iterator[AttackBatch]:
    """Yield all scripted attacks with default parameters in batches.

    If raters and providers are compromised and an attack is for one of these roles, the other role
    plays the attack of the paper: raters bad-mouth, and providers attack on and off.
    """
    attacks = {
        name: Scripts.of(task, with_paper(task, kind)).default for name, kind in kinds.items()
    }
    for names in _chunks(attacks, _rows(task, games)):
        yield AttackBatch(
            names, Scripted(side_by_side([attacks[name] for name in names])), 0, "at its defaults"
        )


def known_batches(
    task: AttackTask, known: Sequence[KnownAttack], games: int
) -> Iterator[AttackBatch]:
    """Yield known attacks in batches: together if they play side by side as they do alone.

    Raises:
        ValueError: A record is not valid.
    """
    groups: list[list[tuple[KnownAttack, Attacker]]] = []
    for known_attack in known:
        pair = known_attack, read_record(known_attack.record)
        fitting = [group for group in groups if _stack(group[0], pair)]
        if fitting:
            fitting[0].append(pair)
        else:
            groups.append([pair])
    for group in groups:
        for part in _chunks(group, _rows(task, games)):
            names, (first, *others) = (
                tuple(known_attack.name for known_attack, _ in part),
                [attacker for _, attacker in part],
            )
            together = first.stack(others) if isinstance(first, Stackable) and others else first
            yield AttackBatch(names, together, 0, part[0][0].words)


def _stack(pair: tuple[KnownAttack, Attacker], other: tuple[KnownAttack, Attacker]) -> bool:
    """Return whether two known attacks play in one batch, which has one description."""
    (first, attacker), (another, beside) = pair, other
    return (
        first.words == another.words
        and isinstance(attacker, Stackable)
        and attacker.stacks_with(beside)
    )


def _rows(task: AttackTask, games: int) -> int:
    """Return the number of attacks that play side by side."""
    return max(1, _CELLS // (task.game.roster.n_raters * task.game.roster.n_providers * games))


def make_search(
    method: str, kinds: Sequence[AttackKind] | None = None, known: Sequence[str] = ()
) -> SearchMethod:
    """Return the search method of a spec.

    Args:
        method: Registered name or `package.module:Class`, with parameters or without.
        kinds: Kinds of scripted attacks whose parameters are searched, see `Scripts.of`.
        known: Records of known attackers, from which a search may start.

    Raises:
        ValueError: The name is unknown, or the search method cannot be created.
    """
    offered = (
        {"known": tuple(known)}
        if kinds is None
        else {"attacks": tuple(kinds), "known": tuple(known)}
    )
    return parse_named(search_methods, method, offered)


def _chunks(items: Iterable[Item], size: int) -> Iterator[tuple[Item, ...]]:
    iterator = iter(items)
    while chunk := tuple(islice(iterator, size)):
        yield chunk


def task_arguments(suite: Suite, cell: Cell, *, isolated: bool = False) -> TaskArguments:
    """Return the arguments of the attack task of a cell.

    Args:
        suite: Suite of the cell.
        cell: The cell.
        isolated: Give a trust model of another package a process of its own.

    Raises:
        ValueError: The track does not fit the scenario, see `attacked_scenario`, or the trust model
            cannot be created.
    """
    scenario, compromised = attacked_scenario(suite, cell)
    make: Any = IsolatedModel if isolated and not is_own_model(cell.model) else parse_trust_model
    model = make(cell.model, scenario)
    if suite.places == "random" and needs_watching(model):
        model = RandomOrder(model, cell.seed)
    return {
        "scenario": scenario,
        "trust_model": model,
        # An attack task needs an agent even if all are honest. This agent then acts honestly.
        "compromised": compromised or Roster.of(scenario).owner_names[:1],
        "objective": objective(cell.method, suite.tracks[cell.track].roles),
        "consumers": suite.consumers,
    }


def objective(method: str, roles: Sequence[str]) -> Objective:
    """Return the objective of a method on a track.

    It is `mislead`, except for the planner, which needs a gradient: the choice of the most trusted
    provider has none. The planner uses `exploit` if only providers are compromised, and `damage`
    otherwise.

    Args:
        method: Name of the method.
        roles: Roles of the compromised agents.
    """
    if method.partition(":")[0] != PLANNER:
        return "mislead"
    return "exploit" if tuple(roles) == ("SP",) else "damage"


def play_cell(suite: Suite, cell: Cell, record: str = "", *, isolated: bool = False) -> CellResult:
    """Play a cell.

    Args:
        suite: Suite of the cell.
        cell: Cell to play.
        record: Record of the attacker that plays in place of a search, see `AttackResult`. Empty
            searches.
        isolated: Give a trust model of another package a process of its own, see `IsolatedModel`.

    Raises:
        ValueError: A name in the suite is unknown, the record is not valid, a trust model or an
            attacker of a plug-in fails, or an isolated model lets trust in a game depend on other
            games.
    """
    arguments = task_arguments(suite, cell, isolated=isolated)
    result = _play_cell(suite, cell, record, arguments)
    model = arguments["trust_model"]
    inside = model.model if isinstance(model, RandomOrder) else model
    if isinstance(inside, IsolatedModel):
        inside.check_alone()
    return result


def _play_cell(suite: Suite, cell: Cell, record: str, arguments: TaskArguments) -> CellResult:
    began = perf_counter()
    task, games = exact_task(arguments), 2 * suite.games
    steps = games * task.game.scenario.max_cycles
    if cell.method == HONEST:
        nobody = AttackBatch((HONEST,), Scripted({}), 0, "everyone honest")
        row = _row(nobody, 0, measure_honest(task, cell.seed, games // 2))
        return CellResult((row,), perf_counter() - began, env_steps=steps)
    rows: list[AttackResult] = []
    failed: list[str] = []
    singles: dict[str, AttackBatch] = {}
    twin = cache(
        lambda: watch_honest(task, cell.seed, games)
    )  # the same for all attacks of the cell
    try:
        for batch in _attacks(suite, cell, task, arguments, record):
            try:
                good, errors = _measure_batch(suite, cell, task, batch, twin)
            except ValueError as error:
                if cell.method != "known":
                    raise
                good, errors = [], [f"attack {', '.join(batch.names)}: {reason(error)}"]
            rows, failed = rows + good, failed + errors
            singles |= {
                batch_part.names[0]: batch_part
                for batch_part in (batch.split() if batch.names[1:] else [batch])
            }
            steps += batch.rounds + len(batch.names) * games * task.game.scenario.max_cycles
            if batch.progress and suite.seeds[1:]:
                rows = [
                    row._replace(
                        common=_in_common(task, batch.attacker, COMMON_GAMES * suite.games)
                    )
                    for row in rows
                ]
                steps += COMMON_GAMES * suite.games * task.game.scenario.max_cycles
        if more := suite.tracks[cell.track].games:
            again = _measure_worst(suite, cell, task, rows, singles)
            rows = [again.get(row.attack, row) for row in rows]
            steps += (len(again) + 1) * more * task.game.scenario.max_cycles
    except UnsuitableError as error:
        return CellResult((), perf_counter() - began, unsuitable=str(error))
    return CellResult(
        tuple(rows), perf_counter() - began, failed="; ".join(failed), env_steps=steps
    )


class FoundAttack(NamedTuple):
    """An attack of a cell, ready to play.

    Attributes:
        task: Task of the cell.
        batch: Attacks that play side by side. They share their random numbers, so one of them alone
            would play other games.
        row: Row of the attack among them.
    """

    task: AttackTask
    batch: AttackBatch
    row: int

    @property
    def rows(self) -> int:
        """Number of attacks that play side by side."""
        return len(self.batch.names)


def find_attack(suite: Suite, cell: Cell, attack: str, record: str = "") -> FoundAttack:
    """Return an attack of a cell. Without a record a search runs again, with the same seed and
    budget.

    Args:
        suite: Suite of the cell.
        cell: The cell.
        attack: Name of the attack in the results of the cell.
        record: Record of the attacker in these results.

    Raises:
        ValueError: The cell has no such attack, or see `play_cell`.
    """
    if cell.method == HONEST:
        raise ValueError(f"cell {cell.key} has no attack: everybody is honest there")
    arguments = task_arguments(suite, cell)
    task = exact_task(arguments)
    known: list[str] = []
    for batch in _attacks(suite, cell, task, arguments, record):
        if attack in batch.names:
            return FoundAttack(task, batch, batch.names.index(attack))
        known += batch.names
    raise ValueError(f"cell {cell.key} has no attack {attack!r}{suggest(attack, known)}")


def _attacks(
    suite: Suite, cell: Cell, task: AttackTask, arguments: TaskArguments, record: str
) -> Iterator[AttackBatch]:
    """Yield the attacks of a cell in batches."""
    if record and cell.method not in WITHOUT_SEARCH:
        yield AttackBatch((cell.method,), read_record(record), 0, "as recorded", record)
        return
    kinds = cell_kinds(suite, cell, task)
    if cell.method == "scripted":
        yield from scripted_batches(task, kinds, 2 * suite.games)
        return
    known = suite.known_in(cell[1:4])
    if cell.method == "known":
        if not known:
            raise UnsuitableError("there is no known attack for this condition")
        yield from known_batches(task, known, 2 * suite.games)
        return
    method = make_search(
        cell.method, list(kinds.values()), [known_attack.record for known_attack in known]
    )
    search = method.search(arguments, Budget(suite.budget_of(cell)), cell.seed)
    found_record = record_of(search.attacker)
    yield AttackBatch(
        (cell.method,),
        search.attacker,
        search.rounds,
        search.description,
        found_record,
        search.progress,
    )


def _measure_batch(
    suite: Suite, cell: Cell, task: AttackTask, batch: AttackBatch, twin: Callable[[], GameRecord]
) -> tuple[list[AttackResult], list[str]]:
    """Return the results of a batch of attacks, and the error messages of the attacks that failed.

    An attack that fails does not affect the others: each attack of a failed batch is measured by
    itself.

    Raises:
        Exception: All attacks fail.
    """
    rows, failed = [], []
    try:
        scores = measure(task, batch.attacker, cell.seed, (len(batch.names), suite.games), twin())
        rows = [_row(batch, k, scores) for k in range(len(batch.names))]
    except Exception as error:  # plug-in code may raise anything
        for single in batch.split() if batch.names[1:] else ():
            try:
                rows += _measure_batch(suite, cell, task, single, twin)[0]
            except Exception as own_error:
                failed.append(f"attack {single.names[0]}: {reason(own_error)}")
        if not rows:
            raise error
    return rows, failed


def _measure_worst(
    suite: Suite,
    cell: Cell,
    task: AttackTask,
    rows: Sequence[AttackResult],
    attacks: Mapping[str, AttackBatch],
) -> dict[str, AttackResult]:
    """Measure the worst attack of a cell, and the worst that serves all raters alike, in further
    games of the track.

    Returns:
        The results that replace those of these attacks, by name.
    """
    games, seed = suite.tracks[cell.track].games or suite.games, (cell.seed, _FURTHER)
    scores = attack_scores(suite, [StoredCell(cell, CellResult(tuple(rows), 0.0))])
    own = [attack for attack in scores if (attack.attack, cell[1:4]) not in suite.entered]
    counted = (
        scores,
        [attack for attack in scores if not attack.treats],
        own,
    )  # each has a column in the leaderboard
    names = {case.attack for part in counted for case in worst_cases(part, white_box=True).values()}
    twin = watch_honest(task, seed, games)
    results = {}
    for row in rows:
        if row.attack in names:
            scored = score(task, attacks[row.attack].attacker, seed, (1, games), twin).scores
            results[row.attack] = row._replace(
                measured={name: plain_numbers(values[0]) for name, values in scored.items()}
            )
    return results


def _row(batch: AttackBatch, k: int, scores: SplitScores) -> AttackResult:
    """Return the scores of the k-th attack of a batch as plain data, with curves rounded for
    plots.
    """
    chosen, measured = (
        {name: plain_numbers(values[k]) for name, values in half.items()} for half in scores[:2]
    )
    curve = [None if x is None else round(x, 3) for x in plain_numbers(scores.by_round[:, k])]
    identity = batch.names[k], batch.words, batch.rounds
    return AttackResult(
        *identity, chosen, measured, curve, batch.record, batch.progress, bool(scores.treats[k])
    )


def _in_common(task: AttackTask, attacker: Attacker, games: int) -> tuple[list[float | None], ...]:
    """Return the scores of a single attack in games that all seeds have in common, see
    `AttackResult.common`.
    """
    got, best, blind = watch(task, attacker, _COMMON, (1, games)).bought
    return tuple(
        plain_numbers(share_of_best(part[:, 0], best[:, 0]).value) for part in (got, blind)
    )
