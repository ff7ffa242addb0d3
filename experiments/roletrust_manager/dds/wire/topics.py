"""Names of the topics and of their owners."""

TRUST = "/trust"
DIAGNOSTICS = "/diagnostics"

IMAGES = "/image_raw/compressed"
RATINGS = "/ratings"
"""Endings behind the name of a camera and of a rater: `/sp_0/image_raw/compressed`,
`/sr_0/ratings`."""


def owner(topic: str, ending: str) -> str | None:
    """Return the name of the agent that a topic belongs to; None if the topic has another ending or
    no owner.

    Example:
        >>> owner("/sr_0/ratings", RATINGS), owner("/sr_0/tor", RATINGS), owner("/ratings", RATINGS)
        ('sr_0', None, None)
    """
    name = topic.removesuffix(ending).removeprefix("/")
    return name if topic == f"/{name}{ending}" and name and "/" not in name else None
