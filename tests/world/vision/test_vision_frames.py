import subprocess
import sys
import time
from math import inf
from types import SimpleNamespace

import cv2
import imageio.v2 as imageio
import numpy as np
import pytest
from refusals import refuses

from roletrust_env.world.vision.camera import FRAME_HEIGHT
from roletrust_env.world.vision.frames import FramesError, open_frames
from roletrust_env.world.vision.scene import RenderedScene
from roletrust_env.world.vision.service import HogService

FPS = 10


def write_video(path, seconds, width=320, height=240, codec="MJPG"):
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*codec), FPS, (width, height))
    assert writer.isOpened()
    for k in range(round(seconds * FPS)):
        writer.write(np.full((height, width, 3), 5 * k % 256, np.uint8))  # frame k is grey 5 k
    writer.release()
    return path


def write_images(folder, count):
    for k in range(count):
        cv2.imwrite(
            str(folder / f"{k:03}.png"), np.full((90, 160, 3), (0, 0, 10 * k), np.uint8)
        )  # red, in BGR
    (folder / "notes.txt").write_text("not an image")
    return folder


def opened(source, duration_s=2.0, period_s=0.5, loop=False):
    return open_frames(source, duration_s=duration_s, period_s=period_s, loop=loop)


def test_a_video_is_read_by_its_own_clock_in_any_order(tmp_path):
    source = opened(str(write_video(tmp_path / "walk.avi", 3.0)))
    for time_s in (0.5, 1.5, 0.0, 2.0, 2.0, 0.5):
        frame = source.frame(0, time_s, 0.0)
        assert frame.shape == (FRAME_HEIGHT, 480, 3)
        assert frame.mean() == pytest.approx(5 * FPS * time_s, abs=4)


def test_a_video_just_as_long_as_the_run_will_do(tmp_path):
    source = opened(write_video(tmp_path / "walk.avi", 2.0))
    assert source.frame(0, 2.0, 0.0).mean() == pytest.approx(5 * 19, abs=4)


def test_a_video_that_ends_early_is_refused_up_front(tmp_path):
    with refuses(FramesError, "walk.avi", "1.0", "2.0"):
        opened(write_video(tmp_path / "walk.avi", 1.0))


def test_a_video_that_lied_about_its_length_is_refused_where_it_ends(tmp_path):
    path = write_video(tmp_path / "walk.avi", 3.0)
    source = opened(path)
    source._count = 1000  # what a broken header would promise
    with refuses(FramesError, "1000", "3.0", "5.0"):
        source.frame(0, 5.0, 0.0)


def test_a_file_that_is_no_video(tmp_path):
    path = tmp_path / "walk.mp4"
    path.write_text("not a video")
    with refuses(FramesError, "walk.mp4"):
        opened(path)


def test_a_broken_video_is_one_error_and_no_line_of_ffmpeg(tmp_path):
    # In a process of its own: what OpenCV and ffmpeg say goes past Python, and how much is settled
    # once.
    whole = tmp_path / "whole.mp4"
    with imageio.get_writer(whole, fps=FPS, macro_block_size=1, ffmpeg_log_level="quiet") as film:
        for k in range(30):
            film.append_data(
                np.random.default_rng(k).integers(0, 256, (240, 320, 3), dtype=np.uint8)
            )
    data = bytearray(whole.read_bytes())
    (tmp_path / "cut.mp4").write_bytes(data[: len(data) // 2])
    at = slice(len(data) // 3, len(data) // 3 + 20_000)
    data[at] = np.random.default_rng(0).bytes(20_000)
    (tmp_path / "bad.mp4").write_bytes(data)
    code = (
        "import sys\nfrom roletrust_env.world.vision.frames import FramesError, open_frames\n"
        "for path in sys.argv[1:]:\n"
        "    try:\n        source = open_frames(path, duration_s=3.0, period_s=0.1)\n"
        "        for k in range(30): source.frame(0, 0.1 * k, 0.0)\n"
        "    except FramesError as error: print(error)"
    )
    films = [str(tmp_path / f"{name}.mp4") for name in ("cut", "bad", "whole")]
    run = subprocess.run(
        [sys.executable, "-c", code, *films], capture_output=True, text=True, check=True
    )
    assert run.stderr == ""
    for said, (name, fault) in zip(
        run.stdout.splitlines(),
        (("cut.mp4", "cannot be opened"), ("bad.mp4", "of 30 frames")),
        strict=True,
    ):
        assert name in said
        assert fault in said


def test_a_video_that_is_looped_begins_again(tmp_path):
    path = write_video(tmp_path / "walk.avi", 1.0)
    source = opened(path, loop=True)
    assert source.loop_length_s == 1.0
    for time_s in (0.0, 0.9, 1.0, 1.9, 0.3, 7.5):
        assert source.frame(0, time_s, 0.0).mean() == pytest.approx(5 * FPS * (time_s % 1), abs=4)
    longer = opened(path, duration_s=0.5, loop=True)
    assert longer.loop_length_s is None
    liar = opened(path, loop=True)
    liar._count = 1000
    assert liar.frame(0, 1.2, 0.0).mean() == pytest.approx(10, abs=4)
    assert liar.loop_length_s == 1.0


@pytest.mark.parametrize("count", [0, -1, 30])
def test_a_run_without_an_end_needs_frames_without_one(count, monkeypatch, tmp_path):
    (tmp_path / "walk.avi").write_bytes(b"")
    capture = SimpleNamespace(
        isOpened=lambda: True, get={cv2.CAP_PROP_FPS: 10.0, cv2.CAP_PROP_FRAME_COUNT: count}.get
    )
    monkeypatch.setattr(cv2, "VideoCapture", lambda _: capture)
    with refuses(FramesError, "walk.avi"):
        opened(tmp_path / "walk.avi", duration_s=inf)
    opened(tmp_path / "walk.avi", duration_s=inf, loop=True)


def test_a_frame_that_is_due_twice_is_not_looked_for_from_the_start(tmp_path, monkeypatch):
    source = opened(write_video(tmp_path / "walk.avi", 3.0), duration_s=1.0, period_s=0.05)
    seen = source.frame(0, 1.0, 0.0)
    monkeypatch.setattr(source, "_open", None)
    np.testing.assert_array_equal(source.frame(0, 1.05, 0.0), seen)


def test_an_image_folder_that_is_looped_begins_again(tmp_path):
    source = opened(write_images(tmp_path, 3), loop=True)
    assert source.loop_length_s == 1.5
    for k in (2, 3, 10):
        np.testing.assert_allclose(
            source.frame(1, 0.5 * k, 0.0).mean((0, 1)), (10 * (k % 3), 0, 0), atol=1
        )


@pytest.mark.parametrize(
    ("source", "words"), [(None, ("scene",)), (3, ("camera", "3")), ("3", ("camera", "3"))]
)
def test_what_has_no_end_is_not_looped(source, words):
    with refuses(FramesError, *words):
        opened(source, loop=True)


def test_an_image_folder_gives_one_image_a_round_in_rgb(tmp_path):
    source = opened(write_images(tmp_path, 5), duration_s=2.5)
    for k in (3, 0, 4):
        frame = source.frame(1, 0.5 * k, 0.0)
        assert frame.shape == (FRAME_HEIGHT, 640, 3)
        np.testing.assert_allclose(frame.mean((0, 1)), (10 * k, 0, 0), atol=1)


def test_image_folders_that_will_not_do(tmp_path):
    with refuses(FramesError, ".png"):
        opened(tmp_path)
    write_images(tmp_path, 3)
    with refuses(FramesError, "3", "4"):
        opened(tmp_path)
    (tmp_path / "000.png").write_text("broken")
    with refuses(FramesError, "000.png"):
        opened(tmp_path, duration_s=1.5).frame(0, 0.0, 0.0)


def test_frames_too_narrow_for_the_detector(tmp_path):
    cv2.imwrite(str(tmp_path / "0.png"), np.zeros((100, 20, 3), np.uint8))
    with refuses(FramesError, "20x100"):
        opened(tmp_path, duration_s=0.5).frame(0, 0.0, 0.0)


def test_what_does_not_exist():
    with refuses(FramesError, "no/such/walk.mp4"):
        opened("no/such/walk.mp4")


@pytest.mark.parametrize("number", [97, "97"])
def test_a_camera_that_is_not_there(number, capfd):
    with refuses(FramesError, "97"):
        opened(number)
    assert capfd.readouterr().err == ""


def test_no_source_is_the_rendered_scene():
    assert isinstance(opened(None), RenderedScene)


def test_recorded_frames_blur_where_the_target_moves_fast(tmp_path):
    rng = np.random.default_rng(0)
    cv2.imwrite(str(tmp_path / "0.png"), rng.integers(0, 256, (360, 480, 3), dtype=np.uint8))
    source = opened(tmp_path, duration_s=0.5)
    sharp, fast = (source.frame(0, 0.0, strength).astype(float) for strength in (0.0, 1.0))
    assert np.abs(np.diff(fast, axis=1)).mean() < 0.1 * np.abs(np.diff(sharp, axis=1)).mean()


def test_a_video_of_the_scene_gets_the_ratings_of_the_scene(tmp_path):
    scene = RenderedScene(0)
    for k in range(3):
        cv2.imwrite(str(tmp_path / f"{k}.png"), scene.frame(0, k * 0.5)[..., ::-1])
    recorded = HogService(2, 1, period_s=0.5, max_cycles=3, frames=str(tmp_path))
    rendered = HogService(2, 1, period_s=0.5, max_cycles=3)
    noise = np.random.default_rng(0).standard_normal((2, 1))
    for k in range(3):
        np.testing.assert_array_equal(
            recorded.perceive([1.0], 0.0, k, noise), rendered.perceive([1.0], 0.0, k, noise)
        )


class OneCamera:
    """A stand-in for `cv2.VideoCapture` of a camera that is always there."""

    def __init__(self, number):
        pass

    def isOpened(self):
        return True

    def set(self, what, value):
        return True

    def read(self):
        return True, np.full((360, 480, 3), 128, np.uint8)


def test_a_live_camera_keeps_the_time_of_the_run(monkeypatch):
    """By a clock that only waiting moves on, and the camera, which takes 0.03 s for each frame."""
    now = [50.0]

    def wait(seconds):
        now[0] += seconds

    class SlowCamera(OneCamera):
        def read(self):
            wait(0.03)
            return super().read()

    monkeypatch.setattr(cv2, "VideoCapture", SlowCamera)
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    monkeypatch.setattr(time, "sleep", wait)
    camera = open_frames(7, duration_s=1.0, period_s=0.1)
    for _ in range(2):  # a second run on the same camera begins at its own 0
        begun = now[0]
        for time_s in (0.0, 0.1, 0.2):
            assert camera.frame(0, time_s, 0.0).shape == (360, 480, 3)
        assert now[0] - begun == pytest.approx(0.23)
