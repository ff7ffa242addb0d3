"""The printed output of a tutorial's cell, with its line breaks."""

from collections.abc import Sequence
from copy import copy

from nbformat import NotebookNode


def whole_streams(outputs: Sequence[NotebookNode]) -> list[NotebookNode]:
    """Return the outputs of a cell with each stream in one piece.

    Programs print in pieces that end anywhere; the function of MyST-NB breaks the line after each piece.
    """
    found: list[NotebookNode] = []
    streams: dict[str, NotebookNode] = {}
    for output in outputs:
        if output["output_type"] != "stream":
            found.append(output)
        elif output["name"] in streams:
            streams[output["name"]]["text"] += output["text"]
        else:
            streams[output["name"]] = copy(output)
            found.append(streams[output["name"]])
    return found
