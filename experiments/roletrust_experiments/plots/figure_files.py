"""Files of figures."""

from pathlib import Path
from typing import TYPE_CHECKING

from roletrust_env.storage.files import replacing

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def write_figure(path: Path, figure: "Figure") -> None:
    """Write a figure at a resolution for the web and for print."""
    with replacing(path) as temporary:
        figure.savefig(temporary, dpi=160, facecolor="white")
