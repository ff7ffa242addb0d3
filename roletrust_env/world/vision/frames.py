"""Sources of frames: the rendered scene, a video file, a folder of images, or a camera."""

import math
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Protocol

import cv2
import numpy as np

from roletrust_env.world.vision.camera import FRAME_HEIGHT, Frame
from roletrust_env.world.vision.degrade import motion_kernel
from roletrust_env.world.vision.scene import RenderedScene

IMAGE_SUFFIXES = (".bmp", ".jpeg", ".jpg", ".png", ".tif", ".tiff", ".webp")
"""File name suffixes of the images in a folder, in lower case."""

# Silences ffmpeg, whose messages would repeat the errors raised here. OpenCV reads it when it opens
# its first video.
os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")

_MIN_ASPECT = 0.45  # width over height; in a narrower frame the detector's window does not fit
_ROUNDING_S = 1e-6
_ENDLESS = "has no end; loop it, or give the run an end"


class FramesError(ValueError):
    """Frames that cannot be read. The message gives the source, the problem, and the allowed
    sources.
    """


class FrameSource(Protocol):
    """Protocol of sources of frames."""

    def frame(self, camera: int, time_s: float, strength: float) -> Frame:
        """Return the frame of a camera.

        Args:
            camera: Index of the camera, from 0 on.
            time_s: Time since the start of the run, seconds.
            strength: Strength of the perturbation in [0, 1], which is the speed of the target.

        Returns:
            Frame of shape (FRAME_HEIGHT, width, 3).
        """


class CapturedFrames:
    """Base class of sources of real frames. They are resized, and blurred horizontally if the
    target moves fast.
    """

    loop_length_s: float | None = None
    """Length of a looped video or image folder, in seconds; None if it is not looped."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._latest: tuple[float, Frame] | None = (
            None  # providers that share a source get the same frame
        )

    def frame(self, camera: int, time_s: float, strength: float) -> Frame:
        """Return the frame at a time, the same for every camera. See `FrameSource.frame`."""
        if self._latest is None or self._latest[0] != time_s:
            self._latest = (time_s, self._resize(self._read(time_s)))
        picture = self._latest[1]
        if strength > 0:
            picture = np.asarray(
                cv2.filter2D(picture, -1, motion_kernel(strength, (1.0, 0.0))), np.uint8
            )
        return picture

    def _read(self, time_s: float) -> Frame:
        """Return the frame at a time, of any size, with the colours in the order of OpenCV."""
        raise NotImplementedError

    def _resize(self, picture: Frame) -> Frame:
        height, width = picture.shape[:2]
        if width < _MIN_ASPECT * height:
            raise FramesError(
                f"{self._name}: frames of {width}x{height} pixels are too narrow; "
                f"the width must be at least {_MIN_ASPECT} of the height"
            )
        size = (round(width * FRAME_HEIGHT / height), FRAME_HEIGHT)
        shrinks = height > FRAME_HEIGHT
        resized = cv2.resize(
            picture, size, interpolation=cv2.INTER_AREA if shrinks else cv2.INTER_CUBIC
        )
        return np.asarray(cv2.cvtColor(resized, cv2.COLOR_BGR2RGB), np.uint8)


class VideoFile(CapturedFrames):
    """Frames of a video at its own frame rate.

    Args:
        path: Path of the video.
        duration_s: Length of the run, seconds; infinite for a run without an end.
        loop: Whether a video that is shorter than the run starts again.

    Raises:
        FramesError: The video cannot be opened, or is shorter than the run and not looped.
    """

    def __init__(self, path: Path, duration_s: float, loop: bool = False) -> None:
        super().__init__(f"video {path}")
        self._path, self._loop = path, loop
        self._open()
        self._fps = self._capture.get(cv2.CAP_PROP_FPS)
        if not self._fps > 0:
            raise FramesError(f"{self._name} has no frame rate; a constant frame rate is needed")
        self._count = round(
            self._capture.get(cv2.CAP_PROP_FRAME_COUNT)
        )  # 0 or less if the format does not say
        length_s = self._count / self._fps
        if self._count <= 0 and math.isinf(duration_s) and not loop:
            raise FramesError(
                f"{self._name} does not say how long it lasts, and the run {_ENDLESS}"
            )
        if 0 < length_s < duration_s - _ROUNDING_S:
            if not loop:
                raise FramesError(
                    f"{self._name} lasts {length_s:.1f} s and ends before the run, "
                    + _ways_out(duration_s, f"lasts {duration_s:.1f} s", "a longer video")
                )
            self.loop_length_s = length_s

    def _open(self) -> None:
        with _quiet():
            self._capture = cv2.VideoCapture(str(self._path))
        if not self._capture.isOpened():
            raise FramesError(
                f"{self._name} cannot be opened; it must be a video that OpenCV can decode"
            )
        self._next = 0

    def _read(self, time_s: float) -> Frame:
        # Frames are read in order, from the start if necessary. Seeking is inexact in many formats,
        # so the frame would depend on the order of the calls.
        index = int(time_s * self._fps + _ROUNDING_S)
        if self._count > 0 and self._loop:
            index %= self._count
        elif self._count > 0 and index == self._count:
            index -= 1  # the end of a video that is exactly as long as the run
        if index < self._next - 1:
            self._open()
        while self._next <= index:
            if not self._capture.grab():
                return self._read_after_end(time_s)
            self._next += 1
        decoded, picture = self._capture.retrieve()
        if not decoded:
            raise FramesError(f"{self._name}: frame {index} cannot be decoded")
        return np.asarray(picture, np.uint8)

    def _read_after_end(self, time_s: float) -> Frame:
        """Return the frame at a time if the video ends earlier than its header says."""
        length_s = self._next / self._fps
        if self._next == 0 or not self._loop:
            expected = f" of {self._count}" if self._count > self._next else ""
            raise FramesError(
                f"{self._name} ends after {self._next}{expected} frames ({length_s:.1f} s), "
                f"but the run needs a frame at {time_s:.1f} s; use a complete video, or a shorter "
                "run"
            )
        self._count, self.loop_length_s = self._next, length_s
        self._open()
        return self._read(time_s)


class ImageFolder(CapturedFrames):
    """Images of a folder in the order of their names, one for each round.

    Args:
        path: Path of the folder.
        duration_s: Length of the run, seconds; infinite for a run without an end.
        period_s: Length of a round, seconds.
        loop: Whether the images start again if there are fewer of them than rounds.

    Raises:
        FramesError: The folder holds no images, or fewer images than the run has rounds and is not
            looped.
    """

    def __init__(self, path: Path, duration_s: float, period_s: float, loop: bool = False) -> None:
        super().__init__(f"image folder {path}")
        self._period_s, self._loop = period_s, loop
        self._images = sorted(
            file for file in path.iterdir() if file.suffix.lower() in IMAGE_SUFFIXES
        )
        needed = duration_s / period_s
        if not self._images:
            raise FramesError(
                f"{self._name} holds no images; allowed are {', '.join(IMAGE_SUFFIXES)}"
            )
        if len(self._images) < needed - 0.5:
            if not loop:
                raise FramesError(
                    f"{self._name} holds {len(self._images)} images, one for each round, and ends "
                    "before the run, "
                    + _ways_out(duration_s, f"has {needed:.0f} rounds", "more images")
                )
            self.loop_length_s = len(self._images) * period_s

    def _read(self, time_s: float) -> Frame:
        index = round(time_s / self._period_s)
        if self._loop:
            index %= len(self._images)
        if index >= len(self._images):
            raise FramesError(
                f"{self._name} holds {len(self._images)} images, but round {index} needs one more"
            )
        with _quiet():
            picture = cv2.imread(str(self._images[index]), cv2.IMREAD_COLOR)
        if picture is None:
            raise FramesError(
                f"image {self._images[index]} cannot be read; OpenCV must be able to decode it"
            )
        return np.asarray(picture, np.uint8)


class LiveCamera(CapturedFrames):
    """Frames of a camera of this machine in real time, the only source that is not reproducible.

    Args:
        number: Number of the camera, from 0 on.
        paced: Whether a round that is early waits for its time; False if the caller waits.

    Raises:
        FramesError: There is no such camera.
    """

    def __init__(self, number: int, paced: bool = True) -> None:
        super().__init__(f"camera {number}")
        self._paced = paced
        if not 0 <= number < 2**31:  # OpenCV crashes with other numbers
            raise FramesError(f"{self._name} does not exist; the numbers of cameras start at 0")
        with _quiet():
            self._capture = cv2.VideoCapture(number)
        if not self._capture.isOpened():
            raise FramesError(
                f"{self._name} cannot be opened; give the number of a connected camera, 0 for the "
                "first"
            )
        self._capture.set(cv2.CAP_PROP_BUFFERSIZE, 1)  # the current frame, not one from the buffer
        self._start = self._last = float("inf")

    def _read(self, time_s: float) -> Frame:
        if time_s < self._last:  # a new run starts
            self._start = time.monotonic() - time_s
        self._last = time_s
        if self._paced:
            time.sleep(max(0.0, self._start + time_s - time.monotonic()))
        success, picture = self._capture.read()
        if not success:
            raise FramesError(f"{self._name} stopped sending frames at {time_s:.1f} s")
        return np.asarray(picture, np.uint8)


def open_frames(
    source: str | Path | int | None,
    *,
    duration_s: float,
    period_s: float,
    loop: bool = False,
    paced: bool = True,
) -> FrameSource:
    """Open a source of frames, and check that it lasts as long as the run, if that is known in
    advance.

    Args:
        source: Path of a video or of a folder of images; number of a camera (also as text, unless a
            file has that name); None for the rendered scene.
        duration_s: Length of the run, seconds; infinite for a run without an end.
        period_s: Length of a round, seconds.
        loop: Whether a video or a folder that is shorter than the run starts again.
        paced: See `LiveCamera`.

    Raises:
        FramesError: The source does not exist, cannot be opened, ends before the run, or cannot be
            looped.
    """
    path = Path(str(source))
    live = isinstance(source, int) or (not path.exists() and str(source).isdecimal())
    if loop and (source is None or live):
        name = "the rendered scene" if source is None else f"camera {source}"
        raise FramesError(
            f"{name} cannot be looped because it has no end; videos and folders of images can"
        )
    if source is None:
        return RenderedScene(0)
    if live:
        return LiveCamera(int(source), paced)  # type: ignore[arg-type]
    if path.is_dir():
        return ImageFolder(path, duration_s, period_s, loop)
    if not path.exists():
        raise FramesError(
            f"frames {str(source)!r} do not exist; "
            "allowed are a video file, a folder of images, and the number of a camera"
        )
    return VideoFile(path, duration_s, loop)


def _ways_out(duration_s: float, length: str, more: str) -> str:
    """Return the end of the message about frames that end before the run."""
    if math.isinf(duration_s):
        return f"which {_ENDLESS}"
    return f"which {length}; use {more} or a shorter run, or loop it"


@contextmanager
def _quiet() -> Iterator[None]:
    """Silence the warnings of OpenCV, which would repeat the errors raised here."""
    level = cv2.utils.logging.getLogLevel()
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    try:
        yield
    finally:
        cv2.utils.logging.setLogLevel(level)
