import numpy as np
import pytest
from refusals import refuses

from roletrust_env.world.vision.camera import FRAME_HEIGHT, FRAME_WIDTH
from roletrust_env.world.vision.degrade import degrade
from roletrust_env.world.vision.detector import best_margin, detector_view
from roletrust_env.world.vision.scene import RenderedScene

STRENGTHS = (0.0, 0.4, 1.0)


@pytest.fixture(scope="module")
def scene():
    return RenderedScene(0)


@pytest.mark.parametrize("strength", STRENGTHS)
def test_a_frame_depends_on_its_arguments_only(scene, strength):
    again = RenderedScene(0)
    again.frame(2, 7.0, 1.0)  # another call before must not matter
    for camera in range(4):
        frame = scene.frame(camera, 3.5, strength)
        assert frame.shape == (FRAME_HEIGHT, FRAME_WIDTH, 3)
        assert frame.dtype == np.uint8
        np.testing.assert_array_equal(frame, again.frame(camera, 3.5, strength))


def test_camera_time_strength_and_seed_all_matter(scene):
    frame = scene.frame(0, 1.0, 0.0)
    others = (
        scene.frame(1, 1.0, 0.0),
        scene.frame(0, 1.5, 0.0),
        scene.frame(0, 1.0, 0.5),
        RenderedScene(1).frame(0, 1.0, 0.0),
    )
    for other in others:
        assert not np.array_equal(frame, other)


def test_no_two_of_many_cameras_see_the_same(scene):
    frames = [scene.frame(camera, 0.0) for camera in range(7)]
    assert len({frame.tobytes() for frame in frames}) == len(frames)


def test_the_empty_scene_differs_only_about_the_person(scene):
    changed = (scene.frame(0, 2.0) != scene.empty(0)).any(-1)
    assert 0.02 < changed.mean() < 0.15
    with refuses(ValueError):
        scene.empty(0)[:] = 0


@pytest.mark.parametrize("camera", range(4))
def test_the_faster_the_target_the_worse_it_is_seen(scene, camera):
    margins = [
        np.mean(
            [
                best_margin(detector_view(scene.frame(camera, t, strength)))
                for t in np.arange(0, 7, 0.9)
            ]
        )
        for strength in STRENGTHS
    ]
    assert margins[0] > margins[1] > margins[2] + 1.5


def test_quality_one_is_untouched_and_zero_is_a_covered_lens(scene):
    frame = scene.frame(0, 2.0)
    assert degrade(frame, 1.0, (0,)) is frame
    covered = degrade(frame, 0.0, (0,)).astype(float)
    rows = covered.mean((1, 2))
    assert rows.max() < 20
    assert np.ptp(rows) < 6  # sky and ground cannot be told apart


def test_degrading_is_smooth_and_seeded(scene):
    frame = scene.frame(0, 2.0)
    kept = frame.copy()
    changes = [
        np.abs(degrade(frame, q, (1,)).astype(float) - frame).mean()
        for q in (0.999, 0.9, 0.7, 0.5, 0.2, 0.0)
    ]
    assert changes[0] < 2
    assert changes == sorted(changes)
    np.testing.assert_array_equal(degrade(frame, 0.5, (1, 2)), degrade(frame, 0.5, (1, 2)))
    assert not np.array_equal(degrade(frame, 0.5, (1, 2)), degrade(frame, 0.5, (1, 3)))
    np.testing.assert_array_equal(frame, kept)
