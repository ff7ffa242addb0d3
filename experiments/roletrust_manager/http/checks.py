"""Checks of the requests to a trust manager: cheap ones first, and as many as need no turn."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey

from roletrust_manager.admission.keys import KnownKeys
from roletrust_manager.admission.validation import (
    RefusalReason,
    following,
    is_genuine,
    rating_error,
)
from roletrust_manager.http.members import Members, digest_of
from roletrust_manager.http.requests import (
    Checked,
    RefusedError,
    Request,
    Settings,
    Signed,
    refusal,
    registered_key,
)
from roletrust_manager.http.tokens import (
    Rating,
    Registration,
    Rotation,
    has_proofs,
    has_work,
    key_as_text,
    read_token,
)


class RequestChecks(NamedTuple):
    """Checks of requests. Any thread may use them.

    Attributes:
        name: Name of the manager.
        settings: Its settings.
        members: Agents that have registered.
        clock: Function that returns the time, seconds since 1970.
        sent: Function that returns the number of ratings of an agent in the running round.
    """

    name: str
    settings: Settings
    members: Members
    clock: Callable[[], float]
    sent: Callable[[str], int]

    def check(self, request: Request) -> Checked:
        """Return a request whose tokens were checked as far as they can be without a turn, the
        cheap checks first. Any thread may call it.

        Raises:
            RefusedError: The request is refused, which is counted.
        """
        try:
            return self._checked(request)
        except RefusedError as refused:
            self.members.admission.refuse(refused.sender, refused.reason)
            raise

    def _checked(self, request: Request) -> Checked:
        members, last = self.members, len(request.tokens) - 1
        newest = self._read(request, last)
        name, digest = newest.claims.iss, digest_of(request.tokens)
        before = members.latest.get(name)
        if before is not None and before.digest == digest:
            return Checked(name, digest)
        if isinstance(newest.claims, Registration):
            self.check_registration(newest)
            return Checked(name, digest, None, (newest,))
        key = members.keys.get(name)
        if name not in members.by_name or key is None:
            raise refusal(RefusalReason.UNKNOWN, newest.claims, last, "register it first")
        self._check_time(newest, last)
        signed = [*(self._read(request, at, name) for at in range(last)), newest]
        self.check_order(signed)
        for at, token in enumerate(signed):
            self._check_signature(token, at, key)
        return Checked(name, digest, key, tuple(signed))

    def _read(self, request: Request, at: int, name: str | None = None) -> Signed:
        """Return a token of a request with its claims.

        Raises:
            RefusedError: It is no such token, or is for another manager or of another agent.
        """
        try:
            signed = Signed(request.tokens[at], *read_token(request.tokens[at], request.kind))
        except ValueError as error:
            raise RefusedError(RefusalReason.GARBAGE, str(error), at) from None
        claims, name = signed.claims, name or request.name
        if claims.aud != self.name:
            hint = f"this is {self.name}, where agents register first"
            raise refusal(RefusalReason.ELSEWHERE, claims, at, hint)
        if name not in (None, claims.iss):
            raise refusal(RefusalReason.ELSEWHERE, claims, at, f"the request is of {name}")
        return signed

    def _check_time(self, signed: Signed, at: int) -> None:
        """Check when a token was signed.

        Raises:
            RefusedError: Too early or too late, or not after the last one of its agent.
        """
        now, claims = self.clock(), signed.claims
        reason = self.members.admission.stamp_error(signed.envelope, round(now * 1e9))
        if claims.nbf is not None and claims.nbf > now + self.settings.tolerance:
            reason = RefusalReason.FUTURE
        elif claims.exp is not None and claims.exp <= now:
            reason = RefusalReason.PAST
        if reason:
            raise refusal(reason, signed.claims, at, f"the clock here says {now:.3f}")

    def check_order(self, signed: Sequence[Signed]) -> None:
        """Check the times and the contents of tokens of a member, all of one kind.

        Raises:
            RefusedError: One is not valid.
        """
        rated, (worst, best) = set[str](), self.settings.scale
        sent, last = self.sent(signed[0].claims.iss), None
        for at, token in enumerate(signed):
            claims = token.claims
            self._check_time(token, at)
            last = following(last, token.envelope)
            if last is None:
                raise refusal(RefusalReason.REPLAYED, claims, at, "sign one after the other")
            if isinstance(claims, Rotation):
                registered_key(claims)
                if not has_proofs(claims, self.members.recovery.get(claims.iss)):
                    hint = "sign it with the new key, and with the recovery key if there is one"
                    raise refusal(RefusalReason.MIS_SIGNED, claims, at, hint)
            if not isinstance(claims, Rating):
                continue
            if reason := rating_error(
                claims.iss,
                claims.sub,
                claims.rating,
                self.members.by_name,
                rated,
                self.settings.scale,
            ):
                hint = f"it is {claims.rating} of {claims.sub}, from {worst:g} to {best:g}"
                raise refusal(reason, claims, at, hint)
            if sent + at >= self.settings.quota:
                hint = f"{self.settings.quota:,} ratings in a round are allowed"
                raise refusal(RefusalReason.FLOOD, claims, at, hint)
            rated.add(claims.sub)

    def _check_signature(self, signed: Signed, at: int, key: Ed25519PublicKey) -> None:
        """Check that a token was signed with a key.

        Raises:
            RefusedError: By nobody, or by another than its agent.
        """
        if not signed.envelope.signature:
            raise refusal(RefusalReason.UNSIGNED, signed.claims, at, "sign it")
        if not is_genuine(signed.envelope, KnownKeys({signed.claims.iss: key})):
            raise refusal(RefusalReason.MIS_SIGNED, signed.claims, at, "sign it with that key")

    def check_registration(self, signed: Signed) -> None:
        """Check a registration, but for the number of newcomers.

        Raises:
            RefusedError: It is not valid.
        """
        claims, known = signed.claims, self.members.keys.get(signed.claims.iss)
        if known is not None and claims.key != key_as_text(known):
            raise refusal(RefusalReason.TAKEN, claims, 0, "choose another one")
        recovery = self.members.recovery.get(claims.iss)
        own = None if recovery is None else key_as_text(recovery)
        if known is not None and claims.recovery not in (None, own):
            hint = "its first registration had another recovery key, or none"
            raise refusal(RefusalReason.TAKEN, claims, 0, hint)
        if claims.iss not in self.members.by_name:
            if not has_work(claims, self.settings.work):
                hint = f"it costs {self.settings.work} bits here"
                raise refusal(RefusalReason.NO_WORK, claims, 0, hint)
            self._check_time(signed, 0)
        self._check_signature(signed, 0, registered_key(claims))
