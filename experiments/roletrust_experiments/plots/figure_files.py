"""Files of figures."""

from pathlib import Path
from typing import TYPE_CHECKING

from roletrust_env.storage.files import replacing

if TYPE_CHECKING:
    from matplotlib.figure import Figure


_UNDATED: dict[str, dict[str, None]] = {".pdf": {"CreationDate": None}, ".svg": {"Date": None}}
"""Metadata of formats that have a date by default. Without it, equal figures give equal bytes."""


def write_figure(path: Path, figure: "Figure", colours: int | None = None) -> None:
    """Write a figure at a resolution for the web and for print.

    Its titles and labels are plain text: a `$` in a name begins no formula.

    Args:
        path: Path of the file; its suffix gives the format.
        figure: Figure, which must not have been drawn yet.
        colours: Number of colours of a PNG, at most 256, which makes a chart a third as large. None
            keeps all.
    """
    from matplotlib.text import Text
    from PIL import Image

    for text in figure.findobj(Text):
        if (
            text.get_text()
        ):  # numbers of ticks, some of which are formulas, are written when the figure is drawn
            text.set_parse_math(False)
    with replacing(path) as temporary:
        figure.savefig(temporary, dpi=160, facecolor="white", metadata=_UNDATED.get(path.suffix))
        if colours is not None:
            with Image.open(temporary) as picture:
                reduced = picture.convert("RGB").quantize(colours, dither=Image.Dither.NONE)
            reduced.save(temporary, "PNG", optimize=True)
