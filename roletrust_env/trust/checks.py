"""The ranges that every trust model keeps its common parameters to."""


def check_smoothing(lam: float, initial: float) -> None:
    """Refuse a smoothing weight or an initial trust outside its range.

    Raises:
        ValueError: `lam` is outside [0.5, 1) or `initial` outside [0, 1].
    """
    if not 0.5 <= lam < 1:
        raise ValueError(f"lam is {lam!r}; it must lie in [0.5, 1)")
    if not 0 <= initial <= 1:
        raise ValueError(f"initial is {initial!r}; a trust must lie in [0, 1]")
