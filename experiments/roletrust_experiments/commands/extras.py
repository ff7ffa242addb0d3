"""Optional dependencies of the commands."""

from importlib.util import find_spec


def require(what: str, extra: str, *modules: str) -> None:
    """Check that all modules that a command imports are installed, before the command begins.

    Args:
        what: Part of the program that needs them, for the message.
        extra: Extra of this package that installs them.
        modules: Top-level names.

    Raises:
        ValueError: Some are missing; the message says which, and how to install them.
    """
    missing = [module for module in modules if find_spec(module) is None]
    if missing:
        raise ValueError(f"{what} needs {', '.join(missing)}: pip install 'roletrust-env[{extra}]'")


def require_robots() -> None:
    """Check before the work that the packages of a team's nodes and its page are installed."""
    require("roletrust robots", "robots", "cyclonedds", "rosbags", "cryptography", "cv2", "bokeh")
