"""ToA of agents with both roles."""

from typing import NamedTuple

import numpy as np

from roletrust_baselines import BadMouthing, OnOff
from roletrust_env import Game, JointPolicy, Policy, Scenario, make_scenario, metrics, record
from roletrust_env.evaluation.attackers import Both
from roletrust_env.metrics.confidence import Estimate, Floats, estimate
from roletrust_env.metrics.score import mean_or_nan
from roletrust_experiments.plots.charts import Panel
from studies.questions.answers import SETTLED, Effort, Finding, in_words, lines, verdict

QUESTION = "What does ToA do for agents that are raters and providers?"
_PEERS, _ATTACKERS = 9, 3
_ROLES = {"liars": "ToR", "cheats": "ToP", "seldom": "ToR"}
_SELDOM = ("SP", "SP", "SP", "SR")
"""Roles, in turn, of an attacker that rates in one round of four."""


class Case(NamedTuple):
    """A kind of attackers.

    Attributes:
        words: Description of the attack.
        policy: Policy of each attacker.
        turns: Roles that they play in turn; empty if they play both in every round.
    """

    words: str
    policy: Policy
    turns: tuple[str, ...] = ()


_CASES = {
    "liars": Case("lie, serve well", BadMouthing()),
    "cheats": Case("rate truly, serve badly", OnOff()),
    "both": Case("lie, serve badly", Both(OnOff(), BadMouthing())),
    "seldom": Case("lie in 1 round of 4, serve well in 3", BadMouthing(), _SELDOM),
}


def answer(effort: Effort) -> Finding:
    """Play peers, a third of which attack in one role, in the other role, or in both."""
    measures = {
        (what, trust, case.words): values
        for case in _CASES.values()
        for (what, trust), values in _play(effort, case).items()
    }
    differences = {
        f"{name}, {what}": estimate(
            measures[what, "ToA", _CASES[name].words] - measures[what, trust, _CASES[name].words]
        )
        for name, trust in _ROLES.items()
        for what in ("gap", "auc")
    }
    words = [case.words for case in _CASES.values()]
    panels = [
        Panel(title, "", what, lines(measures, field, ("ToR", "ToP", "ToA"), words))
        for field, title, what in (
            ("gap", "how far attackers stand apart", "trust of the honest less that of attackers"),
            ("auc", "how well they are told apart", "AUC: 0.5 as by chance, 1 surely"),
        )
    ]
    return Finding(QUESTION, sentence(differences), panels, effort.games)


def sentence(differences: dict[str, Estimate]) -> str:
    """Return the answer from the separation by ToA minus the separation by the trust in the
    attacked role.
    """
    gaps = {name: differences[f"{name}, gap"] for name in _ROLES}
    hides = verdict(gap._replace(mean=-gap.mean) for gap in gaps.values())

    def part(name: str) -> str:
        auc = in_words(differences[f"{name}, auc"], "higher", "lower", "not shown to differ")
        return f"{in_words(gaps[name])} in ToA than in {_ROLES[name]} (AUC {auc})"

    return (
        f"It averages the roles; does that hide who attacks in one only? {hides}: agents that lie "
        "and serve well stand "
        f"apart by {part('liars')}, those that rate truly and serve badly by {part('cheats')}, and "
        "those that lie in "
        f"one round of four and serve well in three by {part('seldom')}."
    )


def _play(effort: Effort, case: Case) -> dict[tuple[str, str], Floats]:
    """Play games in which the last peers attack, and compare trust once it has settled.

    Returns:
        By kind of trust, (G,) each: `gap`, the mean trust of the honest agents minus that of the
        attackers, and `auc`, the probability that trust ranks them correctly, see `metrics.auc`.
    """
    game = Game(_peers(effort, case.turns), "role-trust")
    attackers = {f"srsp_{place}": case.policy for place in range(_PEERS - _ATTACKERS, _PEERS)}
    history = record(JointPolicy(game, attackers), game.random(effort.seed), (effort.games,))
    bad, measures = slice(_PEERS - _ATTACKERS, _PEERS), {}
    for name, trusts in {"ToR": history.tor, "ToP": history.top, "ToA": history.trust}.items():
        trust = mean_or_nan(np.asarray(trusts)[SETTLED:], axis=0)
        measures["gap", name] = np.delete(trust, bad, axis=0).mean(axis=0) - trust[bad].mean(axis=0)
        measures["auc", name] = metrics.auc(trust, range(_PEERS)[bad]).value
    return measures


def _peers(effort: Effort, turns: tuple[str, ...]) -> Scenario:
    """Return a scenario of peers with different abilities and both roles; the last ones may take
    turns.
    """
    peer = {"role": "SR+SP", "noise": 0.05, "ability": (0.3, 1.0)}
    agents = [{**peer, "count": _PEERS - _ATTACKERS}, {**peer, "count": _ATTACKERS, "turns": turns}]
    return make_scenario("peers").change(agents=agents, max_cycles=effort.rounds(100))
