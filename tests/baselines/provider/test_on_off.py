"""The on-off attack."""

from typing import Any

import numpy as np
import pytest
import torch
from refusals import refuses

from roletrust_baselines import OnOff
from roletrust_env import make_attacker
from roletrust_env.game.views import ProviderView
from roletrust_env.randomness import Random


def seen(round: Any) -> ProviderView:
    return ProviderView(round, 0 * round + 0.5, 0 * round + 1, 0 * round + 1, None, None)


def rounds(policy: OnOff, n: int = 20) -> list[float]:
    return policy.quality(seen(np.arange(float(n))), None, None)[0].tolist()


@pytest.mark.parametrize(
    ("policy", "expected"),
    [
        (OnOff(), [0, 1, 0, 1, 0, 1, 0, 1]),
        (OnOff(period=4, duty=0.25, bad=0.2, good=0.9), [0.2, 0.9, 0.9, 0.9, 0.2, 0.9, 0.9, 0.9]),
        (OnOff(period=4, duty=0.75), [0, 0, 0, 1, 0, 0, 0, 1]),
        (OnOff(start=2, stop=5, good=0.8), [1, 1, 0, 0.8, 0, 1, 1, 1]),
        (OnOff(start=3, period=3, duty=1 / 3), [1, 1, 1, 0, 1, 1, 0, 1]),
        (OnOff(duty=0), [1] * 8),
        (OnOff(duty=1), [0] * 8),
        (OnOff(period=1, duty=1, start=6), [1] * 6 + [0] * 2),
    ],
    ids=str,
)
def test_bad_and_good_rounds_take_turns(policy: OnOff, expected: list[float]) -> None:
    assert rounds(policy, 8) == pytest.approx(expected)


@pytest.mark.parametrize("period", [10, 100, 1000])
def test_a_share_of_the_period_is_as_many_rounds(period: int) -> None:
    """Not one more where the product of the two rounds up: 0.07 x 100 is 7.000000000000001."""
    for bad in range(period + 1):
        assert rounds(OnOff(period=period, duty=bad / period), period).count(0) == bad


@pytest.mark.parametrize(("period", "duty"), [(8, 0.25), (6, 0.5), (2, 0.5), (10, 0.9)])
def test_random_spells_have_the_means_of_the_regular_ones(period: int, duty: float) -> None:
    policy, random = (
        OnOff(period=period, duty=duty, switching="random"),
        Random(np.random.default_rng(0)),
    )
    games, n = 400, 400
    memory, served = policy.begin(random, (games,)), []
    for t in range(n):
        quality, memory = policy.quality(seen(np.full(games, float(t))), memory, random)
        served.append(quality)
    bad = np.array(served) == 0
    starts = (bad[1:] & ~bad[:-1]).sum()
    assert bad.mean() == pytest.approx(duty, abs=0.01)
    assert bad.sum() / starts == pytest.approx(max(1, period * duty), rel=0.03)
    assert bad[0].mean() == pytest.approx(duty, abs=0.08)


@pytest.mark.parametrize(
    "like", [np.zeros((), np.float32), np.zeros(()), torch.zeros(()), torch.zeros(()).double()]
)
def test_quality_has_the_library_and_precision_of_the_view(like: Any) -> None:
    quality, _ = OnOff(bad=0.1, good=0.7).quality(seen(like + 0), None, None)
    assert isinstance(quality, type(like) | np.generic)
    assert quality.dtype == like.dtype
    assert float(quality) == pytest.approx(0.1, abs=1e-7 if "32" in str(like.dtype) else 1e-15)


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ({"period": 0}, ("period", "0")),
        ({"duty": 1.1}, ("duty", "1.1", "[0, 1]")),
        ({"duty": float("nan")}, ("duty", "nan", "[0, 1]")),
        ({"bad": -0.1}, ("bad", "-0.1", "[0, 1]")),
        ({"good": 2}, ("good", "2", "[0, 1]")),
        ({"switching": "often"}, ("switching", "often")),
        ({"start": -1}, ("start", "-1", "0")),
        ({"start": 5, "stop": 5}, ("stop", "5", "start")),
    ],
)
def test_bad_parameters_are_refused(parameters: dict[str, Any], words: tuple[str, ...]) -> None:
    with refuses(ValueError, "on-off", *words):
        make_attacker("on-off", **parameters)
    with refuses(ValueError, next(iter(parameters))):
        OnOff(**parameters)
