"""What a command needs beyond the extra `cli`."""

from importlib.util import find_spec


def require(what: str, extra: str, *modules: str) -> None:
    """See before the work whether all modules are there that it will import.

    Args:
        what: needs them, for the message.
        extra: of this package, that brings them.
        modules: top-level names.

    Raises:
        ValueError: some are missing; it says which, and what to install.
    """
    missing = [module for module in modules if find_spec(module) is None]
    if missing:
        raise ValueError(f"{what} needs {', '.join(missing)}: pip install 'roletrust-env[{extra}]'")
