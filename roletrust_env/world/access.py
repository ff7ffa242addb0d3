"""Who is served by whom, and so who can rate whom."""

from roletrust_env.arrays import Array, namespace
from roletrust_env.world.scenario import Choice


def in_range(raters: Array, providers: Array, radius: float) -> Array:
    """Whether each rater is near each provider.

    Args:
        raters: positions, shape (S, 2, ...).
        providers: positions, shape (P, 2, ...).
        radius: the distance up to which a service reaches.

    Returns:
        Boolean, shape (S, P, ...).
    """
    return ((raters[:, None, ...] - providers[None, ...]) ** 2).sum(axis=2) <= radius**2


def choose(rule: Choice, top: Array, available: Array, luck: Array) -> Array:
    """The providers that each rater chooses by their published trust.

    Softmax choice without replacement is the greedy choice of trust / temperature plus Gumbel noise (Kool, van Hoof
    and Welling 2019, "Stochastic Beams and Where to Find Them").

    Args:
        rule: how many, and how greedily.
        top: published ToP, shape (P, ...).
        available: boolean, shape (S, P, ...): whom the rater may choose.
        luck: uniform noise, shape (S, P, ...).

    Returns:
        Boolean, shape (S, P, ...): at most `rule.providers` true for each rater, fewer where fewer are available.
    """
    xp = namespace(luck)
    if rule.temperature > 0:
        score = top[None, ...] / rule.temperature - xp.log(-xp.log(xp.clip(luck, 1e-12, 1 - 1e-7)))
    else:
        score = top[None, ...] + 1e-5 * luck  # breaks ties, and near ties, at random
    score = xp.where(available, score, -xp.inf)
    rank = xp.argsort(xp.argsort(score, axis=1), axis=1)
    return available & (rank >= luck.shape[1] - rule.providers)
