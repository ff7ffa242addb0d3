"""What every test leaves as it found it."""

import pytest

import baselines
from roletrust_env.trust.model import registry as trust_models
from roletrust_env.world.presets import registry as scenarios


@pytest.fixture(autouse=True)
def _registries(monkeypatch):
    """Names that a test registers are gone after it, so that no other test meets them."""
    for registry in (trust_models, scenarios, baselines.registry):
        monkeypatch.setattr(registry, "_factories", dict(registry._factories))
