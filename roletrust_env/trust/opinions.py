"""The algebra of opinions of subjective logic: belief, disbelief and uncertainty, which sum to 1.

Jøsang, Hayward and Pope, "Trust network analysis with subjective logic" (2006). Written with operators only, so that
the parts of an opinion may be arrays of any shape that fit one another; nothing here knows of judges and providers.
"""

from typing import Any, NamedTuple

from roletrust_env.arrays import Array, total


class Opinion(NamedTuple):
    """An opinion, or an array of opinions.

    Attributes:
        belief: b, in [0, 1].
        disbelief: d, in [0, 1].
        uncertainty: u, in [0, 1]; above 0 for an opinion from evidence, of which there is never infinitely much.
    """

    belief: Array
    disbelief: Array
    uncertainty: Array

    @classmethod
    def of(cls, successes: Array, failures: Array) -> "Opinion":
        """From evidence, (r, s, 2) / (r + s + 2); none makes the vacuous opinion (0, 0, 1).

        Example:
            >>> Opinion.of(6.0, 2.0)
            Opinion(belief=0.6, disbelief=0.2, uncertainty=0.2)
        """
        evidence = successes + failures + 2
        return cls(successes / evidence, failures / evidence, 2 / evidence)

    def at(self, index: Any) -> "Opinion":
        """Some of the opinions of an array, by an index as an array takes it."""
        return Opinion(self.belief[index], self.disbelief[index], self.uncertainty[index])

    def discounted(self, adviser: "Opinion") -> "Opinion":
        """This opinion as it counts for a judge whose opinion of the adviser that told it is given.

        Example:
            >>> Opinion(0.5, 0.25, 0.25).discounted(adviser=Opinion(0.5, 0.5, 0.0))
            Opinion(belief=0.25, disbelief=0.125, uncertainty=0.625)
        """
        b = adviser.belief
        uncertainty = adviser.disbelief + adviser.uncertainty + b * self.uncertainty
        return Opinion(b * self.belief, b * self.disbelief, uncertainty)

    def fused(self, other: "Opinion") -> "Opinion":
        """Both opinions in one, as if their evidence were put together.

        With k = u1 + u2 - u1 u2, b = (b1 u2 + b2 u1) / k, d likewise, and u = u1 u2 / k. Two opinions without
        uncertainty, whose k is 0, leave no room for a third: their mean is taken, the limit of equally certain ones.

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
        """All the opinions along an axis in one, each with an uncertainty above 0.

        The same as fusing one after the other: b / u and d / u, which are half the evidence, add up.
        """
        belief = total(self.belief / self.uncertainty, axis)
        disbelief = total(self.disbelief / self.uncertainty, axis)
        uncertainty = 1 / (1 + belief + disbelief)
        return Opinion(belief * uncertainty, disbelief * uncertainty, uncertainty)

    def expectation(self, base_rate: float) -> Array:
        """E = b + a u, where the base rate a says what to expect when nothing is known."""
        return self.belief + base_rate * self.uncertainty
