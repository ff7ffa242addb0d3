"""The agents as processes: a provider publishes the pictures of its camera, and a rater rates those
of every camera.
"""

import math
import time
from collections.abc import Callable, Iterable
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from roletrust_env.game.policy import Policy
from roletrust_env.game.views import ProviderView, RaterView
from roletrust_env.randomness import Random, generator, own_seeds
from roletrust_env.world.scenario import Scenario
from roletrust_env.world.service import strength_in
from roletrust_env.world.vision.degrade import degrade
from roletrust_env.world.vision.frames import FramesError, open_frames
from roletrust_manager.admission import clock
from roletrust_manager.admission.keys import PublicKeys, Signer
from roletrust_manager.admission.validation import MANAGER
from roletrust_manager.dds.nodes.inboxes import (
    RatingSubscription,
    TrustSubscription,
    camera_inbox,
    trust_limits,
)
from roletrust_manager.dds.nodes.person_detector import PersonDetector, StrangePictures
from roletrust_manager.dds.nodes.publishers import DiagnosticsPublisher
from roletrust_manager.dds.nodes.run_loop import SECOND, Timeline, print_line, run_until_signal
from roletrust_manager.dds.rounds import MatchedRound, RoundAssembler, RoundTiming
from roletrust_manager.dds.wire import messages
from roletrust_manager.dds.wire.dds import Node
from roletrust_manager.dds.wire.topics import IMAGES, RATINGS
from roletrust_manager.team import Team

_JPEG_QUALITY = 95  # of 100; high enough not to change what the people detector finds
# of the period, for missing pictures: ratings must arrive before the manager closes the round
_DEADLINE = 0.4


def run_camera_node(
    name: str,
    scenario: Scenario,
    *,
    timeline: Timeline,
    policy: Policy | None = None,
    frames: str | Path | int | None = None,
    keys: Path | None = None,
    seed: int = 0,
    network: bool = False,
    report: Callable[[str], object] = print_line,
) -> None:
    """Run a camera until a signal ends the process.

    Args:
        name: Name of a provider of the scenario.
        scenario: Scenario, which sets the disturbances and the frames; its length does not matter.
        timeline: Start times of the rounds. A round that is over by half a period is left out.
        policy: Policy that chooses the quality; None serves honestly. It sees its trust, and the
            ratings of it since its last service.
        frames: See `open_frames`; None for those of the scenario. A video or a folder of images
            starts again at its end.
        keys: Folder with the camera's private key and all public keys; None neither signs nor
            checks signatures.
        seed: Random seed of the sensor noise of bad service and of the policy.
        network: See `Node`.
        report: Function that shows a line to the user.

    Raises:
        ValueError: The scenario has no such provider, a key does not exist, or the frames do not
            exist (`FramesError`).
    """
    team, period_s = Team.of(scenario), scenario.period_s
    index = _index("provider", name, team.providers)
    keyring, signer = _keys(keys, name, team.raters)
    frames = scenario.frames if frames is None else frames
    loop = isinstance(frames, str | Path) and Path(frames).exists()
    source = open_frames(frames, duration_s=math.inf, period_s=period_s, loop=loop, paced=False)
    selector = QualitySelector(
        policy or Policy(), own_seeds(seed, len(team.raters) + index + 1)[-1]
    )
    cv2.setNumThreads(1)
    node, timing = Node("cam", f"/{name}", network=network), RoundTiming(timeline.period)
    pictures = node.writer(f"/{name}{IMAGES}", messages.IMAGE)
    trust = TrustSubscription(node, scenario.initial_trust, keyring, trust_limits(timing))
    ratings = RatingSubscription(node, name, team.raters, timing, keyring)
    report(f"{name}: runs until Ctrl-C")
    with run_until_signal() as active:
        round = timeline.next_round()
        while active:
            active.sleep_until(
                timeline.begin(round) - timeline.period // 2
            )  # time to make the picture
            trust.update()
            frame = source.frame(
                index, round * period_s, strength_in(scenario.perturbations, round)
            )
            quality = selector.quality(round, trust.top(name), *ratings.take())
            picture = degrade(frame, quality, (seed, index, round))
            encoded, jpeg = cv2.imencode(
                ".jpg", picture[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY]
            )
            if not encoded:
                raise FramesError(f"a frame of {name} cannot be encoded as JPEG")
            active.sleep_until(timeline.begin(round))
            if active:
                pictures.write(
                    messages.picture_message(timeline.begin(round), name, jpeg.tobytes(), signer)
                )
            round = timeline.next_round(round)


def run_rater_node(
    name: str,
    scenario: Scenario,
    *,
    timeline: Timeline,
    policy: Policy | None = None,
    keys: Path | None = None,
    seed: int = 0,
    network: bool = False,
    report: Callable[[str], object] = print_line,
) -> None:
    """Run a rater until a signal ends the process.

    Args:
        name: Name of a rater of the scenario.
        scenario: Scenario, which names the agents.
        timeline: Start times of the rounds, from which policies know the number of the round.
        policy: Policy that chooses the ratings; None rates honestly. Providers outside the scenario
            are always rated honestly and, if they have no keys, now and then only, see
            `StrangePictures`.
        keys: Folder with the rater's private key and all public keys; None neither signs nor checks
            signatures.
        seed: Random seed of the noise on the rater's links and of the policy.
        network: See `Node`.
        report: Function that shows a line to the user.

    Raises:
        ValueError: The scenario has no such rater, or a key does not exist.
    """
    team = Team.of(scenario)
    index = _index("rater", name, team.raters)
    keyring, signer = _keys(keys, name, team.providers)
    cv2.setNumThreads(1)
    node, timing = (
        Node("assess", f"/{name}", network=network),
        RoundTiming(timeline.period, deadline=_DEADLINE),
    )
    publisher = node.writer(f"/{name}{RATINGS}", messages.RATINGS)
    trust = TrustSubscription(node, scenario.initial_trust, keyring, trust_limits(timing))
    selector = RatingSelector(
        name, team.providers, policy or Policy(), trust, own_seeds(seed, index + 1)[-1]
    )
    detector = PersonDetector(np.random.default_rng([seed, index]))
    cameras, strangers = (
        camera_inbox(node, timing, keyring, team),
        StrangePictures(detector, timing),
    )
    assembler: RoundAssembler[bytes] = RoundAssembler(
        timing, [provider for provider in team.providers if provider != name]
    )
    diagnostics = DiagnosticsPublisher(node, name, signer)

    def publish(closed: MatchedRound[bytes]) -> None:
        began = time.monotonic()
        perceived = {camera: detector.probability(jpeg) for camera, jpeg in closed.items.items()}
        perceived |= strangers.probabilities(closed.stamp, began)
        ratings = selector.ratings(timeline.round(closed.stamp), perceived)
        publisher.write(messages.ratings_message(name, closed.stamp, ratings, signer))

    report(f"{name}: runs until Ctrl-C")
    with run_until_signal() as active:
        while active:
            node.wait(timeline.period / SECOND / 20)
            trust.update()  # in each turn: the node does not wait while messages remain
            cameras.update(node.discover())
            closed = []
            for jpeg, (camera, stamp, *_) in cameras.take(clock.now()):
                if camera in cameras.known and camera != name:
                    closed += assembler.add(camera, stamp, jpeg, clock.now())
                elif camera != name:
                    strangers.add(camera, stamp, jpeg)
            closed += assembler.close_due(clock.now())
            if closed and active:  # a rater that is behind catches up: late ratings do not count
                publish(closed[-1])
            if diagnostics.is_due:
                diagnostics.publish({}, cameras.refusals + trust.inbox.admission.refusals)


class QualitySelector:
    """Chooses the quality of a provider's services with its policy, round by round."""

    def __init__(self, policy: Policy, seed: int) -> None:
        self._policy, self._random = policy, Random(generator(seed))
        self._memory = policy.begin(self._random, ())
        self._last = np.zeros(())

    def quality(
        self, round: int, trust: float, ratings: NDArray[np.float64], rated: NDArray[np.bool_]
    ) -> float:
        """Return the quality of the service in a round, given the ratings of the last service, (S,)
        each.
        """
        view = ProviderView(
            np.asarray(round), np.asarray(trust), np.ones(()), self._last, ratings, rated
        )
        quality, self._memory = self._policy.quality(view, self._memory, self._random)
        self._last = np.asarray(quality)
        return float(self._last)


class RatingSelector:
    """Chooses a rater's ratings with its policy, round by round.

    Args:
        name: Name of the rater.
        providers: Names of the scenario's providers.
        policy: Policy of the rater.
        trust: Published trust.
        seed: Random seed of the policy.
    """

    def __init__(
        self,
        name: str,
        providers: tuple[str, ...],
        policy: Policy,
        trust: TrustSubscription,
        seed: int,
    ) -> None:
        self._name, self._providers, self._policy, self._trust = name, providers, policy, trust
        self._random = Random(generator(seed))
        self._memory = policy.begin(self._random, ())
        self._last = np.zeros(len(providers)), np.zeros(len(providers), bool)

    def ratings(self, round: int, perceived: dict[str, float]) -> dict[str, float]:
        """Return the ratings of the services that the rater perceived in a round, by provider."""
        service = np.array([perceived.get(name, 0.0) for name in self._providers])
        awaiting = np.array([name in perceived for name in self._providers])
        trust = np.asarray(self._trust.tor(self._name))
        published = np.array([self._trust.top(name) for name in self._providers])
        rater_view = RaterView(
            np.asarray(max(round, 0)), trust, published, service, awaiting, *self._last
        )
        ratings, self._memory = self._policy.ratings(rater_view, self._memory, self._random)
        withheld, self._memory = self._policy.withholds(rater_view, self._memory, self._random)
        sent: NDArray[np.bool_] = awaiting if withheld is None else awaiting & ~withheld
        self._last = np.where(sent, ratings, 0), sent
        chosen = dict(
            zip(self._providers, zip(ratings.tolist(), sent.tolist(), strict=True), strict=True)
        )
        all_ratings = {name: chosen.get(name, (rating, True)) for name, rating in perceived.items()}
        return {name: rating for name, (rating, sends) in all_ratings.items() if sends}


def _index(role: str, name: str, names: tuple[str, ...]) -> int:
    """Return the index of an agent among those of its role.

    Raises:
        ValueError: There is no such agent.
    """
    if name not in names:
        raise ValueError(f"there is no {role} {name!r}; the scenario has {', '.join(names)}")
    return names.index(name)


def _keys(
    folder: Path | None, name: str, others: Iterable[str]
) -> tuple[PublicKeys | None, Signer | None]:
    """Return the public keys of the team, which must have the manager's and others, and the private
    key of an agent.
    """
    if folder is None:
        return None, None
    return PublicKeys(folder, [MANAGER, *others]), Signer(folder, name)
