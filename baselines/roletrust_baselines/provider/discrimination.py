"""Discrimination against a few raters."""

from typing import Annotated, Any, ClassVar

from roletrust_baselines.provider.conflicting import treatment
from roletrust_env.arrays import Array
from roletrust_env.game.policy import Channel
from roletrust_env.game.schedule import WindowedAttack
from roletrust_env.game.views import ProviderView
from roletrust_env.parameters import checked_dataclass
from roletrust_env.randomness import Random
from roletrust_env.ranges import GridValues, SearchRange, Share


@checked_dataclass
class Discrimination(WindowedAttack):
    """Discrimination: a provider that serves a few raters badly, so few that their ratings pass for lies or outliers.

    Dellarocas (2000), "Immunizing Online Reputation Reporting Systems against Unfair Ratings and Discriminatory
    Behavior", describes sellers that serve a few buyers differently. The number is not specified there. Half of the
    raters, as under `conflicting`, can outvote the others; a few are what a filter of ratings drops.

    Attributes:
        share: Share of the raters that it serves badly, in [0, 1], rounded, at least one: the first ones.
        bad: Quality for these raters as a share of the quality for the others, in [0, 1].
        start: First round of the attack.
        stop: First round after the attack; None attacks to the end.
    """

    share: Annotated[Share, SearchRange(0.05, 0.5)] = 0.3
    bad: Annotated[Share, GridValues(0.0, 0.5)] = 0.0
    attacks: ClassVar[frozenset[Channel]] = frozenset({"treatment"})

    def treats(self, view: ProviderView, memory: Any, random: Random) -> tuple[Array | None, Any]:
        """Return the share of quality for each rater: bad for a few while active. See `Policy.treats`."""
        few = max(1, round(self.share * len(view.ratings)))
        return treatment(view, tuple(range(few)), self.bad, self.active(view.round)), memory
