"""Accounts that providers keep of their raters: what each rater thinks of a provider, by the
ratings that arrived.
"""

from typing import Annotated, NamedTuple, Self

from roletrust_env.arrays import Array, cast, largest, namespace
from roletrust_env.shapes import PerGame, Shape

ACCOUNT_FEATURES = (
    "account",
    "known",
    "last",
    "lead",
    "own_lead",
    "deviation",
    "voice",
    "given",
    "ally",
    "place",
)
"""Names of the features of a rater's account, see `account_features`."""

_LEADS = 2.0  # differences of accounts decide; this brings them near the size of other features


class Accounts(NamedTuple):
    """Ratings that providers got from each rater.

    A provider sees the ratings of it that arrive, as the trust model does. So it knows what a rater
    that goes by its own ratings thinks of it, and can treat each rater accordingly.

    Attributes:
        total: Sum of the ratings, shape (S, n, ...) for n providers.
        count: Number of the ratings, shape (S, n, ...).
        last: Last rating, shape (S, n, ...); 0 where there is none.
    """

    total: Annotated[Array, Shape("S n ...")]
    count: Annotated[Array, Shape("S n ...")]
    last: Annotated[Array, Shape("S n ...")]

    @classmethod
    def begin(cls, like: Array) -> Self:
        """Return accounts without ratings.

        Args:
            like: Array of a shape that broadcasts with (S, n, ...), of the array library, dtype and
                device to use.
        """
        return cls(0 * like, 0 * like, 0 * like)

    def hear(
        self,
        ratings: Annotated[Array, Shape("S n ...")],
        rated: Annotated[Array, Shape("S n ...", "bool")],
    ) -> Self:
        """Return the accounts with the ratings of a round.

        Args:
            ratings: Ratings that arrived, shape (S, n, ...); ignored where none did.
            rated: Whether a rating arrived, boolean, shape (S, n, ...).
        """
        where, met = namespace(ratings).where, cast(rated, ratings.dtype)
        return type(self)(
            self.total + met * ratings, self.count + met, where(rated, ratings, self.last)
        )

    def with_prior(self, ratings: float) -> Self:
        """Return the accounts with so many further ratings of 0.5 by each rater."""
        return self._replace(total=self.total + 0.5 * ratings, count=self.count + ratings)

    @property
    def mean(self) -> Array:
        """Mean rating of each rater, shape (S, n, ...); 0 where there is none."""
        return self.total / (self.count + (self.count == 0))


def account_features(
    accounts: Accounts,
    *,
    best_other: PerGame,
    given: Annotated[Array, Shape("S n ...")],
    ally: Array,
    place: Array,
) -> Annotated[Array, Shape("A S n ...")]:
    """Return the features of the account of each rater with each provider, shape (A, S, n, ...), in
    [-1, 1].

    In the order of `ACCOUNT_FEATURES`:

    - `account`: mean rating of the rater for the provider, `last`: its last rating; 0 where there
      is none.
    - `known`: N / (2 + N) for N ratings.
    - `lead`: twice the account less the quality of the best provider of others, cut to [-1, 1].
    - `own_lead`: the account less the rater's best account with any of the n providers.
    - `deviation`: the account less the mean account over the raters.
    - `voice`: number of the rater's ratings as a share of those of the rater who has sent most.
    - `given`: quality of the last service to the rater, as the provider chose it.
    - `ally`: 1 for a rater of the coalition, else 0; `place`: a number in [0, 1] that is different
      for each rater.

    Args:
        accounts: Accounts with the ratings that have arrived, shape (S, n, ...).
        best_other: Quality of the best provider of others, shape (...).
        given: See above, shape (S, n, ...).
        ally: See above, shape (S, 1, ...).
        place: See above, shape (S, 1, ...).
    """
    xp, nothing, count = namespace(accounts.total), 0 * accounts.total, accounts.count
    account = accounts.mean
    most = largest(count)
    rows = (
        account,
        count / (2 + count),
        accounts.last,
        xp.clip(_LEADS * (account - best_other), -1.0, 1.0),
        account - largest(account, axis=1)[:, None, ...],
        account - account.mean(axis=0),
        count / (most + (most == 0)),
        given,
        nothing + ally,
        nothing + place,
    )
    return xp.stack(rows)
