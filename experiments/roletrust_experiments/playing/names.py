"""Names of attacks."""

from collections import Counter
from collections.abc import Mapping

from roletrust_env import Policy
from roletrust_env.game.policy import policy_name


def attacks_in_words(attackers: Mapping[str, Policy]) -> str:
    """Return the attacks and the number of agents that play each, such as `bad-mouthing x3, on-off`."""
    counts = Counter(policy_name(policy) for policy in attackers.values())
    return ", ".join(f"{name} x{n}" if n > 1 else name for name, n in counts.items()) or "everyone honest"
