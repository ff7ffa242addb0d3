import numpy as np
import pytest
from calibration import fit_calibration, labelled_margins
from refusals import refuses

from roletrust_env.world.vision.degrade import degrade
from roletrust_env.world.vision.detector import (
    OFFSET,
    SLOPE,
    best_margin,
    detector_view,
    probability,
)
from roletrust_env.world.vision.scene import RenderedScene


def seen(frame):
    return probability(best_margin(detector_view(frame)))


@pytest.fixture(scope="module")
def calibration_set():
    return labelled_margins()


@pytest.mark.slow
def test_refitting_gives_the_constants(calibration_set):
    slope, offset = fit_calibration(*calibration_set)
    assert slope == pytest.approx(SLOPE, abs=0.1)
    assert offset == pytest.approx(OFFSET, abs=0.2)


def test_the_calibration_holds_for_scenes_it_was_not_fitted_on():
    margins, labels = labelled_margins(seeds=[11], cameras=range(6), moments=3)
    fitted = np.array([probability(margin) for margin in margins])
    assert fitted[labels].min() >= 0.97
    assert fitted[~labels].max() <= 0.03


def test_the_fit_is_the_maximum_of_the_likelihood():
    rng = np.random.default_rng(0)
    margins = rng.normal(size=400)
    labels = rng.random(400) < 1 / (1 + np.exp(-(2 * margins - 0.5)))
    slope, offset = fit_calibration(margins, labels)

    def loss(a, b):
        targets = np.where(labels, 1 - 1e-4, 1e-4)
        logits = a * margins + b
        return np.sum(np.logaddexp(0, logits) - targets * logits)

    best = loss(slope, offset)
    assert all(loss(slope + da, offset + db) > best for da in (-0.01, 0.01) for db in (-0.01, 0.01))
    assert slope == pytest.approx(2, abs=0.5)


@pytest.mark.slow
def test_how_many_frames_are_drawn_does_not_change_the_fit(calibration_set):
    margins, labels = calibration_set
    np.testing.assert_allclose(
        fit_calibration(margins, labels),
        fit_calibration(np.tile(margins, 5), np.tile(labels, 5)),
        rtol=1e-6,
    )


def test_a_calibration_needs_both_kinds_of_frames():
    with refuses(ValueError, "labels"):
        fit_calibration(np.ones(3), np.ones(3, bool))


def test_probability_is_a_rising_fraction():
    values = [probability(margin) for margin in np.linspace(-20, 20, 41)]
    assert values == sorted(values)
    assert 0 <= values[0] < 1e-9
    assert 1 - 1e-9 < values[-1] <= 1


@pytest.mark.parametrize("camera", range(6))
def test_person_in_clear_view_and_nobody(camera):
    scene = RenderedScene(0)
    assert min(seen(scene.frame(camera, t)) for t in np.arange(0, 7.3, 0.45)) >= 0.97
    assert seen(scene.empty(camera)) <= 0.03


def test_frames_with_nothing_in_them():
    rng = np.random.default_rng(0)
    for level in (0, 20, 128, 255):
        assert seen(np.full((360, 480, 3), level, np.uint8)) <= 0.03
    assert seen(rng.integers(0, 256, (360, 480, 3), dtype=np.uint8)) <= 0.03


def test_probability_falls_with_quality():
    scene = RenderedScene(0)
    means = [
        np.mean(
            [
                seen(degrade(scene.frame(c, t), q, (c, k)))
                for c in range(3)
                for k, t in enumerate(range(3))
            ]
        )
        for q in (1.0, 0.6, 0.5, 0.4, 0.0)
    ]
    assert means == sorted(means, reverse=True)
    assert means[0] > 0.99
    assert 0.2 < means[2] < 0.8
    assert means[-1] < 0.01
