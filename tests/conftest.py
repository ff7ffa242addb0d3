"""What every test leaves as it found it, the settings of Hypothesis, and a browser for those that want one."""

import shutil

import hypothesis
import pytest

from roletrust_env.game.policy_registry import registry as attackers
from roletrust_env.registry import load_plugins
from roletrust_env.trust.model import registry as trust_models
from roletrust_env.world.presets import registry as scenarios

# No deadline, for a busy machine takes longer; the same examples on every machine, so that a failure can be repeated.
hypothesis.settings.register_profile(
    "roletrust",
    deadline=None,
    derandomize=True,
    print_blob=True,
    suppress_health_check=[hypothesis.HealthCheck.too_slow],
)
hypothesis.settings.load_profile("roletrust")


@pytest.fixture(autouse=True)
def _registries(monkeypatch):
    """Names that a test registers are gone after it, so that no other test meets them."""
    load_plugins()
    for registry in (trust_models, scenarios, attackers):
        monkeypatch.setattr(registry, "_factories", dict(registry._factories))


@pytest.fixture(scope="module")
def browser(request):
    """A real Chromium; a module says by `PATIENCE_MS` how long it may take to start, if not as long as usual."""
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright drives the browser")
    chromium = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    if chromium is None:
        pytest.skip("there is no Chromium here (Debian: apt-get install chromium)")
    flags = ["--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking"]
    with playwright.sync_playwright() as driver:
        patience = getattr(request.module, "PATIENCE_MS", None)
        found = driver.chromium.launch(executable_path=chromium, args=flags, timeout=patience)
        yield found
        found.close()
