"""A search method that is not registered."""

from dataclasses import dataclass
from typing import ClassVar

from roletrust_baselines import OnOff
from roletrust_env.evaluation.attackers import Scripted
from roletrust_env.evaluation.search import SearchResult


@dataclass(frozen=True)
class OnePeriod:
    """Plays an on-off attack of one period."""

    period: int = 2
    name: ClassVar = "one period"

    def search(self, arguments, budget, seed):
        attack = dict.fromkeys(arguments["compromised"], OnOff(period=self.period))
        return SearchResult(Scripted(attack), budget.spent, f"period {self.period}")
