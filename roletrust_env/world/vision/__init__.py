"""The service of the paper: camera frames, OpenCV's people detector, and the probability of a person.

This package is the only part of the library that imports OpenCV. It is imported only for scenarios with camera frames.
"""

from roletrust_env.world.vision.camera import FRAME_HEIGHT, FRAME_WIDTH
from roletrust_env.world.vision.degrade import degrade
from roletrust_env.world.vision.detector import OFFSET, SLOPE, best_margin, probability, view
from roletrust_env.world.vision.frames import FramesError, FrameSource, open_frames
from roletrust_env.world.vision.scene import RenderedScene
from roletrust_env.world.vision.service import HogService

__all__ = [
    "FRAME_HEIGHT",
    "FRAME_WIDTH",
    "OFFSET",
    "SLOPE",
    "FrameSource",
    "FramesError",
    "HogService",
    "RenderedScene",
    "best_margin",
    "degrade",
    "open_frames",
    "probability",
    "view",
]
