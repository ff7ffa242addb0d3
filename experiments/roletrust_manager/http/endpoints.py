"""A trust manager on HTTP: its endpoints, by FastAPI, which describes them by OpenAPI."""

import asyncio
import json
import logging
from collections import Counter
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from importlib.metadata import version
from typing import Annotated, Any

from fastapi import FastAPI, HTTPException, Query
from fastapi import Request as HttpRequest
from fastapi.concurrency import run_in_threadpool
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse, PlainTextResponse, Response, StreamingResponse
from starlette.datastructures import QueryParams
from starlette.exceptions import HTTPException as StarletteHTTPException
from starlette.routing import Match

from roletrust_env.errors import printable
from roletrust_env.logs.explain import Explanation as Found
from roletrust_manager.admission.validation import RefusalReason
from roletrust_manager.http import answers
from roletrust_manager.http.journal_trust import RoundEnd
from roletrust_manager.http.manager import MOST_ROWS, TrustManager
from roletrust_manager.http.requests import Member, Receipt, RefusedError, Request
from roletrust_manager.http.tokens import MAX_TOKEN, Leave, Name, Rating, Registration, Rotation
from roletrust_manager.http.writer import BusyError, RequestWriter
from roletrust_manager.journal.sql import StoreError

_log = logging.getLogger(__name__)
_STATUS: dict[RefusalReason, int] = {
    RefusalReason.GARBAGE: 401,
    RefusalReason.UNSIGNED: 401,
    RefusalReason.MIS_SIGNED: 401,
    RefusalReason.PAST: 401,
    RefusalReason.FUTURE: 401,
    RefusalReason.CLOCK: 401,
    RefusalReason.UNKNOWN: 403,
    RefusalReason.NO_WORK: 403,
    RefusalReason.ELSEWHERE: 403,
    RefusalReason.UNKNOWN_PROVIDER: 404,
    RefusalReason.REPLAYED: 409,
    RefusalReason.TAKEN: 409,
    RefusalReason.TOO_LARGE: 413,
    RefusalReason.FLOOD: 429,
    RefusalReason.CROWDED: 429,
}  # of others 422
_WORDS = {
    401: "A token is not signed by its agent, or not now",
    403: "An agent is not registered, or a token is not for this",
    404: "There is no such agent or event",
    409: "A token has come before, or a name is taken",
    413: "The body is too large",
    422: "The request is not valid",
    429: "There are too many ratings or newcomers in this round",
    503: "The store cannot be written, and nothing counts; or too many wait",
}
_MOST_BYTES = {
    "/ratings": answers.MAX_TOKENS * (MAX_TOKEN + 16),
}  # of a body
_FEW_BYTES = 64_000
_MOST_UNDER_WAY = 32_000_000  # bytes of all bodies beyond the first of each
_MOST_PAGES = 8  # of ratings, under way at once
_MOST_REFUSED = 1000  # requests of an address between two ticks, a second at most
_PART = 64_000  # bytes of a page that are sent at once
_MOST_STREAMS, _MOST_ROUNDS, _QUIET_S = (
    100,
    16,
    15.0,
)  # of changes; rounds that wait for a slow reader of them
_RETRY = {"Retry-After": "1"}
_SHOWN = 5  # wrong fields that are listed
_SHOWN_PATH = 100  # characters of a path that are shown


def _problems(*statuses: int) -> dict[int | str, dict[str, Any]]:
    """Return the description of errors for OpenAPI."""
    return {
        status: {"model": answers.Problem, "description": _WORDS[status]} for status in statuses
    }


_Number = Annotated[int, Query(ge=1, lt=2**63)]


class Endpoints:
    """The endpoints of a manager.

    Args:
        manager: Manager.
    """

    def __init__(self, manager: TrustManager) -> None:
        self._manager = manager
        self._writer = RequestWriter(manager)
        self._streams = set[asyncio.Queue[str | None]]()
        self._explaining = asyncio.Lock()
        self._pages = 0  # under way
        self._refused: Counter[str] = Counter()  # requests by address, since the last tick
        self._told = ""  # the failure of the store that the log has

    @asynccontextmanager
    async def life(self, app: object) -> AsyncIterator[None]:
        """End rounds when their time is over, and tell of them, as long as the application
        lives.
        """
        loop = asyncio.get_running_loop()
        self._manager.tell = lambda end: loop.call_soon_threadsafe(self._publish, end)
        task = asyncio.create_task(self._tick())
        yield
        task.cancel()
        self._writer.close()

    async def _tick(self) -> None:
        while True:
            await asyncio.sleep(min(1.0, self._manager.settings.every / 10))
            self._refused.clear()
            try:
                await self._writer.run(self._manager.advance)
            except Exception as error:  # the next round may succeed
                self.log(error)

    def log(self, error: Exception) -> None:
        """Tell the operator of a failure, once."""
        if self._told != (text := str(error)):
            _log.error(text)
        self._told = text

    def _publish(self, end: RoundEnd) -> None:
        text = f"event: round\ndata: {json.dumps(end._asdict())}\n\n"
        for stream in list(self._streams):
            if stream.qsize() < _MOST_ROUNDS:
                stream.put_nowait(text)
            else:
                self._streams.discard(stream)
                stream.put_nowait(None)

    async def about(self) -> answers.About:
        """Say what this manager is."""
        return answers.About(**self._manager.about())

    async def register(
        self, body: answers.TokenRequest, sender: HttpRequest
    ) -> answers.TokenReceipt:
        """Register an agent by a token with its public key and its proof of work."""
        (receipt,) = await self._take(sender, Request(Registration, [body.token]))
        return answers.TokenReceipt(**receipt._asdict())

    async def rotate(
        self, name: Name, body: answers.TokenRequest, sender: HttpRequest
    ) -> answers.TokenReceipt:
        """Replace the key of an agent, by a token that the old key has signed."""
        (receipt,) = await self._take(sender, Request(Rotation, [body.token], name))
        return answers.TokenReceipt(**receipt._asdict())

    async def leave(
        self, name: Name, body: answers.TokenRequest, sender: HttpRequest
    ) -> answers.TokenReceipt:
        """Let an agent leave. What it rated stays; if it comes back, it is a newcomer."""
        (receipt,) = await self._take(sender, Request(Leave, [body.token], name))
        return answers.TokenReceipt(**receipt._asdict())

    async def rate(self, body: answers.RatingTokens, sender: HttpRequest) -> answers.TokenReceipts:
        """Report ratings. They count as a whole, and are in the store when they are acknowledged.

        The last request of an agent may be sent again, and counts once.
        """
        receipts = await self._take(sender, Request(Rating, body.tokens))
        return answers.TokenReceipts(
            receipts=[answers.TokenReceipt(**receipt._asdict()) for receipt in receipts]
        )

    async def _take(self, sender: HttpRequest, request: Request) -> list[Receipt]:
        """Return the receipts of a request, unless too many of its address were refused just now.

        Raises:
            RefusedError: The request is refused.
        """
        address = "" if sender.client is None else sender.client.host
        if self._refused[address] >= _MOST_REFUSED:
            self._manager.admission.refuse("", RefusalReason.FLOOD)
            hint = f"{_MOST_REFUSED:,} refusals in a moment are allowed, so try again later"
            raise RefusedError(RefusalReason.FLOOD, hint)
        try:
            receipts = await self._writer.take(request)
        except RefusedError:
            self._refused[address] += 1
            raise
        self._told = ""
        return receipts

    async def agents(
        self,
        start: Annotated[int, Query(ge=0, le=2**31)] = 0,
        limit: Annotated[int, Query(ge=1, le=1000)] = 100,
    ) -> answers.Agents:
        """List agents with the trust in them, the best providers first."""
        members = self._manager.members()
        return answers.Agents(
            agents=[self._agent(member) for member in members[start : start + limit]],
            total=len(members),
        )

    async def agent(self, name: Name, explain: bool = False) -> answers.Agent:
        """Ask for the trust in an agent with its evidence, and for what makes it."""
        member = self._manager.member(name)
        if member is None:
            raise HTTPException(404, f"{name} is not registered here")
        agent = self._agent(member)
        if not explain:
            return agent
        if self._explaining.locked():
            raise BusyError
        async with self._explaining:
            return agent.model_copy(
                update={"explanation": await run_in_threadpool(self._explained, member)}
            )

    async def ratings(
        self,
        after: Annotated[int, Query(ge=0, lt=2**63)] = 0,
        limit: Annotated[int, Query(ge=1, le=MOST_ROWS)] = MOST_ROWS,
        counted: bool = False,
    ) -> Response:
        """Export a page of ratings as CSV, which `roletrust rate` reads; `counted` leaves out those
        of the running round. The header `Link` has the next page, if there is one.
        """
        return await self._page(lambda: self._manager.export(after, limit, counted=counted))

    async def journal(
        self,
        after: Annotated[int, Query(ge=0, lt=2**63)] = 0,
        limit: Annotated[int, Query(ge=1, le=MOST_ROWS)] = MOST_ROWS,
    ) -> Response:
        """Export a page of all tokens as CSV, by which anybody can check trust and checkpoints. The
        header `Link` has the next page, if there is one.
        """
        return await self._page(lambda: self._manager.journal(after, limit))

    async def checkpoint(self) -> PlainTextResponse:
        """Sign the number of events and the root hash of the journal, as a checkpoint of a
        transparency log (C2SP tlog-checkpoint).
        """
        return PlainTextResponse(self._manager.checkpoint())

    async def inclusion(self, seq: _Number, size: _Number) -> answers.Proof:
        """Prove that an event is among the first events of the journal (RFC 6962)."""
        return _proof(self._manager.inclusion, seq, size)

    async def consistency(self, old: _Number, new: _Number) -> answers.Proof:
        """Prove that the journal of a size begins with that of a smaller one (RFC 6962)."""
        return _proof(self._manager.consistency, old, new)

    async def _page(self, read: Callable[[], tuple[str, int | None]]) -> Response:
        """Return a page of a table, of which only a few are under way at once."""
        if self._pages >= _MOST_PAGES:
            raise BusyError
        self._pages += 1
        try:
            text, following = await run_in_threadpool(read)
        except BaseException:
            self._pages -= 1
            raise
        return TablePage(text, following, self._page_sent)

    def _page_sent(self) -> None:
        self._pages -= 1

    async def events(self) -> StreamingResponse:
        """Tell of each round that ends, with the trust that it changes, as server-sent events."""
        if len(self._streams) >= _MOST_STREAMS:
            raise BusyError
        return StreamingResponse(self._changes(), media_type="text/event-stream")

    async def _changes(self) -> AsyncIterator[str]:
        stream: asyncio.Queue[str | None] = asyncio.Queue()
        self._streams.add(stream)
        try:
            yield ": rounds\n\n"
            while True:
                try:
                    text = await asyncio.wait_for(stream.get(), _QUIET_S)
                except TimeoutError:
                    text = ":\n\n"
                if text is None:
                    return
                yield text
        finally:
            self._streams.discard(stream)

    async def refusals(self) -> answers.Refusals:
        """Count what was refused since the start, by reason."""
        counts: Counter[str] = Counter()
        for (_, reason), count in list(self._manager.refusals.items()):
            counts[reason.value] += count
        return answers.Refusals(refusals=dict(counts))

    def _agent(self, member: Member) -> answers.Agent:
        provider, rater = (
            answers.AgentTrust(**standing._asdict()) for standing in self._manager.standings(member)
        )
        return answers.Agent(
            name=member.name,
            key=member.key,
            registered=member.receipt.time,
            provider=provider,
            rater=rater if self._manager.rates_raters else None,
            rounds=self._manager.rounds,
            time=self._manager.time,
        )

    def _explained(self, member: Member) -> answers.ExplainedRoles:
        provider, rater = (self._manager.explain(member, role) for role in ("ratee", "rater"))
        return answers.ExplainedRoles(
            provider=None if provider is None else _explanation(provider),
            rater=None if rater is None else _explanation(rater),
        )


async def _parts(data: bytes) -> AsyncIterator[bytes]:
    for at in range(0, len(data), _PART):
        yield data[at : at + _PART]


class TablePage(StreamingResponse):  # type: ignore[misc]
    """A page of CSV, which is sent as fast as it is read.

    Args:
        text: Content.
        following: Number of the last row, after which the next page begins; None if there is none.
        sent: Function that is called at the end, whether all was sent or not.
    """

    def __init__(self, text: str, following: int | None, sent: Callable[[], None]) -> None:
        super().__init__(_parts(text.encode()), media_type="text/csv; charset=utf-8")
        self._following, self._sent = following, sent

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        """Send the page, as applications of ASGI do."""
        try:
            if self._following is not None:
                query = QueryParams(scope["query_string"])
                following = QueryParams({**query, "after": self._following})
                self.headers["Link"] = f'<{scope["path"]}?{following}>; rel="next"'
            await super().__call__(scope, receive, send)
        finally:
            self._sent()


class BodyLimit:
    """Refuses bodies that are too large, before more of them is read, and large ones while too many
    are under way.

    Args:
        app: Application.
        refuse: Function that counts a refusal.
    """

    def __init__(self, app: Any, refuse: Callable[[], None]) -> None:
        self._app, self._refuse = app, refuse
        self._under_way = 0

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        """Handle a request, as applications of ASGI do."""
        size, held, most = 0, 0, _MOST_BYTES.get(scope.get("path", ""), _FEW_BYTES)

        async def limited() -> Any:
            nonlocal size, held
            message = await receive()
            size += len(message.get("body", b""))
            if size > most:
                self._refuse()
                raise HTTPException(
                    _STATUS[RefusalReason.TOO_LARGE], f"a body has up to {most:,} bytes here"
                )
            more = max(size - _FEW_BYTES, 0) - held
            if self._under_way + more > _MOST_UNDER_WAY:
                raise HTTPException(503, "too many large bodies are under way", _RETRY)
            held, self._under_way = held + more, self._under_way + more
            return message

        try:
            await self._app(scope, limited if scope["type"] == "http" else receive, send)
        finally:
            self._under_way -= held


def make_app(manager: TrustManager) -> Any:
    """Return a manager as an application of ASGI, made by FastAPI.

    Args:
        manager: Manager.
    """
    ends = Endpoints(manager)
    app = FastAPI(
        title="RoleTrust manager",
        description="Agents report ratings of one another, and ask whom to trust.",
        version=version("roletrust-env"),
        lifespan=ends.life,
        docs_url=None,  # these pages load scripts from elsewhere
        redoc_url=None,
    )

    def refuse(reason: RefusalReason) -> None:
        manager.admission.refuse("", reason)

    def add(
        method: str, path: str, endpoint: Any, *errors: int, status: int = 200, **more: Any
    ) -> None:
        name = endpoint.__name__
        documented = _problems(*errors) | more.pop("responses", {})
        app.add_api_route(
            path,
            endpoint,
            methods=[method],
            status_code=status,
            operation_id=name,
            responses=documented,
            **more,
        )

    taken = 401, 403, 404, 409, 413, 422, 429, 503
    add("GET", "/", ends.about)
    add("POST", "/agents", ends.register, *taken, status=201)
    add("GET", "/agents", ends.agents, 422)
    add("GET", "/agents/{name}", ends.agent, 404, 422, 503)
    add("PUT", "/agents/{name}", ends.rotate, *taken)
    add("DELETE", "/agents/{name}", ends.leave, *taken)
    add("POST", "/ratings", ends.rate, *taken, status=201)
    add(
        "GET",
        "/ratings",
        ends.ratings,
        422,
        503,
        responses=_text("text/csv"),
        response_class=StreamingResponse,
    )
    add(
        "GET",
        "/events",
        ends.events,
        503,
        responses=_text("text/event-stream"),
        response_class=StreamingResponse,
    )
    add(
        "GET",
        "/journal",
        ends.journal,
        422,
        503,
        responses=_text("text/csv"),
        response_class=StreamingResponse,
    )
    add("GET", "/checkpoint", ends.checkpoint, response_class=PlainTextResponse)
    add("GET", "/inclusion", ends.inclusion, 404, 422)
    add("GET", "/consistency", ends.consistency, 404, 422)
    add("GET", "/refusals", ends.refusals)
    app.add_middleware(BodyLimit, refuse=lambda: refuse(RefusalReason.TOO_LARGE))

    async def refused(request: Any, error: RefusedError) -> JSONResponse:
        status = _STATUS.get(error.reason, 422)
        return _problem(
            status, error.reason.value, error.detail, error.at, _RETRY if status == 429 else None
        )

    async def not_stored(request: Any, error: StoreError) -> JSONResponse:
        ends.log(error)  # whose words are for the operator: where the store is
        return _problem(
            503, "not stored", "the store cannot be used now, and nothing counts", headers=_RETRY
        )

    async def busy(request: Any, error: BusyError) -> JSONResponse:
        return _problem(503, "busy", "too many wait for an answer; try again later", headers=_RETRY)

    async def invalid(request: Any, error: RequestValidationError) -> JSONResponse:
        if request.method != "GET":
            refuse(RefusalReason.GARBAGE)
        return _problem(422, RefusalReason.GARBAGE.value, _wrong(error))

    async def other(request: Any, error: HTTPException) -> JSONResponse:
        if error.status_code == 400:  # the body is no text
            refuse(RefusalReason.GARBAGE)
            return _problem(422, RefusalReason.GARBAGE.value, str(error.detail))
        here = [route for route in app.routes if route.matches(request.scope)[0] is not Match.NONE]
        if not here:
            paths = ", ".join(dict.fromkeys(route.path for route in app.routes))
            return _problem(
                404,
                "unknown path",
                f"there is no {request.url.path[:_SHOWN_PATH]}; there are {paths}",
            )
        unknown = "unknown agent" if request.url.path.startswith("/agents") else "unknown event"
        reasons = {404: unknown, 413: RefusalReason.TOO_LARGE.value, 503: "busy"}
        reason = reasons.get(error.status_code, "invalid")
        headers = dict(error.headers or {})
        if "Allow" in headers:  # which has the methods of one endpoint of the path
            headers["Allow"] = ", ".join(
                sorted(set[str]().union(*(route.methods for route in here)))
            )
        return _problem(error.status_code, reason, str(error.detail), headers=headers)

    for kind, handler in (
        (RefusedError, refused),
        (StoreError, not_stored),
        (BusyError, busy),
        (RequestValidationError, invalid),
        (StarletteHTTPException, other),
    ):
        app.add_exception_handler(kind, handler)
    return app


def _proof(prove: Callable[[int, int], list[bytes]], one: int, other: int) -> answers.Proof:
    """Return a proof about two numbers of events.

    Raises:
        HTTPException: There are fewer events, or the first number is the larger one.
    """
    try:
        return answers.Proof(hashes=[node.hex() for node in prove(one, other)])
    except ValueError as error:
        raise HTTPException(404, str(error)) from None


def _text(kind: str, status: int = 200) -> dict[int | str, Any]:
    """Return the description of an answer that is a text."""
    return {status: {"description": "Text", "content": {kind: {"schema": {"type": "string"}}}}}


def _problem(
    status: int,
    reason: str,
    detail: str,
    at: int | None = None,
    headers: dict[str, str] | None = None,
) -> JSONResponse:
    body = {"reason": reason, "detail": printable(detail), "at": at}
    return JSONResponse(body, status, headers=headers)


def _wrong(error: RequestValidationError) -> str:
    """Return what is wrong with a request, in a line."""
    return "; ".join(
        f"{'.'.join(map(str, problem['loc']))}: {problem['msg']}"
        for problem in error.errors()[:_SHOWN]
    )


def _explanation(explanation: Found) -> answers.ExplainedTrust:
    reasons = [
        answers.TrustReason(
            agent=reason.other,
            trust=reason.trust,
            ratings=reason.ratings.tolist(),
            others=None if reason.others != reason.others else reason.others,  # NaN
            without=reason.without,
            rank=reason.rank,
        )
        for reason in explanation.reasons
    ]
    return answers.ExplainedTrust(
        trust=explanation.trust,
        rank=explanation.rank,
        n_ratings=explanation.n_ratings,
        n_others=explanation.n_others,
        reasons=reasons,
    )
