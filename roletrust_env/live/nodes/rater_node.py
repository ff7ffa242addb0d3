"""A rater: looks at the pictures of every camera and publishes the ratings that its policy chooses."""

import time
from collections.abc import Container
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from roletrust_env.game.policy import Policy
from roletrust_env.game.views import RaterView
from roletrust_env.live.manager import keys_by_role
from roletrust_env.live.message_validation import MANAGER, Keyring
from roletrust_env.live.nodes.diagnostics import DiagnosticsPublisher
from roletrust_env.live.nodes.person_detector import PersonDetector, Strangers
from roletrust_env.live.nodes.picture_inbox import PictureInbox
from roletrust_env.live.nodes.run_loop import SECOND, Timeline, run_until_signal
from roletrust_env.live.nodes.signatures import sign
from roletrust_env.live.nodes.subscriptions import TrustSubscription
from roletrust_env.live.nodes.topics import RATINGS
from roletrust_env.live.rounds import Round, RoundAssembler, RoundTiming
from roletrust_env.live.trust_tracker import Team
from roletrust_env.live.wire import messages
from roletrust_env.live.wire.dds import Node
from roletrust_env.live.wire.keys import PublicKeys, Signer
from roletrust_env.randomness import Random
from roletrust_env.world.roster import Roster
from roletrust_env.world.scenario import Scenario

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
            honestly and, if they have no keys, now and then only, see `Strangers`.
        keys: Folder with the rater's private key and all public keys; None neither signs nor checks signatures.
        seed: Random seed of the noise on the rater's links and of the policy.
        network: See `Node`.

    Raises:
        ValueError: The scenario has no such rater, or a key does not exist.
    """
    roster = Roster.of(scenario)
    if name not in roster.rater_names:
        raise ValueError(f"there is no rater {name!r}; the scenario has {', '.join(roster.rater_names)}")
    team = Team(roster.rater_names, roster.provider_names)
    keyring, signer = (
        (None, None) if keys is None else (PublicKeys(keys, [MANAGER, *team.providers]), Signer(keys, name))
    )
    cv2.setNumThreads(1)
    node = Node("assess", f"/{name}", network=network)
    publisher, trust = (
        node.writer(f"/{name}{RATINGS}", messages.RATINGS),
        TrustSubscription(node, scenario.initial_trust, keyring),
    )
    place = team.raters.index(name)
    selector = _RatingSelector(name, team.providers, policy or Policy(), trust, seed + place)
    detector = PersonDetector(np.random.default_rng([seed, place]))
    timing = RoundTiming(timeline.period, deadline=_DEADLINE)
    cameras, strangers = PictureInbox(node, timing, *_known_cameras(keyring, team)), Strangers(detector, timing)
    rounds: RoundAssembler[bytes] = RoundAssembler(timing)
    diagnostics = DiagnosticsPublisher(node, name, signer)

    def publish(closed: Round[bytes]) -> None:
        began = time.monotonic()
        perceived = {camera: detector.probability(jpeg) for camera, jpeg in closed.items.items()}
        perceived |= strangers.look(closed.stamp, began)
        ratings = selector.ratings(timeline.round(closed.stamp), perceived)
        publisher.write(sign(messages.ratings_message(name, closed.stamp, ratings), signer))

    with run_until_signal() as active:
        while active:
            node.wait(timeline.period / SECOND / 20)
            trust.update()  # in each turn: the node does not wait while messages are left
            cameras.update(node.discover())
            closed = []
            for camera, jpeg, envelope in cameras.take(time.time_ns()):
                if camera in cameras.known and camera != name:
                    closed += rounds.add(camera, envelope.stamp, jpeg, time.time_ns())
                elif camera != name:
                    strangers.add(camera, envelope.stamp, jpeg)
            closed += rounds.close_due(time.time_ns())
            for newest in closed[-1:]:  # a rater that is behind catches up: late ratings do not count
                publish(newest)
            if diagnostics.is_due:
                diagnostics.publish({}, cameras.validator.refusals + trust.inbox.validator.refusals)


def _known_cameras(keyring: Keyring | None, team: Team) -> tuple[Keyring | None, Container[str]]:
    """Return the keys of those that may serve, and the cameras whose pictures belong to a round."""
    _, serving = keys_by_role(keyring, team)
    return serving, team.providers if serving is None else serving


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
