"""A trust manager for agents as a process that answers over HTTP."""

import gc
import signal
import socket
import sys
from collections.abc import Callable
from contextlib import closing

import uvicorn

from roletrust_env.errors import counted
from roletrust_env.logs.models import make_log_model
from roletrust_manager.admission.validation import RefusalReason
from roletrust_manager.http.connections import limited_protocol
from roletrust_manager.http.endpoints import make_app
from roletrust_manager.http.manager import TrustManager
from roletrust_manager.http.requests import Settings
from roletrust_manager.journal.sql import JournalStore

_END_S = 2  # for answers that are on their way when the manager ends
_SWITCH_S = 5e-4  # for which one thread may keep the others waiting


def serve(
    model: str,
    store: str,
    settings: Settings = Settings(),  # noqa: B008 - immutable
    *,
    name: str | None = None,
    host: str = "127.0.0.1",
    port: int = 8000,
    report: Callable[[str], object] = print,
) -> None:
    """Be a trust manager until a signal ends the process. It must be called in the main thread.

    Args:
        model: Trust model, `NAME[:key=value,...]`, see `make_log_model`.
        store: Journal, a file of SQLite or `postgresql://...`; a new one is made.
        settings: Settings of the manager.
        name: Name of the manager, to which tokens are addressed; None for that of the store, or a
            random name for a new store.
        host: Address to listen at; `0.0.0.0` is reached by other machines.
        port: Port, from 0 to 65535; 0 for any.
        report: Function that shows the address to the user.

    Raises:
        ValueError: An argument is not allowed, or the store belongs to another manager.
        StoreError: The store cannot be read, or is damaged.
        OSError: The port is in use.
    """
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))  # after the store is closed
    with (
        closing(JournalStore(store, name)) as journal,
        _listener(host, port) as listener,
        closing(TrustManager(journal, model, settings, make=make_log_model)) as manager,
    ):
        app, about = make_app(manager), manager.about()
        url = f"http://{f'[{host}]' if ':' in host else host}:{listener.getsockname()[1]}"
        held = f"{counted(about['agents'], 'agent')} and {counted(about['ratings'], 'rating')}"
        report(f"{manager.name} answers with {model} at {url}, with {held}; Ctrl-C ends it")
        sys.setswitchinterval(_SWITCH_S)
        gc.freeze()  # else each full collection looks at all modules, and all requests wait
        config = uvicorn.Config(
            app,
            http=limited_protocol(lambda: manager.admission.refuse("", RefusalReason.TOO_LARGE)),
            log_level="error",  # strangers must not fill the log
            access_log=False,
            timeout_graceful_shutdown=_END_S,
        )
        uvicorn.Server(config).run(sockets=[listener])


def _listener(host: str, port: int) -> socket.socket:
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    try:
        return socket.create_server((host, port), family=family, backlog=1024)
    except OSError as error:
        why = str(error.strerror).partition(" (")[0]
        raise OSError(f"port {port} of {host}: {why}; choose another, 0 for any") from None
