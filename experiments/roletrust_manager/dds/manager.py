"""The trust manager without middleware: from messages to rounds, and from rounds to trust."""

from collections.abc import Callable, Container
from pathlib import Path
from typing import Any

from roletrust_env.trust import TrustModel
from roletrust_manager.admission.validation import (
    Admission,
    Keyring,
    Membership,
    RatingMessage,
    keys_by_role,
)
from roletrust_manager.dds.rounds import MatchedRound, RoundAssembler, RoundTiming
from roletrust_manager.dds.team_trust import CountedRatings, TeamTrust
from roletrust_manager.dds.wire.messages import signed_message
from roletrust_manager.journal.lines import JournalEntry
from roletrust_manager.team import Team, Trust


class Manager:
    """Turns incoming ratings into trust, round by round.

    A round is in the journal before it is published. A manager that opens an existing journal
    continues after its last round, with the same trust to the last bit. With keys, the journal has
    the signed messages, too, see `check_journal`.

    Args:
        model: Trust model.
        journal: Path of the journal; the file is created if it does not exist.
        timing: How long to wait for a round.
        team: Agents that are expected from the start; newcomers are appended.
        keyring: Keys of the agents; None accepts every rater. The settings' raters may not serve,
            and its providers may not rate, unless they have both roles.
        report: Function that shows a line to the user, before a long replay.

    Attributes:
        admission: Refuses invalid ratings and counts them.
        rounds: Assembles messages into rounds and counts those that fit into none.
        known_raters: Raters that have a key or, without keys, a place in the team.

    Raises:
        ValueError: The model is not sound, the journal belongs to another manager, or replaying it
            gives other trust than it contains.
        OSError: The journal cannot be written.
    """

    def __init__(
        self,
        model: TrustModel[Any],
        journal: Path,
        *,
        timing: RoundTiming,
        team: Team | None = None,
        keyring: Keyring | None = None,
        report: Callable[[str], object] = lambda line: None,
    ) -> None:
        settings = team or Team()
        self._trust = TeamTrust(model, journal, timing.period, settings, report)
        rater_keys, provider_keys = keys_by_role(keyring, settings)
        raters, providers = self._trust.team.raters, self._trust.team.providers
        grows = self._trust.grows
        admitted = Membership(
            raters,
            timing.period,
            rater_keys if grows else (),
            len(set(raters) - set(settings.raters)),
        )
        strangers = len(set(providers) - set(settings.providers))
        self._providers = Membership(
            providers, timing.period, provider_keys if grows else (), strangers
        )
        self.admission = Admission(
            timing.limits, rater_keys, self._trust.last_stamps, admitted, settings.raters
        )
        self.known_raters: Container[str] = admitted if rater_keys is None else rater_keys
        self._has_keys = keyring is not None
        self.rounds: RoundAssembler[CountedRatings] = RoundAssembler(
            timing, raters, self._trust.last_stamp
        )

    @property
    def next_round(self) -> int:
        """Number of the next round."""
        return self._trust.next_round

    @property
    def trust(self) -> Trust | None:
        """Trust of the team after the last round; None before the first."""
        return self._trust.values

    def add_provider(self, provider: str, now: int) -> None:
        """Accept ratings of a provider from now on, if it may join.

        Args:
            provider: Name of the provider.
            now: Time, nanoseconds.
        """
        self._providers.admits(provider, now)

    def receive(
        self, message: RatingMessage, now: int, arrival: int | None = None
    ) -> list[JournalEntry]:
        """Take a message and return the rounds that it closes. They are in the journal by then.

        Args:
            message: Message.
            now: Time, nanoseconds, by the clock of the stamps.
            arrival: Time of arrival, nanoseconds, if the message has waited since then.
        """
        rater, stamp = message.envelope.sender, message.envelope.stamp
        accepted = self.admission.admit(
            message, self._providers, now if arrival is None else arrival
        ).ratings
        if not accepted:
            return []
        item = CountedRatings(accepted, signed_message(message.envelope) if self._has_keys else b"")
        return [self._close(closed, now) for closed in self.rounds.add(rater, stamp, item, now)]

    def tick(self, now: int) -> list[JournalEntry]:
        """Return the rounds whose deadline has passed. Call it often, about ten times a period."""
        return [self._close(closed, now) for closed in self.rounds.close_due(now)]

    def close(self) -> None:
        """Release the journal."""
        self._trust.close()

    def _close(self, closed: MatchedRound[CountedRatings], now: int) -> JournalEntry:
        return self._trust.close_round(closed, now, self.admission.last_stamps)
