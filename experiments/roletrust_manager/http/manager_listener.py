"""The listener of the live page to a trust manager: trust of the agents, and refusals."""

import json
import threading
import time
from collections import Counter, deque
from collections.abc import Mapping
from contextlib import suppress

import httpx2

from roletrust_manager.admission.validation import MANAGER, RefusalReason
from roletrust_manager.http.client import TrustClient
from roletrust_manager.team import PublishedTrust

_ROUNDS, _AGENTS = 600, 50  # that are shown
_QUIET_S = 15.0  # a manager without news says so after that time
_PAUSE_S, _PATIENCE_S = 1.0, 5.0  # before another try to reach a manager, and for an answer


class ManagerListener:
    """Listens to the rounds of a trust manager in a thread, as `TeamListener` to those of a team.

    It shows the agents that are the best providers. A rater is missing in a round in which it has
    not rated.

    Args:
        url: Address of the manager.

    Attributes:
        period_s: Time after which a manager that is there has said something, seconds.
        rounds: Last rounds, the newest last.
        last_heard: Time of the last news of the manager, and of its agents, monotonic seconds.
        reports: Refusals by the manager.
        pictures: None.
        refusals: None.

    Raises:
        ValueError: The address is not valid, or there is something else.
        UnreachableError: There is no answer.
    """

    def __init__(self, url: str) -> None:
        self._client, self._active = TrustClient(url, patience_s=_PATIENCE_S), True
        self.period_s = max(self._client.about().every, _QUIET_S)
        self.rounds: deque[PublishedTrust] = deque(maxlen=_ROUNDS)
        self.last_heard: dict[str, float] = {}
        self.reports: dict[str, dict[str, str]] = {}
        self.pictures: dict[str, bytes] = {}
        self.refusals: Mapping[tuple[str, RefusalReason], int] = {}
        self._given: Counter[str] = Counter()  # ratings of each rater
        threading.Thread(target=self._listen, daemon=True).start()

    def close(self) -> None:
        """Stop listening."""
        self._active = False

    def _listen(self) -> None:
        while self._active:
            with suppress(
                httpx2.HTTPError, OSError, ValueError
            ):  # the page shows that it is silent
                self._follow()
            time.sleep(_PAUSE_S)
        self._client.close()

    def _follow(self) -> None:
        """Follow the rounds as long as the manager tells of them."""
        with httpx2.stream("GET", f"{self._client.url}/events", timeout=2 * _QUIET_S) as response:
            about = self._client.about()
            if about.rounds:
                self._publish(about.rounds, about.time)
            for line in response.iter_lines():
                if line.startswith("data:"):
                    end = json.loads(line.removeprefix("data:"))
                    self._publish(int(end["round"]), float(end["time"]))
                self.last_heard |= dict.fromkeys([MANAGER, *self.last_heard], time.monotonic())
                if not self._active:
                    return

    def _publish(self, number: int, ended: float) -> None:
        """Take the trust of now as that after a round, unless it is known: a new connection tells
        of it again.
        """
        if self.rounds and self.rounds[-1].round == number:
            return
        agents, refused = (
            self._client.agents(limit=_AGENTS).agents,
            self._client.refusals().refusals,
        )
        raters = {
            agent.name: agent.rater for agent in agents if agent.rater and agent.rater.ratings
        }
        given = Counter({name: rater.ratings for name, rater in raters.items()})
        tor = {name: rater.trust for name, rater in raters.items()}
        top = {agent.name: agent.provider.trust for agent in agents if agent.provider.ratings}
        missing = tuple(name for name in tor if given[name] == self._given[name])
        self._given = given
        self.reports = {
            MANAGER: {f"agents: {reason}": str(count) for reason, count in refused.items()}
        }
        self.last_heard = dict.fromkeys([MANAGER, *tor], time.monotonic())
        self.rounds.append(PublishedTrust(number, round(ended * 1e9), tor, top, missing))
