"""Access: which providers serve each rater, and so which providers it can rate."""

from roletrust_env.arrays import Array, namespace
from roletrust_env.world.scenario import Choice


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


def choose(rule: Choice, top: Array, available: Array, noise: Array) -> Array:
    """Return the providers that each rater chooses by their published trust.

    Softmax choice without replacement is the greedy choice of trust / temperature plus Gumbel noise (Kool, van Hoof
    and Welling 2019, "Stochastic Beams and Where to Find Them").

    Args:
        rule: Number of providers to choose, and temperature.
        top: Published ToP, shape (P, ...).
        available: Boolean array of shape (S, P, ...), true where the rater can choose the provider.
        noise: Uniform noise, shape (S, P, ...).

    Returns:
        Boolean array of shape (S, P, ...). In each row, `rule.providers` entries are true, or all available ones if
        there are fewer.
    """
    xp = namespace(noise)
    if rule.temperature > 0:
        preference = top[None, ...] / rule.temperature - xp.log(-xp.log(xp.clip(noise, 1e-12, 1 - 1e-7)))
    else:
        preference = top[None, ...] + 1e-5 * noise  # breaks ties, and near ties, at random
    preference = xp.where(available, preference, -xp.inf)
    rank = xp.argsort(xp.argsort(preference, axis=1), axis=1)
    return available & (rank >= noise.shape[1] - rule.providers)
