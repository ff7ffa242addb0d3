"""A manager that runs, and an agent of it."""

import pytest
from running import Between, Clock, manager, running

from roletrust_manager.http.client import TrustClient
from roletrust_manager.http.endpoints import make_app


@pytest.fixture
def clock(monkeypatch):
    return Clock(monkeypatch)


@pytest.fixture
def between(tmp_path, clock):
    with manager(tmp_path / "trust.sqlite", clock) as kept:
        yield Between(make_app(kept))


@pytest.fixture
def url(between):
    with running(between) as address:
        yield address


@pytest.fixture
def ann(url, tmp_path):
    with TrustClient(url, "bob", tmp_path / "keys") as bob:
        bob.register()
    with TrustClient(url, "ann", tmp_path / "keys") as client:
        client.register()
        yield client
