"""Errors of what is measured on logs."""


class TooSmallError(ValueError):
    """A log is too small for a protocol."""
