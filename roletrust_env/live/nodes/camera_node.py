"""A provider: publishes the pictures of its camera, in the quality that its policy chooses."""

import time
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from roletrust_env.game.policy import Policy
from roletrust_env.game.views import ProviderView
from roletrust_env.live.message_validation import MANAGER
from roletrust_env.live.nodes.run_loop import Timeline, run_until_signal
from roletrust_env.live.nodes.signatures import signed_picture
from roletrust_env.live.nodes.subscriptions import RatingSubscription, TrustSubscription
from roletrust_env.live.nodes.topics import IMAGES
from roletrust_env.live.rounds import RoundTiming
from roletrust_env.live.wire import messages
from roletrust_env.live.wire.dds import Node
from roletrust_env.live.wire.keys import PublicKeys, Signer
from roletrust_env.randomness import Random
from roletrust_env.world.perturbation import Perturbations
from roletrust_env.world.roster import Roster
from roletrust_env.world.scenario import Scenario
from roletrust_env.world.vision import FramesError, degrade, open_frames

_JPEG_QUALITY = 95  # of 100; high enough not to change what the people detector finds


def run_camera_node(
    name: str,
    scenario: Scenario,
    *,
    timeline: Timeline,
    policy: Policy | None = None,
    frames: str | Path | int | None = None,
    loop: bool = False,
    keys: Path | None = None,
    seed: int = 0,
    network: bool = False,
) -> None:
    """Run a camera until the scenario ends or a signal ends the process.

    Args:
        name: Name of a provider of the scenario.
        scenario: Scenario, which sets the number of rounds and the disturbances.
        timeline: Start times of the rounds.
        policy: Policy that chooses the quality; None serves honestly. It sees its trust, and the ratings of it since
            its last service.
        frames: See `open_frames`.
        loop: See `open_frames`.
        keys: Folder with the camera's private key and all public keys; None neither signs nor checks signatures.
        seed: Random seed of the sensor noise of bad service and of the policy.
        network: See `Node`.

    Raises:
        ValueError: The scenario has no such provider, a key does not exist, or the frames do not exist (`FramesError`).
    """
    roster = Roster.of(scenario)
    if name not in roster.provider_names:
        raise ValueError(f"there is no provider {name!r}; the scenario has {', '.join(roster.provider_names)}")
    keyring, signer = (
        (None, None) if keys is None else (PublicKeys(keys, [MANAGER, *roster.rater_names]), Signer(keys, name))
    )
    place, period_s = roster.provider_names.index(name), scenario.period_s
    duration_s = scenario.max_cycles * period_s
    source = open_frames(frames, duration_s=duration_s, period_s=period_s, loop=loop)
    perturbations = Perturbations(scenario, np.zeros(()))
    selector = _QualitySelector(policy or Policy(), seed + place)
    cv2.setNumThreads(1)
    node = Node("cam", f"/{name}", network=network)
    images = node.writer(f"/{name}{IMAGES}", messages.IMAGE)
    trust = TrustSubscription(node, scenario.initial_trust, keyring)
    ratings = RatingSubscription(node, name, roster.rater_names, RoundTiming(timeline.period), keyring)
    with run_until_signal() as active:
        for round in range(max(0, timeline.round(time.time_ns())), scenario.max_cycles):
            active.sleep_until(timeline.begin(round) - timeline.period // 2)  # time to make the picture
            trust.update()
            frame = source.frame(place, round * period_s, float(perturbations.strength(np.asarray(round))))
            quality = selector.quality(round, trust.top(name), *ratings.take())
            picture = degrade(frame, quality, (seed, place, round))
            encoded, jpeg = cv2.imencode(".jpg", picture[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])
            if not encoded:
                raise FramesError(f"a frame of {name} cannot be encoded as JPEG")
            active.sleep_until(timeline.begin(round))
            if not active:
                return
            images.write(signed_picture(timeline.begin(round), name, jpeg.tobytes(), signer))


class _QualitySelector:
    """Chooses the quality of a provider's services with its policy, round by round."""

    def __init__(self, policy: Policy, seed: int) -> None:
        self._policy, self._random = policy, Random(np.random.default_rng(seed))
        self._memory = policy.begin(self._random, ())
        self._last = np.zeros(())

    def quality(self, round: int, trust: float, ratings: NDArray[np.float64], rated: NDArray[np.bool_]) -> float:
        """Return the quality of the service in a round, given the ratings of the last service, (S,) each."""
        view = ProviderView(np.asarray(round), np.asarray(trust), np.ones(()), self._last, ratings, rated)
        quality, self._memory = self._policy.quality(view, self._memory, self._random)
        self._last = np.asarray(quality)
        return float(self._last)
