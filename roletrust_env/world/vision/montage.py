"""Frames side by side, for figures and rendering."""

from collections.abc import Sequence

import cv2
import numpy as np

from roletrust_env.world.vision.camera import Frame

__all__ = ["montage"]

_GAP = 6  # pixels between frames
_WHITE, _INK = (255, 255, 255), (24, 26, 30)


def montage(
    frames: Frame | Sequence[Frame], labels: Sequence[str] | None = None, *, columns: int | None = None
) -> Frame:
    """Lays frames out in rows, with an optional label on each.

    Args:
        frames: P frames of one size (height, width, 3), RGB, such as `HogService.latest`.
        labels: one for each frame.
        columns: frames in a row; all in one row by default.

    Returns:
        The picture (height, width, 3), RGB.

    Raises:
        ValueError: no frames, or a number of labels other than the number of frames.
    """
    if len(frames) == 0:
        raise ValueError("a montage needs at least one frame")
    if labels is not None and len(labels) != len(frames):
        raise ValueError(f"{len(labels)} labels for {len(frames)} frames; give one for each")
    across = min(columns or len(frames), len(frames))
    down = -(-len(frames) // across)
    height, width = frames[0].shape[:2]
    picture = np.full((down * (height + _GAP) - _GAP, across * (width + _GAP) - _GAP, 3), 255, np.uint8)
    for k, frame in enumerate(frames):
        row, column = k // across * (height + _GAP), k % across * (width + _GAP)
        tile = np.array(frame)
        if labels is not None:
            _label(tile, labels[k])
        picture[row : row + height, column : column + width] = tile
    return picture


def _label(tile: Frame, text: str) -> None:
    """Writes white text on a dark plate in the lower left corner, in place."""
    font, size = cv2.FONT_HERSHEY_SIMPLEX, tile.shape[0] / 600
    (width, height), drop = cv2.getTextSize(text, font, size, 1)
    bottom = tile.shape[0] - 1
    cv2.rectangle(tile, (0, bottom - height - 2 * drop - 2), (width + 2 * drop, bottom), _INK, cv2.FILLED)
    cv2.putText(tile, text, (drop, bottom - drop - 1), font, size, _WHITE, 1, cv2.LINE_AA)
