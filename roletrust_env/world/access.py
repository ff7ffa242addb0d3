"""Access: which providers serve each rater, and so which providers it can rate."""

from roletrust_env.arrays import Array, namespace
from roletrust_env.world.scenario import Choice, Encounters


def in_range(raters: Array, providers: Array, radius: float) -> Array:
    """Return whether each rater is within reach of each provider.

    Args:
        raters: Positions of the raters, shape (S, 2, ...).
        providers: Positions of the providers, shape (P, 2, ...).
        radius: Distance up to which a service reaches.

    Returns:
        Boolean array of shape (S, P, ...).
    """
    return ((raters[:, None, ...] - providers[None, ...]) ** 2).sum(axis=2) <= radius**2


def choose_providers(
    rule: Choice, trust: Array, available: Array, noise: Array, explore: Array | None = None
) -> Array:
    """Return the providers that each rater chooses by trust, or at random where it explores.

    Softmax choice without replacement is the greedy choice of trust / temperature plus Gumbel noise
    (Kool, van Hoof and Welling 2019, "Stochastic Beams and Where to Find Them").

    Args:
        rule: Number of providers to choose, and temperature.
        trust: Trust of each rater in each provider, shape (S, P, ...), or (1, P, ...) if it is that
            of all.
        available: Boolean array of shape (S, P, ...), true where the rater can choose the provider.
        noise: Uniform noise, shape (S, P, ...).
        explore: Uniform noise, shape (S, ...); None if nobody explores.

    Returns:
        Boolean array of shape (S, P, ...). In each row, `rule.providers` entries are true, or all
        available ones if there are fewer.
    """
    xp = namespace(noise)
    if rule.temperature > 0:
        preference = trust / rule.temperature - xp.log(-xp.log(xp.clip(noise, 1e-12, 1 - 1e-7)))
    else:
        preference = trust + 1e-5 * noise  # breaks ties, and near ties, at random
    if explore is not None:
        preference = xp.where((explore < rule.explore)[:, None, ...], noise, preference)
    return highest(preference, available, rule.providers)


def highest(preference: Array, available: Array, number: int) -> Array:
    """Return the available entries with the highest preference in each row.

    Args:
        preference: Preference of each rater for each provider, shape (S, P, ...).
        available: Boolean array of shape (S, P, ...), true where the entry can be chosen.
        number: Number of entries of each row.

    Returns:
        Boolean array of shape (S, P, ...). In each row, `number` entries are true, or all available
        ones if there are fewer.
    """
    xp = namespace(preference)
    preference = xp.where(available, preference, -xp.inf)
    rank = xp.argsort(xp.argsort(preference, axis=1), axis=1)
    return available & (rank >= preference.shape[1] - number)


def meet(rule: Encounters, own: Array, n_providers: int, noise: Array) -> Array:
    """Return the providers that each rater meets, all different and none of them itself.

    Every set of providers is equally likely: Floyd's algorithm (Bentley and Floyd 1987, "A Sample
    of Brilliance").

    Args:
        rule: Number k of providers to meet.
        own: Index of the provider that is the same agent as the rater, whole, shape (S, ...); P
            where there is none.
        n_providers: Number of providers P.
        noise: Uniform noise, shape (S, k, ...).

    Returns:
        Indices of providers, whole, shape (S, k, ...).
    """
    xp = namespace(noise)
    others = n_providers - xp.astype(own < n_providers, xp.int64)
    met: list[Array] = []
    for n in range(rule.providers):
        last = others - rule.providers + n
        drawn = xp.minimum(xp.astype(noise[:, n, ...] * (last + 1), xp.int64), last)
        repeated = drawn < 0
        for earlier in met:
            repeated = repeated | (drawn == earlier)
        met.append(xp.where(repeated, last, drawn))
    places = xp.stack(met, axis=1)
    return places + xp.astype(places >= own[:, None, ...], xp.int64)
