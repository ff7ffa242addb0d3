"""What the topics are called, and whose they are."""

TRUST = "/trust"
DIAGNOSTICS = "/diagnostics"

IMAGES = "/image_raw/compressed"
RATINGS = "/ratings"
"""Behind the name of a camera, and of a rater: `/sp_0/image_raw/compressed`, `/sr_0/ratings`."""


def owner(topic: str, ending: str) -> str | None:
    """Whose a topic is; None if it has not this ending, or is nobody's.

    Example:
        >>> owner("/sr_0/ratings", RATINGS), owner("/sr_0/tor", RATINGS), owner("/ratings", RATINGS)
        ('sr_0', None, None)
    """
    name = topic.removesuffix(ending).removeprefix("/")
    return name if topic == f"/{name}{ending}" and name and "/" not in name else None
