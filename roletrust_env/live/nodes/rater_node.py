"""A rater: looks at the pictures of every camera and publishes the ratings that its policy chooses."""

import time
from collections.abc import Iterable, Iterator
from contextlib import suppress
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from roletrust_env.game.policy import Policy
from roletrust_env.game.views import RaterView
from roletrust_env.live.nodes.run_loop import SECOND, Timeline, run_until_signal
from roletrust_env.live.nodes.subscriptions import TrustSubscription
from roletrust_env.live.nodes.topics import IMAGES, RATINGS, owner
from roletrust_env.live.rounds import Round, RoundAssembler, RoundTiming
from roletrust_env.live.wire import messages
from roletrust_env.live.wire.dds import Node, Reader
from roletrust_env.live.wire.keys import Signer
from roletrust_env.randomness import Random
from roletrust_env.world.roster import Roster
from roletrust_env.world.scenario import Scenario
from roletrust_env.world.vision import best_margin, probability, view
from roletrust_env.world.vision.degrade import transmit

_DEADLINE = 0.4  # of the period, for missing pictures: ratings must arrive before the manager closes the round


def run_rater_node(
    name: str,
    scenario: Scenario,
    *,
    timeline: Timeline,
    policy: Policy | None = None,
    keys: Path | None = None,
    seed: int = 0,
    network: bool = False,
) -> None:
    """Run a rater until a signal ends the process.

    Args:
        name: Name of a rater of the scenario.
        scenario: Scenario, which names the agents.
        timeline: Start times of the rounds, from which policies know the number of the round.
        policy: Policy that chooses the ratings; None rates honestly. Providers outside the scenario are always rated
            honestly.
        keys: Folder with the rater's private key; None does not sign.
        seed: Random seed of the noise on the rater's links and of the policy.
        network: See `Node`.

    Raises:
        ValueError: The scenario has no such rater, or the key does not exist.
    """
    roster = Roster.of(scenario)
    if name not in roster.rater_names:
        raise ValueError(f"there is no rater {name!r}; the scenario has {', '.join(roster.rater_names)}")
    signer = None if keys is None else Signer(keys, name)
    cv2.setNumThreads(1)
    node = Node("assess", f"/{name}", network=network)
    publisher, trust = (
        node.writer(f"/{name}{RATINGS}", messages.RATINGS),
        TrustSubscription(node, scenario.initial_trust),
    )
    place = roster.rater_names.index(name)
    selector = _RatingSelector(name, roster.provider_names, policy or Policy(), trust, seed + place)
    detector = _PersonDetector(np.random.default_rng([seed, place]))
    cameras: dict[str, Reader] = {}
    timing = RoundTiming(timeline.period, deadline=_DEADLINE)
    rounds: RoundAssembler[bytes] = RoundAssembler(timing)

    def publish(closed: Round[bytes]) -> None:
        trust.update()
        perceived = {camera: detector.probability(jpeg) for camera, jpeg in closed.items.items()}
        ratings = selector.ratings(timeline.round(closed.stamp), perceived)
        unsigned = messages.ratings_message(name, closed.stamp, ratings)
        signature = b"" if signer is None else signer.sign(messages.encode(unsigned))
        publisher.write(messages.ratings_message(name, closed.stamp, ratings, signature))

    with run_until_signal() as active:
        while active:
            node.wait(timeline.period / SECOND / 20)
            for publication in node.discover():
                camera = owner(publication.topic, IMAGES)
                if camera is not None and camera not in (name, *cameras):
                    cameras[camera] = node.reader(publication.topic, messages.IMAGE)
            closed = []
            for camera, reader in cameras.items():
                for stamp, jpeg in _pictures(reader.take(), time.time_ns(), timing.tolerance):
                    closed += rounds.add(camera, stamp, jpeg, time.time_ns())
            closed += rounds.close_due(time.time_ns())
            for newest in closed[-1:]:  # a rater that is behind catches up: late ratings do not count
                publish(newest)


def _pictures(raws: Iterable[bytes], now: int, tolerance: int) -> Iterator[tuple[int, bytes]]:
    """Iterate over the stamps and JPEGs of messages, without unreadable ones and those with a stamp far from now.

    A stamp from the future would close all rounds before it.
    """
    for raw in raws:
        with suppress(ValueError):
            image = messages.decode(raw, messages.IMAGE)
            if abs(messages.stamp_of(image) - now) <= tolerance:
                yield messages.stamp_of(image), bytes(image.data)


class _PersonDetector:
    """Detects people in pictures, each of which arrives with the noise of its link."""

    def __init__(self, links: np.random.Generator) -> None:
        self._links = links

    def probability(self, jpeg: bytes) -> float:
        """Return the probability that a picture shows a person; 0 if it cannot be decoded."""
        try:
            picture = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR)
            features = None if picture is None else view(np.ascontiguousarray(picture[..., ::-1], np.uint8))
        except cv2.error:  # empty, or of a shape that no camera has
            features = None
        if features is None:
            return 0.0
        return probability(best_margin(transmit(features, float(self._links.standard_normal()))))


class _RatingSelector:
    """Chooses a rater's ratings with its policy, round by round."""

    def __init__(
        self, name: str, providers: tuple[str, ...], policy: Policy, trust: TrustSubscription, seed: int
    ) -> None:
        self._name, self._providers, self._policy, self._trust = name, providers, policy, trust
        self._random = Random(np.random.default_rng(seed))
        self._memory = policy.begin(self._random, ())
        self._last = np.zeros(len(providers)), np.zeros(len(providers), bool)

    def ratings(self, round: int, perceived: dict[str, float]) -> dict[str, float]:
        """Return the ratings of the services that the rater perceived in a round, by provider."""
        service = np.array([perceived.get(name, 0.0) for name in self._providers])
        awaiting = np.array([name in perceived for name in self._providers])
        trust = np.asarray(self._trust.tor(self._name))
        published = np.array([self._trust.top(name) for name in self._providers])
        rater_view = RaterView(np.asarray(max(round, 0)), trust, published, service, awaiting, *self._last)
        ratings, self._memory = self._policy.ratings(rater_view, self._memory, self._random)
        withheld, self._memory = self._policy.withholds(rater_view, self._memory, self._random)
        sent: NDArray[np.bool_] = awaiting if withheld is None else awaiting & ~withheld
        self._last = np.where(sent, ratings, 0), sent
        chosen = dict(zip(self._providers, zip(ratings.tolist(), sent.tolist(), strict=True), strict=True))
        all_ratings = {name: chosen.get(name, (rating, True)) for name, rating in perceived.items()}
        return {name: rating for name, (rating, sends) in all_ratings.items() if sends}
