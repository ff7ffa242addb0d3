"""A provider: publishes what its camera sees, as good as its policy will have it."""

import time
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from roletrust_env.game.policy import Policy
from roletrust_env.game.views import ProviderView
from roletrust_env.live.nodes.running import Bulletin, Reviews, Timeline, running
from roletrust_env.live.nodes.topics import IMAGES
from roletrust_env.live.wire import messages
from roletrust_env.live.wire.dds import Node
from roletrust_env.randomness import Random
from roletrust_env.world.perturbation import Perturbations
from roletrust_env.world.roster import Roster
from roletrust_env.world.scenario import Scenario
from roletrust_env.world.vision import FramesError, degrade, open_frames

_JPEG_QUALITY = 95  # of 100; so the people detector sees what it would see without


def run_cam(
    name: str,
    scenario: Scenario,
    *,
    timeline: Timeline,
    policy: Policy | None = None,
    frames: str | Path | int | None = None,
    loop: bool = False,
    seed: int = 0,
    network: bool = False,
) -> None:
    """Be a camera until the scenario ends, or it is told to stop.

    Args:
        name: of the provider, one of the scenario's.
        scenario: how long it lasts, and when the target moves fast.
        timeline: when its rounds begin.
        policy: how it serves; None serves well. It sees its trust, and the ratings of it since its last service.
        frames: see `open_frames`.
        loop: see `open_frames`.
        seed: of the sensor noise of bad service, and of policies that play at random.
        network: see `Node`.

    Raises:
        ValueError: the scenario has no such provider, or there are no such frames (`FramesError`).
    """
    roster = Roster.of(scenario)
    if name not in roster.provider_names:
        raise ValueError(f"there is no provider {name!r}; the scenario has {', '.join(roster.provider_names)}")
    place, period_s = roster.provider_names.index(name), scenario.period_s
    duration_s = scenario.max_cycles * period_s
    source = open_frames(frames, duration_s=duration_s, period_s=period_s, loop=loop)
    strength = Perturbations(scenario, np.zeros(()))
    seller = _Seller(policy or Policy(), seed + place)
    cv2.setNumThreads(1)
    node = Node("cam", f"/{name}", network=network)
    images, bulletin = node.writer(f"/{name}{IMAGES}", messages.IMAGE), Bulletin(node, scenario.initial_trust)
    reviews = Reviews(node, name, roster.rater_names)
    with running() as on:
        for round in range(max(0, timeline.round(time.time_ns())), scenario.max_cycles):
            on.sleep_until(timeline.begin(round) - timeline.period // 2)  # a picture is ready when its moment comes
            bulletin.hear()
            true = source.frame(place, round * period_s, float(strength.strength(np.asarray(round))))
            quality = seller.quality(round, bulletin.top(name), *reviews.hear())
            shown = degrade(true, quality, (seed, place, round))
            done, jpeg = cv2.imencode(".jpg", shown[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])
            if not done:
                raise FramesError(f"a frame of {name} cannot be made a JPEG")
            on.sleep_until(timeline.begin(round))
            if not on:
                return
            images.write(messages.image_message(timeline.begin(round), name, jpeg))


class _Seller:
    """Chooses the quality of a provider's services, round by round."""

    def __init__(self, policy: Policy, seed: int) -> None:
        self._policy, self._random = policy, Random(np.random.default_rng(seed))
        self._memory = policy.begin(self._random, ())
        self._last = np.zeros(())

    def quality(self, round: int, trust: float, ratings: NDArray[np.float64], rated: NDArray[np.bool_]) -> float:
        """The quality of the service in a round, after these ratings of the last ones, (S,) each."""
        view = ProviderView(np.asarray(round), np.asarray(trust), np.ones(()), self._last, ratings, rated)
        quality, self._memory = self._policy.quality(view, self._memory, self._random)
        self._last = np.asarray(quality)
        return float(self._last)
