"""The cheating ring."""

from dataclasses import field
from typing import Annotated

from roletrust_baselines.agent_indices import AgentIndices
from roletrust_baselines.coalition.ring import Ring
from roletrust_env.parameters import checked_dataclass
from roletrust_env.ranges import Accomplices


@checked_dataclass
class CheatingRing(Ring):
    """Cheating ring: a ring whose providers cheat while they are trusted, and whose raters lift them.

    The raters sink the best of the other providers and are honest about the rest. This joins the slander and the
    self-promotion of Hoffman, Zage and Nita-Rotaru (2009) with the opportunistic service of Chen, Bao and Guo (2016).

    Attributes:
        threshold: Own ToP from which on a provider cheats, in [0, 1].
        bad: Quality of bad service, in [0, 1].
        cut: Rank down to which other providers are sunk, from 0, the best one only, to 1, all of them.
        sink: Share by which their ratings are reduced, in [0, 1].
        by: Value that ranks the providers: `"perceived"` is the rater's mean perception, or published trust before the
            first; `"published"` is published trust.
        accomplices: Indices of the ring's providers among all providers. They are always rated 1 and have no rank.
        start: First round of the attack.
        stop: First round after the attack; None attacks to the end.
    """

    accomplices: Annotated[AgentIndices, Accomplices()] = field(kw_only=True)
