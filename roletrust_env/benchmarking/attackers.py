"""Attackers of a cell: scripted attacks with default parameters, and attackers that a search finds with a budget."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import islice
from typing import Any, NamedTuple, TypeVar

import numpy as np

from roletrust_env.benchmarking.known_attacks import KnownAttack
from roletrust_env.evaluation.attack_space import AttackKind
from roletrust_env.evaluation.attackers import Attacker, Scripted, Stackable
from roletrust_env.evaluation.composite import SideBySide, side_by_side
from roletrust_env.evaluation.records import read_record
from roletrust_env.evaluation.scripts import Scripts, with_paper
from roletrust_env.evaluation.search import Progress, SearchMethod, search_methods
from roletrust_env.evaluation.specs import parse_named
from roletrust_env.game.attack_task import AttackTask
from roletrust_env.game.policy import Policy

Item = TypeVar("Item")

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


def playable_kinds(task: AttackTask, kinds: Mapping[str, AttackKind], *, identities: bool) -> dict[str, AttackKind]:
    """Return the kinds of attack that the compromised agents of a task can play.

    Args:
        task: Attack task.
        kinds: Kinds of attack by name.
        identities: Select the attacks that use reserve identities if true, and the others if false.
    """
    playable = {}
    for name, kind in kinds.items():
        try:
            policies = Scripts.of(task, [kind]).default.values()
        except ValueError:  # wrong role, or no ring of agents
            continue
        if any(policy.reserve for policy in policies) == identities:
            playable[name] = kind
    return playable


def scripted_batches(task: AttackTask, kinds: Mapping[str, AttackKind], games: int) -> Iterator[AttackBatch]:
    """Yield all scripted attacks with default parameters in batches.

    If raters and providers are compromised and an attack is for one of these roles, the other role plays the attack of
    the paper: raters bad-mouth, and providers attack on and off.

    Args:
        task: Attack task.
        kinds: Playable kinds of attack by name.
        games: Number of games for each attack.
    """
    attacks = {name: Scripts.of(task, with_paper(task, kind)).default for name, kind in kinds.items()}
    for names in _chunks(attacks, _rows(task, games)):
        yield AttackBatch(names, Scripted(side_by_side([attacks[name] for name in names])), 0, "at its defaults")


def known_batches(task: AttackTask, known: Sequence[KnownAttack], games: int) -> Iterator[AttackBatch]:
    """Yield known attacks in batches: together if they play side by side as they do alone.

    Args:
        task: Attack task.
        known: Known attacks.
        games: Number of games for each attack.

    Raises:
        ValueError: A record is not valid.
    """
    groups: list[list[tuple[KnownAttack, Attacker]]] = []
    for one in known:
        pair = one, read_record(one.record)
        fitting = [group for group in groups if _stack(group[0], pair)]
        if fitting:
            fitting[0].append(pair)
        else:
            groups.append([pair])
    for group in groups:
        for part in _chunks(group, _rows(task, games)):
            names, (first, *others) = tuple(one.name for one, _ in part), [attacker for _, attacker in part]
            together = first.stack(others) if isinstance(first, Stackable) and others else first
            yield AttackBatch(names, together, 0, part[0][0].words)


def _stack(pair: tuple[KnownAttack, Attacker], other: tuple[KnownAttack, Attacker]) -> bool:
    """Return whether two known attacks play in one batch, which has one description."""
    (one, attacker), (another, beside) = pair, other
    return one.words == another.words and isinstance(attacker, Stackable) and attacker.stacks_with(beside)


def _rows(task: AttackTask, games: int) -> int:
    """Return the number of attacks that play side by side."""
    return max(1, _CELLS // (task.game.roster.n_raters * task.game.roster.n_providers * games))


def make_search(method: str, kinds: Sequence[AttackKind] | None = None, known: Sequence[str] = ()) -> SearchMethod:
    """Return the search method of a spec.

    Args:
        method: Registered name or `package.module:Class`, with parameters or without.
        kinds: Kinds of scripted attacks whose parameters are searched, see `Scripts.of`.
        known: Records of known attackers, from which a search may start.

    Raises:
        ValueError: The name is unknown, or the search method cannot be created.
    """
    offered = {"known": tuple(known)} if kinds is None else {"attacks": tuple(kinds), "known": tuple(known)}
    return parse_named(search_methods, method, offered)


def as_lists(scores: dict[str, Any], row: int) -> dict[str, list[float | None]]:
    """Return the scores of the attack in a row as plain data. None is undefined."""
    return {name: [None if np.isnan(x) else float(x) for x in values[row]] for name, values in scores.items()}


def as_curve(by_round: Any, row: int) -> list[float | None]:
    """Return the mean utility by round of the attack in a row, rounded for plots. None is undefined."""
    return [None if np.isnan(x) else round(float(x), 3) for x in by_round[:, row]]


def _chunks(items: Iterable[Item], size: int) -> Iterator[tuple[Item, ...]]:
    iterator = iter(items)
    while chunk := tuple(islice(iterator, size)):
        yield chunk
