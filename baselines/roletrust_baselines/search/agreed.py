"""Search over scripted attacks that all agents of a role play alike."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from roletrust_baselines.search.searchers import Attacks, cma_es
from roletrust_baselines.search.trial import GENERATION, Attack, Scores, Trial
from roletrust_env.evaluation.attack_space import AttackKind
from roletrust_env.evaluation.attacked_games import TaskArguments
from roletrust_env.evaluation.scripts import Scripts, paper_attacks, with_paper
from roletrust_env.evaluation.search import Budget, SearchResult
from roletrust_env.game.attack_task import AttackTask
from roletrust_env.parameters import refuse_unknown

Group = tuple[AttackKind, ...]
"""Kinds of attack that are played together, one for each role."""

_LEADERS = 3  # groups that are searched


@refuse_unknown
@dataclass(frozen=True)
class AgreedCmaEs:
    """Search over scripted attacks that all agents of a role play alike.

    Every kind is tried at its defaults, while a role that it leaves out plays the attack of the paper. CMA-ES then
    searches the parameters of the three best kinds in turn. If both roles attack, the best kind of each also form a
    pair, which is searched, too.

    Attributes:
        spread: Standard deviation of the first generation of CMA-ES.
        name: Name in tables.
        attacks: Kinds of attack, see `Scripts.of`.
    """

    spread: float = 0.3
    name: str = "agreed CMA-ES"
    attacks: Attacks = None

    def search(self, arguments: TaskArguments, budget: Budget, seed: int) -> SearchResult:
        """See `roletrust_env.evaluation.search.SearchMethod`."""
        trial, random = Trial(arguments, budget, seed), np.random.default_rng(seed)
        kinds = self.attacks or _paper(trial.task)
        groups = [with_paper(trial.task, kind) for kind in kinds[: trial.left]]
        attacks: list[Attack] = [_alike(trial.task, group).default for group in groups]
        scores: list[Scores] = [trial.scores(attacks)]
        leaders = _leaders(trial.task, [groups[k] for k in np.argsort(-scores[0], kind="stable")])
        for k, group in enumerate(leaders):
            scripts, tries = _alike(trial.task, group), trial.left // (len(leaders) - k)
            if scripts.size and tries >= GENERATION:
                found = cma_es(trial, scripts, tries, self.spread, random)
                attacks, scores = attacks + found[0], [*scores, found[1]]
        return trial.best(attacks, np.concatenate(scores))


def _alike(task: AttackTask, kinds: Sequence[AttackKind]) -> Scripts:
    return Scripts.of(task, kinds, alike=True)


def _paper(task: AttackTask) -> Group:
    """Return the attacks of the paper that compromised agents can play."""
    return tuple(kind for kind, plays in zip(paper_attacks(), Scripts.of(task).roles, strict=True) if plays)


def _leaders(task: AttackTask, groups: Sequence[Group]) -> list[Group]:
    """Return the groups to search, from all groups in the order of their scores."""
    leaders = list(groups[:_LEADERS])
    roles = [Scripts.of(task, group[:1]).roles for group in groups]
    if (True, False) in roles and (False, True) in roles:
        pair = (groups[roles.index((True, False))][0], groups[roles.index((False, True))][0])
        leaders.append(pair)
    return leaders
