"""A rater: looks at every camera it hears, and says what it saw, or what its policy will have it say."""

import time
from collections.abc import Iterable, Iterator
from contextlib import suppress
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from roletrust_env.game.policy import Policy
from roletrust_env.game.views import RaterView
from roletrust_env.live.nodes.running import SECOND, Bulletin, Timeline, running
from roletrust_env.live.nodes.topics import IMAGES, RATINGS, owner
from roletrust_env.live.rounds import Patience, Round, Rounds
from roletrust_env.live.wire import messages
from roletrust_env.live.wire.dds import Node, Reader
from roletrust_env.live.wire.keys import Signer
from roletrust_env.randomness import Random
from roletrust_env.world.roster import Roster
from roletrust_env.world.scenario import Scenario
from roletrust_env.world.vision import best_margin, probability, view
from roletrust_env.world.vision.degrade import transmit

_DEADLINE = 0.4  # of the period, for cameras that bring no picture: raters must be heard before the manager closes


def run_assess(
    name: str,
    scenario: Scenario,
    *,
    timeline: Timeline,
    policy: Policy | None = None,
    keys: Path | None = None,
    seed: int = 0,
    network: bool = False,
) -> None:
    """Be a rater until it is told to stop.

    Args:
        name: of the rater, one of the scenario's.
        scenario: who is in it.
        timeline: when rounds begin, by which policies know what round it is.
        policy: how it rates; None rates what it sees. Providers that are not in the scenario are rated honestly.
        keys: a folder with its private key; None does not sign.
        seed: of the noise on its links, and of policies that play at random.
        network: see `Node`.

    Raises:
        ValueError: the scenario has no such rater, or there is no such key.
    """
    roster = Roster.of(scenario)
    if name not in roster.rater_names:
        raise ValueError(f"there is no rater {name!r}; the scenario has {', '.join(roster.rater_names)}")
    signer = None if keys is None else Signer(keys, name)
    cv2.setNumThreads(1)
    node = Node("assess", f"/{name}", network=network)
    voice, bulletin = node.writer(f"/{name}{RATINGS}", messages.RATINGS), Bulletin(node, scenario.initial_trust)
    place = roster.rater_names.index(name)
    critic = _Critic(name, roster.provider_names, policy or Policy(), bulletin, seed + place)
    eye = _Eye(np.random.default_rng([seed, place]))
    cameras: dict[str, Reader] = {}
    patience = Patience(timeline.period, deadline=_DEADLINE)
    rounds: Rounds[bytes] = Rounds(patience)

    def say(closed: Round[bytes]) -> None:
        bulletin.hear()
        seen = {camera: eye.sees(jpeg) for camera, jpeg in closed.items.items()}
        ratings = critic.ratings(timeline.round(closed.stamp), seen)
        unsigned = messages.ratings_message(name, closed.stamp, ratings)
        signature = b"" if signer is None else signer.sign(messages.encode(unsigned))
        voice.write(messages.ratings_message(name, closed.stamp, ratings, signature))

    with running() as on:
        while on:
            node.wait(timeline.period / SECOND / 20)
            for found in node.discover():
                camera = owner(found.topic, IMAGES)
                if camera is not None and camera not in (name, *cameras):
                    cameras[camera] = node.reader(found.topic, messages.IMAGE)
            closed = []
            for camera, reader in cameras.items():
                for stamp, jpeg in _pictures(reader.take(), time.time_ns(), patience.tolerance):
                    closed += rounds.add(camera, stamp, jpeg, time.time_ns())
            closed += rounds.due(time.time_ns())
            for newest in closed[-1:]:  # who is behind catches up: ratings of the past count nothing
                say(newest)


def _pictures(raws: Iterable[bytes], now: int, tolerance: int) -> Iterator[tuple[int, bytes]]:
    """The stamps and JPEGs of messages; none of what cannot be read, nor of what would end rounds yet to come."""
    for raw in raws:
        with suppress(ValueError):
            image = messages.decode(raw, messages.IMAGE)
            if abs(messages.stamp_of(image) - now) <= tolerance:
                yield messages.stamp_of(image), bytes(image.data)


class _Eye:
    """Sees people in pictures, each as it comes over a link of its own."""

    def __init__(self, links: np.random.Generator) -> None:
        self._links = links

    def sees(self, jpeg: bytes) -> float:
        """The probability that a person is in a picture; 0 of what is no picture."""
        try:
            picture = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR)
            seen = None if picture is None else view(np.ascontiguousarray(picture[..., ::-1], np.uint8))
        except cv2.error:  # it is empty, or has a shape that no camera's has
            seen = None
        if seen is None:
            return 0.0
        return probability(best_margin(transmit(seen, float(self._links.standard_normal()))))


class _Critic:
    """Chooses a rater's ratings, round by round."""

    def __init__(self, name: str, providers: tuple[str, ...], policy: Policy, bulletin: Bulletin, seed: int) -> None:
        self._name, self._providers, self._policy, self._bulletin = name, providers, policy, bulletin
        self._random = Random(np.random.default_rng(seed))
        self._memory = policy.begin(self._random, ())
        self._last = np.zeros(len(providers)), np.zeros(len(providers), bool)

    def ratings(self, round: int, seen: dict[str, float]) -> dict[str, float]:
        """What it says of the services that it saw in a round."""
        service = np.array([seen.get(name, 0.0) for name in self._providers])
        awaiting = np.array([name in seen for name in self._providers])
        trust = np.asarray(self._bulletin.tor(self._name))
        published = np.array([self._bulletin.top(name) for name in self._providers])
        sight = RaterView(np.asarray(max(round, 0)), trust, published, service, awaiting, *self._last)
        notes, self._memory = self._policy.ratings(sight, self._memory, self._random)
        withheld, self._memory = self._policy.withholds(sight, self._memory, self._random)
        sent: NDArray[np.bool_] = awaiting if withheld is None else awaiting & ~withheld
        self._last = np.where(sent, notes, 0), sent
        known = dict(zip(self._providers, zip(notes.tolist(), sent.tolist(), strict=True), strict=True))
        said = {name: known.get(name, (rating, True)) for name, rating in seen.items()}
        return {name: rating for name, (rating, sends) in said.items() if sends}
