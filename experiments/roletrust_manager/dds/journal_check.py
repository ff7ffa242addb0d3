"""Check of a journal by others than its manager, with the public keys of the team."""

from collections.abc import Callable
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

from roletrust_env.trust import TrustModel
from roletrust_manager.admission.validation import (
    MANAGER,
    Keyring,
    KeysOfOthers,
    RatingMessage,
    is_genuine,
    rating_error,
)
from roletrust_manager.dds.team_run import grows
from roletrust_manager.dds.team_trust import replay_rounds
from roletrust_manager.dds.wire.messages import read_ratings_message, signed_message
from roletrust_manager.journal.lines import JournalEntry, read_journal, read_settings
from roletrust_manager.team import Team, Trust

_REPORT_ROUNDS = 10_000  # rounds between two lines about the progress


class CheckedJournal(NamedTuple):
    """The content of a journal that was checked.

    Attributes:
        rounds: Number of rounds.
        messages: Number of signed messages that were verified.
        team: Agents of the team after the last round.
        trust: Trust after the last round.
    """

    rounds: int
    messages: int
    team: Team
    trust: Trust


def check_journal(
    path: Path,
    keys: Keyring,
    model: TrustModel[Any],
    report: Callable[[str], object] = lambda line: None,
) -> CheckedJournal:
    """Check that raters have signed all ratings of a journal, and that its trust follows from them.

    The messages of all rounds are checked first, and then the trust after each round. A manager may
    write to the journal meanwhile; rounds that are written later are not checked.

    The stamps of a rater must rise from round to round, without exception. A clock that goes back
    does not change this: a manager with keys refuses messages until the clock has caught up.

    A manager that leaves out ratings, or whole rounds at the end, cannot be found in this way. The
    fields `stamp`, `closed` and `missing` of a round are not checked either.

    Args:
        path: Path of the journal.
        keys: Public keys of the team.
        model: Trust model of the journal.
        report: Function that shows a line about the progress to the user.

    Raises:
        ValueError: The journal fails a check, belongs to another trust model, or has no rounds or
            no signed messages.
        OSError: The journal cannot be read.
    """
    if (stored := read_settings(path).get("trust_model")) != repr(model):
        raise ValueError(f"{path}: trust_model must be {model!r}, got {stored!r}")
    messages = _MessageCheck(path, KeysOfOthers(keys, [MANAGER]))
    ends: dict[Team, int] = {}
    for entry in read_journal(path):
        messages.check(entry)
        ends[entry.team] = entry.round + 1
        if entry.round % _REPORT_ROUNDS == _REPORT_ROUNDS - 1:
            report(f"{path}: the messages of {entry.round + 1} rounds are verified")
    if not ends:
        raise ValueError(f"{path} has no rounds")
    rounds = entry.round + 1
    report(f"{path}: {rounds} rounds are replayed")
    # a model whose state cannot grow begins anew with each team
    replays = [(None, rounds)] if grows(model) else ends.items()
    for team, end in replays:
        replay_rounds(model, islice(read_journal(path), end), team, path)
    return CheckedJournal(rounds, messages.verified, entry.team, entry.trust)


class _MessageCheck:
    """Checks the signed messages of a journal, round by round.

    Args:
        path: Path of the journal, for the errors.
        keys: Public keys of the raters.

    Attributes:
        verified: Number of verified messages.
    """

    def __init__(self, path: Path, keys: Keyring) -> None:
        self._path, self._keys = path, keys
        self._team = Team()
        self._stamps: dict[str, int] = {}
        self.verified = 0

    def check(self, entry: JournalEntry) -> None:
        """Check the next round.

        Raises:
            ValueError: A message or a rating fails a check.
        """
        where = f"{self._path}: round {entry.round}"
        if entry.team != self._team.with_newcomers(entry.team.raters, entry.team.providers):
            raise ValueError(f"{where} must keep the agents of {self._team}, got {entry.team}")
        self._team = entry.team
        if not entry.signed:
            raise ValueError(
                f"{where} has no signed messages; a manager with --keys writes them to its journal"
            )
        if others := sorted(set(entry.ratings) ^ set(entry.signed)):
            side = "ratings" if others[0] in entry.ratings else "a signed message"
            raise ValueError(
                f"{where}: each rater must have ratings and a signed message, got only {side} of "
                f"{others[0]!r}"
            )
        for rater, raw in entry.signed.items():
            try:
                message = self._verify(rater, raw)
                _check_ratings(entry, rater, message)
            except ValueError as error:
                raise ValueError(f"{where}, rater {rater!r}: {error}") from None

    def _verify(self, rater: str, raw: bytes) -> RatingMessage:
        """Return a message that its rater has signed after the one before."""
        message = read_ratings_message(raw)
        envelope = message.envelope
        if envelope.sender != rater:
            raise ValueError(f"the signed message must be of this rater, got {envelope.sender!r}")
        if rater not in self._keys:
            raise ValueError("this rater has no public key")
        if not is_genuine(envelope, self._keys) or signed_message(envelope) != raw:
            raise ValueError(
                f"the signature {envelope.signature.hex()!r} is not valid for the message"
            )
        last = self._stamps.get(rater)
        if last is not None and envelope.stamp <= last:
            raise ValueError(f"the stamp must be later than {last}, got {envelope.stamp}")
        self._stamps[rater] = envelope.stamp
        self.verified += 1
        return message


def _check_ratings(entry: JournalEntry, rater: str, message: RatingMessage) -> None:
    """Check that a signed message has the ratings of a rater that count in a round.

    The message may have more ratings, since a manager refuses single ones.

    Raises:
        ValueError: A rating is not one of the message.
    """
    providers, valid = entry.team.providers, dict[str, float]()
    for provider, value in zip(message.providers, message.values, strict=True):
        if rating_error(rater, provider, value, providers, valid) is None:
            valid[provider] = value
    for provider, rating in zip(providers, entry.ratings[rater], strict=False):
        if rating is not None and rating != valid.get(provider):
            raise ValueError(
                f"the rating of {provider!r} must be that of the signed message, "
                f"{valid.get(provider)}, got {rating}"
            )
