"""The attackers of a cell: every script as it is, and what searches, a learner and the planner find for one budget."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import islice
from typing import Any, NamedTuple

import numpy as np

from roletrust_env.evaluation.attack_space import AttackKind
from roletrust_env.evaluation.attackers import Attacker, Scripted
from roletrust_env.evaluation.composite import SideBySide, side_by_side
from roletrust_env.evaluation.scripts import Scripts, paper_attacks
from roletrust_env.evaluation.search import SearchMethod, search_methods
from roletrust_env.game.attack_task import AttackTask

_CELLS = 200_000
"""Ratings of a round that are computed in one go."""


class AttackBatch(NamedTuple):
    """Some attacks that are measured side by side.

    Attributes:
        names: of the attacks, K.
        attacker: that plays them, the k-th in the k-th row of games.
        rounds: game rounds that were played to find them.
    """

    names: tuple[str, ...]
    attacker: Attacker
    rounds: int

    def apart(self) -> "Iterator[AttackBatch]":
        """Each of several scripted attacks by itself."""
        policies = self.attacker.policies if isinstance(self.attacker, Scripted) else {}
        for k, name in enumerate(self.names):
            alone = {agent: p.policies[k] for agent, p in policies.items() if isinstance(p, SideBySide)}
            yield AttackBatch((name,), Scripted(side_by_side([alone])), self.rounds)


def suited(task: AttackTask, kinds: Mapping[str, AttackKind], *, identities: bool) -> dict[str, AttackKind]:
    """Of some kinds of attack, by name, those that the compromised agents of a task can play.

    Args:
        task: whose agents they are.
        kinds: that there are.
        identities: whether they are to use identities in reserve, or none.
    """
    found = {}
    for name, kind in kinds.items():
        try:
            policies = Scripts.of(task, [kind]).default.values()
        except ValueError:  # for another role, or for a ring that there is not
            continue
        if any(policy.reserve for policy in policies) == identities:
            found[name] = kind
    return found


def scripted(task: AttackTask, kinds: Mapping[str, AttackKind], games: int) -> Iterator[AttackBatch]:
    """Every scripted attack at its defaults, some at a time.

    Where raters and providers are compromised and an attack is for one of these roles, the other one attacks as in the
    paper: by bad-mouthing, or on and off.

    Args:
        task: whose compromised agents attack.
        kinds: of the attacks, by name, all of which are suited.
        games: in which each is measured.
    """
    usual = suited(task, {kind.__name__: kind for kind in paper_attacks()}, identities=False).values()
    attacks = {name: Scripts.of(task, [kind, *usual]).default for name, kind in kinds.items()}
    rows = max(1, _CELLS // (task.game.roster.n_raters * task.game.roster.n_providers * games))
    for names in _some(attacks, rows):
        yield AttackBatch(names, Scripted(side_by_side([attacks[name] for name in names])), 0)


SEARCHING = ("PPO", "recurrent PPO", "SAC", "CMA-ES", "random search", "white-box planner")
"""The rungs that search, learn or plan, by their names in a suite."""


def searching(rung: str, kinds: Sequence[AttackKind] | None = None) -> SearchMethod:
    """A rung that searches, learns or plans.

    Args:
        rung: one of `SEARCHING`.
        kinds: of the scripted attacks that are searched, see `Scripts.of`.
    """
    offered = {} if kinds is None else {"attacks": tuple(kinds)}
    return search_methods.make(rung, **search_methods.taken(rung, offered))


def as_lists(scores: dict[str, Any], row: int) -> dict[str, list[float | None]]:
    """The scores of one attack as plain data; None where they are undefined."""
    return {name: [None if np.isnan(x) else float(x) for x in values[row]] for name, values in scores.items()}


def as_curve(by_round: Any, row: int) -> list[float | None]:
    """The rounds of one attack as plain data, as exact as a picture needs; None where they are undefined."""
    return [None if np.isnan(x) else round(float(x), 3) for x in by_round[:, row]]


def _some(names: Iterable[str], many: int) -> Iterator[tuple[str, ...]]:
    """The names, so many at a time."""
    left = iter(names)
    while found := tuple(islice(left, many)):
        yield found
