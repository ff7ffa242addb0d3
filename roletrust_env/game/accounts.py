"""Accounts that providers keep of their raters: what each rater thinks of a provider, by the ratings that arrived."""

from typing import NamedTuple, Self

from roletrust_env.arrays import Array, cast, namespace


class Accounts(NamedTuple):
    """Ratings that providers got from each rater.

    A provider sees the ratings of it that arrive, as the trust model does. So it knows what a rater that goes by its
    own ratings thinks of it, and can treat each rater accordingly.

    Attributes:
        total: Sum of the ratings, shape (S, n, ...) for n providers.
        count: Number of the ratings, shape (S, n, ...).
        last: Last rating, shape (S, n, ...); 0 where there is none.
    """

    total: Array
    count: Array
    last: Array

    @classmethod
    def begin(cls, like: Array) -> Self:
        """Return accounts without ratings.

        Args:
            like: Array of a shape that broadcasts with (S, n, ...), of the array library, dtype and device to use.
        """
        return cls(0 * like, 0 * like, 0 * like)

    def hear(self, ratings: Array, rated: Array) -> Self:
        """Return the accounts with the ratings of a round.

        Args:
            ratings: Ratings that arrived, shape (S, n, ...); ignored where none did.
            rated: Whether a rating arrived, boolean, shape (S, n, ...).
        """
        where, met = namespace(ratings).where, cast(rated, ratings.dtype)
        return type(self)(self.total + met * ratings, self.count + met, where(rated, ratings, self.last))

    def mean(self, unknown: Array | float) -> Array:
        """Return the mean rating of each rater, shape (S, n, ...); `unknown` where there is none."""
        return namespace(self.total).where(self.count > 0, self.total / (self.count + (self.count == 0)), unknown)
