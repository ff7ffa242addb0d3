"""What policies and attacks are called."""

import re
from collections import Counter
from collections.abc import Mapping

from roletrust_env import Policy


def policy_name(policy: Policy) -> str:
    """What to call a policy.

    Example:
        >>> import baselines
        >>> policy_name(baselines.BadMouthing()), policy_name(Policy())
        ('bad-mouthing', 'honest')
    """
    if type(policy) is Policy:
        return "honest"
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "-", type(policy).__name__).lower()


def attacks_in_words(attackers: Mapping[str, Policy]) -> str:
    """The attacks and how many agents play each, such as `bad-mouthing x3, on-off`."""
    counts = Counter(policy_name(policy) for policy in attackers.values())
    return ", ".join(f"{name} x{n}" if n > 1 else name for name, n in counts.items()) or "everyone honest"
