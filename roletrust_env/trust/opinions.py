"""The algebra of opinions of subjective logic: belief, disbelief and uncertainty, which sum to 1.

Jøsang, Hayward and Pope, "Trust network analysis with subjective logic" (2006). Written with operators only, so that
the parts of an opinion may be arrays of any shapes that broadcast. This module knows nothing of judges and providers.
"""

from typing import Any, NamedTuple

from roletrust_env.arrays import Array, total


class Opinion(NamedTuple):
    """An opinion, or an array of opinions.

    Attributes:
        belief: Belief b, in [0, 1].
        disbelief: Disbelief d, in [0, 1].
        uncertainty: Uncertainty u, in [0, 1]; above 0 for an opinion from evidence, which is finite.
    """

    belief: Array
    disbelief: Array
    uncertainty: Array

    @classmethod
    def of(cls, successes: Array, failures: Array) -> "Opinion":
        """Return the opinion from evidence, (r, s, 2) / (r + s + 2); without evidence, the vacuous one, (0, 0, 1).

        Example:
            >>> Opinion.of(6.0, 2.0)
            Opinion(belief=0.6, disbelief=0.2, uncertainty=0.2)
        """
        evidence = successes + failures + 2
        return cls(successes / evidence, failures / evidence, 2 / evidence)

    def at(self, index: Any) -> "Opinion":
        """Return some opinions of an array of opinions, by an array index."""
        return Opinion(self.belief[index], self.disbelief[index], self.uncertainty[index])

    def discounted(self, adviser: "Opinion") -> "Opinion":
        """Return this opinion, reported by an adviser, discounted by a judge's opinion of the adviser.

        Example:
            >>> Opinion(0.5, 0.25, 0.25).discounted(adviser=Opinion(0.5, 0.5, 0.0))
            Opinion(belief=0.25, disbelief=0.125, uncertainty=0.625)
        """
        b = adviser.belief
        uncertainty = adviser.disbelief + adviser.uncertainty + b * self.uncertainty
        return Opinion(b * self.belief, b * self.disbelief, uncertainty)

    def fused(self, other: "Opinion") -> "Opinion":
        """Return the opinion from the evidence of both opinions.

        With k = u1 + u2 - u1 u2, b = (b1 u2 + b2 u1) / k, d likewise, and u = u1 u2 / k. For two opinions
        without uncertainty k is 0; the result is then their mean, the limit of equally certain opinions.

        Example:
            >>> Opinion(0.5, 0.0, 0.5).fused(Opinion(0.0, 0.5, 0.5)).belief == 1 / 3
            True
        """
        dogmatic = (self.uncertainty + other.uncertainty) == 0
        mine, its = self.uncertainty + dogmatic, other.uncertainty + dogmatic
        k = mine + its - self.uncertainty * other.uncertainty
        return Opinion(
            (self.belief * its + other.belief * mine) / k,
            (self.disbelief * its + other.disbelief * mine) / k,
            self.uncertainty * other.uncertainty / k,
        )

    def fused_along(self, axis: int) -> "Opinion":
        """Return the fusion of all opinions along an axis, each with an uncertainty above 0.

        This equals fusing them one after the other: b / u and d / u, half the evidence, add up.
        """
        belief = total(self.belief / self.uncertainty, axis)
        disbelief = total(self.disbelief / self.uncertainty, axis)
        uncertainty = 1 / (1 + belief + disbelief)
        return Opinion(belief * uncertainty, disbelief * uncertainty, uncertainty)

    def expectation(self, base_rate: float) -> Array:
        """Return E = b + a u, where the base rate a is the expectation without evidence."""
        return self.belief + base_rate * self.uncertainty
