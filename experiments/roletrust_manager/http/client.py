"""Client of the trust manager: an agent that registers, rates, asks and leaves."""

import re
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from threading import Lock
from typing import Any, Self, TypeVar

import httpx2
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey, Ed25519PublicKey
from pydantic import BaseModel, ValidationError

from roletrust_env.errors import printable, short, validation_message
from roletrust_env.storage.files import replacing
from roletrust_manager.admission.keys import Signer, check_name, make_keys
from roletrust_manager.admission.validation import RefusalReason
from roletrust_manager.http.answers import (
    About,
    Agent,
    Agents,
    Problem,
    Refusals,
    TokenReceipt,
    TokenReceipts,
)
from roletrust_manager.http.tokens import (
    Claims,
    Leave,
    Rating,
    Registration,
    Rotation,
    key_as_text,
    sign_token,
    with_proofs,
    with_work,
)

MAX_WORK = 24
"""Zero bits of the largest proof of work that a client does, on average within half a minute."""

_PAUSE_S, _LONGEST_PAUSE_S = 0.1, 2.0  # before the same request is sent again
_RESTARTS = (
    502,
    503,
    504,
)  # statuses of a manager that restarts or cannot store, and of what stands in front of it
_SIGNATURES = 3  # of one request, where another process with the same key is quicker
Answer = TypeVar("Answer", bound=BaseModel)


class RefusalError(ValueError):
    """Refusal by the manager: nothing of the request counts.

    Attributes:
        reason: Reason in a few words, such as those of `RefusalReason`.
        status: Status of HTTP.
        at: Place of the refused rating in the request; None if it is about all.
        wait_s: Time after which the manager would look at it again, seconds; None if it does not
            say.
    """

    def __init__(self, problem: Problem, status: int, wait_s: float | None = None) -> None:
        super().__init__(printable(f"{problem.reason}: {problem.detail}"))
        self.reason, self.at, self.status, self.wait_s = problem.reason, problem.at, status, wait_s


class UnreachableError(ConnectionError):
    """No answer by a manager: it is not there, or not in time.

    A rating may have arrived. The next call with the same arguments sends the same tokens, which
    count once.
    """


@dataclass
class _Letter:
    """A signed request without an answer.

    Attributes:
        asked: Kind and contents of its tokens.
        body: Body of the request.
        deliveries: Number of times that it was sent.
    """

    asked: tuple[type[Claims], list[dict[str, Any]]]
    body: dict[str, Any]
    deliveries: int = 0


class TrustClient:
    """An agent of a trust manager, or without a name a reader.

    Requests are sent again while the manager restarts or cannot store, always with the same tokens,
    so that a rating whose acknowledgement was lost counts once. Threads may share a client; they
    take turns.

    Args:
        url: Address of the manager.
        name: Name of the agent; None to read only.
        keys: Folder with the private key of the agent, `NAME.key`, which is made if there is none.
        patience_s: Time for an answer, with all tries, seconds; well below the `tolerance` of the
            manager.

    Raises:
        ValueError: The address or the name is not valid, or the key is not, or can be read by
            others.
        OSError: The folder cannot be written.

    Example:
        >>> with TrustClient("http://127.0.0.1:8000", "ann", Path("keys")) as ann:  # doctest: +SKIP
        ...     ann.register()
        ...     if ann.ask("bob").provider.trust > 0.6:
        ...         ann.rate("bob", 0.9)
    """

    def __init__(
        self,
        url: str,
        name: str | None = None,
        keys: Path = Path("keys"),
        *,
        patience_s: float = 15.0,
    ) -> None:
        if not re.fullmatch(r"https?://[^/\s]+(/\S*)?", url):
            raise ValueError(
                f"{url!r} is no address of a trust manager, such as http://127.0.0.1:8000"
            )
        self.url, self.name, self._patience_s = url.rstrip("/"), name, patience_s
        self._keys = keys
        self._signer: Signer | None = None
        if name is not None:
            make_keys(keys, [name])
            self._signer = Signer(keys, name)
        self._http = httpx2.Client()
        self._turn = Lock()
        self._manager: About | None = None
        self._last_us = 0
        self._letter: _Letter | None = None

    def __enter__(self) -> Self:
        """Return the client."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close the connections."""
        self.close()

    def close(self) -> None:
        """Close the connections."""
        self._http.close()

    @property
    def manager(self) -> About:
        """Description of the manager, as it was when the client last asked for it."""
        return self._manager or self.about()

    def about(self) -> About:
        """Return the description of the manager, its settings and its state.

        Raises:
            UnreachableError: There is no answer.
        """
        self._manager = self._answer(About, "GET", "/")
        return self._manager

    def register(self, recovery: Ed25519PublicKey | None = None) -> TokenReceipt:
        """Register the agent with its public key, which changes nothing if it is registered.

        The proof of work takes a moment, see `has_work`.

        Args:
            recovery: Public key of the owner, without whose private key the key of the agent cannot
                be replaced, see `rotate`; None for none.

        Raises:
            ValueError: The manager asks for more work than `MAX_WORK`.
            RefusalError: The name is that of another agent, or there are too many newcomers.
            UnreachableError: There is no answer.
        """
        if (work := self.about().work) > MAX_WORK:
            raise ValueError(
                f"{self.url} asks for a proof of work of {work} bits; a client does up to "
                f"{MAX_WORK}"
            )
        content: dict[str, Any] = {}
        if self._signer is not None:
            content["key"] = key_as_text(self._signer.key.public_key())
        if recovery is not None:
            content["recovery"] = key_as_text(recovery)
        return self._send(TokenReceipt, "POST", "/agents", Registration, [content])

    def rotate(self, recovery: Ed25519PrivateKey | None = None) -> None:
        """Replace the key of the agent by a new one, which is then in its folder.

        If it breaks off, call it again: the new key waits in the folder `next` until the manager
        has it.

        Args:
            recovery: Private key of the owner, if its public key was registered.

        Raises:
            RefusalError: The recovery key lacks.
            UnreachableError: There is no answer.
            OSError: The folder cannot be written.
        """
        if self.name is None:
            raise ValueError("a client without a name has no key")
        folder = self._keys / "next"
        make_keys(folder, [self.name])
        signer = Signer(folder, self.name)
        content = {"key": key_as_text(signer.key.public_key())}
        self._new_keys = signer.key, recovery
        if self.ask(self.name).key != content["key"]:
            self._send(TokenReceipt, "PUT", f"/agents/{self.name}", Rotation, [content])
        for suffix in (".pub", ".key"):
            (folder / f"{self.name}{suffix}").replace(self._keys / f"{self.name}{suffix}")
        self._signer = signer

    def rate(self, provider: str, rating: float) -> TokenReceipt:
        """Rate a provider, on the scale of the manager; see `rate_all`."""
        return self.rate_all({provider: rating})[0]

    def rate_all(self, ratings: Mapping[str, float]) -> list[TokenReceipt]:
        """Rate providers in one request of up to 1,000 ratings, which count all or not at all.

        When this returns, the ratings are in the store of the manager.

        Args:
            ratings: Rating of each provider, on the scale of the manager.

        Raises:
            ValueError: A name or a rating is not valid.
            RefusalError: The manager refuses one of them.
            UnreachableError: There is no answer.
        """
        for provider in ratings:
            check_name(provider)
        contents = [{"sub": provider, "rating": rating} for provider, rating in ratings.items()]
        return self._send(TokenReceipts, "POST", "/ratings", Rating, contents).receipts

    def leave(self) -> TokenReceipt:
        """Leave. What the agent has rated stays; if it comes back it is a newcomer.

        Raises:
            RefusalError: The agent is not registered.
            UnreachableError: There is no answer.
        """
        return self._send(TokenReceipt, "DELETE", f"/agents/{self.name}", Leave, [{}])

    def ask(self, name: str, *, explanation: bool = False) -> Agent:
        """Return the trust in an agent with its evidence.

        Args:
            name: Name of the agent.
            explanation: Whether to say which ratings make the trust.

        Raises:
            ValueError: It is no name.
            RefusalError: There is no such agent.
            UnreachableError: There is no answer.
        """
        check_name(name)
        return self._answer(Agent, "GET", f"/agents/{name}", params={"explain": explanation})

    def agents(self, start: int = 0, limit: int = 100) -> Agents:
        """Return agents with their trust, the best provider first.

        Args:
            start: Number of agents to skip.
            limit: Number of agents, up to 1,000.

        Raises:
            UnreachableError: There is no answer.
        """
        return self._answer(Agents, "GET", "/agents", params={"start": start, "limit": limit})

    def refusals(self) -> Refusals:
        """Return how many tokens and requests the manager has refused since its start.

        Raises:
            UnreachableError: There is no answer.
        """
        return self._answer(Refusals, "GET", "/refusals")

    def export(self, path: Path, *, counted: bool = False) -> None:
        """Write all ratings with their tokens to a CSV file, which `roletrust rate` reads.

        Args:
            path: Path of the file.
            counted: Whether to leave out those of the running round, which make no trust yet.

        Raises:
            UnreachableError: There is no answer, or it breaks off. Then the file is as before.
            OSError: The file cannot be written.
        """
        following: str | None = f"/ratings?counted={str(counted).lower()}"
        try:
            with replacing(path) as unfinished, unfinished.open("wb") as file:
                while following is not None:
                    response = self._http.get(f"{self.url}{following}", timeout=self._patience_s)
                    if not response.is_success:
                        raise self._failure(response)
                    file.write(response.content)
                    following = response.links.get("next", {}).get("url")
        except httpx2.HTTPError as error:
            raise self._unreachable(error) from None

    def _send(
        self,
        answer: type[Answer],
        method: str,
        path: str,
        kind: type[Claims],
        contents: list[dict[str, Any]],
    ) -> Answer:
        """Return the answer to a signed request.

        It is signed anew only where it cannot have counted: if its first delivery is refused as
        replayed, because another process with this key was quicker, or a later one as too old.
        """
        with self._turn:
            asked, signatures = (kind, contents), 0
            while True:
                before = self._last_us
                if self._letter is None or self._letter.asked != asked:
                    self._letter, signatures = (
                        _Letter(asked, self._body(kind, contents)),
                        signatures + 1,
                    )
                letter = self._letter
                try:
                    receipts = self._answer(answer, method, path, letter)
                except RefusalError as error:
                    self._letter = None
                    if (
                        error.reason == RefusalReason.FUTURE
                    ):  # it was no time, so the next need not be above it
                        self._last_us = before
                    harmless = (
                        RefusalReason.PAST if letter.deliveries > 1 else RefusalReason.REPLAYED
                    )
                    if error.reason != harmless or signatures == _SIGNATURES:
                        raise
                else:
                    self._letter = None
                    return receipts

    def _body(self, kind: type[Claims], contents: list[dict[str, Any]]) -> dict[str, Any]:
        """Return the body of a request with a signed token for each content.

        Raises:
            ValueError: A content is not valid, or the client has no name.
        """
        if self._signer is None:
            raise ValueError("a client without a name can only read")
        tokens = []
        for content in contents:
            self._last_us = max(time.time_ns() // 1000, self._last_us + 1)
            try:
                claims = kind(
                    iss=self.name or "", aud=self.manager.name, iat=self._last_us / 1e6, **content
                )
            except ValidationError as error:
                raise ValueError(validation_message(error)) from None
            if isinstance(claims, Registration):
                claims = with_work(claims, self.manager.work)
            if isinstance(claims, Rotation):
                claims = with_proofs(claims, *self._new_keys)
            tokens.append(sign_token(claims, self._signer.key))
        return {"tokens": tokens} if kind is Rating else {"token": tokens[0]}

    def _answer(
        self,
        kind: type[Answer],
        method: str,
        path: str,
        letter: _Letter | None = None,
        params: Mapping[str, Any] | None = None,
    ) -> Answer:
        """Return the answer to a request, which is sent until there is one or the patience ends.

        Pauses grow, and become shorter again before the end: the last request is sent at the end.
        """
        end, pause = time.monotonic() + self._patience_s, _PAUSE_S
        while True:
            if letter is not None:
                letter.deliveries += 1
            try:
                response = self._http.request(
                    method,
                    self.url + path,
                    json=None if letter is None else letter.body,
                    params=params,
                    timeout=max(end - time.monotonic(), _PAUSE_S),
                )
                if response.status_code not in _RESTARTS:
                    break
                failure = self._failure(response)
            except httpx2.TransportError as error:
                failure = self._unreachable(error)
            left = end - time.monotonic()
            if left <= 0:
                raise failure
            time.sleep(min(pause, left, max(left / 2, _PAUSE_S)))
            pause = min(2 * pause, _LONGEST_PAUSE_S)
        if not response.is_success:
            raise self._failure(response)
        try:
            return kind.model_validate_json(response.content)
        except ValidationError as error:  # without its values, since language models read errors
            fields = [".".join(map(str, detail["loc"])) for detail in error.errors()]
            raise ValueError(
                f"{self.url} is not a trust manager, or has another version: its answer has wrong "
                f"fields: {short(', '.join(fields))}"
            ) from None

    def _failure(self, response: httpx2.Response) -> RefusalError | UnreachableError:
        """Return the error of an answer that is a refusal, or that no manager gives."""
        try:
            problem = Problem.model_validate_json(response.content)
        except ValidationError:
            return UnreachableError(
                f"{self.url} is no trust manager: it answers with status {response.status_code}"
            )
        wait = response.headers.get("Retry-After", "")
        return RefusalError(
            problem, response.status_code, float(wait) if wait.isdecimal() else None
        )

    def _unreachable(self, error: httpx2.HTTPError) -> UnreachableError:
        """Return the error of a request without an answer."""
        if isinstance(error, httpx2.ConnectError):
            return UnreachableError(f"no trust manager answers at {self.url}")
        if isinstance(error, httpx2.TimeoutException):
            return UnreachableError(
                f"the trust manager at {self.url} gives no answer within {self._patience_s:g} s"
            )
        return UnreachableError(
            f"the connection to the trust manager at {self.url} broke: {printable(str(error))}"
        )
