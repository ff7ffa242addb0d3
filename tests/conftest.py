"""What every test leaves as it found it, the settings of Hypothesis, and a browser for those that
want one."""

import os

# Before NumPy and torch are loaded: threads of one process that wait for a busy core cost many
# times their work.
os.environ.setdefault("OMP_NUM_THREADS", "1")

import re
import shutil
from collections.abc import Callable
from pathlib import Path

import hypothesis
import pytest

import roletrust_experiments.commands.console  # noqa: F401 - takes the width of the terminal when it is imported
from roletrust_env.benchmarking.learners.learner import registry as learners
from roletrust_env.evaluation.search import search_methods
from roletrust_env.game.policy import registry as attackers
from roletrust_env.registry import load_plugins
from roletrust_env.trust.model import registry as trust_models
from roletrust_env.world.presets import registry as scenarios

# No deadline, for a busy machine takes longer; the same examples on every machine, so that a
# failure can be repeated.
for _name, _examples in (("roletrust", 25), ("thorough", 200)):
    hypothesis.settings.register_profile(
        _name,
        max_examples=_examples,
        deadline=None,
        derandomize=True,
        print_blob=True,
        suppress_health_check=[hypothesis.HealthCheck.too_slow],
    )
hypothesis.settings.load_profile("roletrust")


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config, items):
    """No test has two of the markers by which tests are left out: it would run twice."""
    left_out = set(re.findall(r"not (\w+)", config.getini("addopts")[-1]))
    for item in items:
        if len(found := left_out & {mark.name for mark in item.iter_markers()}) > 1:
            raise pytest.UsageError(
                f"{item.nodeid} is marked with {', '.join(sorted(found))}; one of them is enough"
            )


@pytest.fixture(autouse=True)
def _no_wait_for_the_disk(monkeypatch):
    """Journals and states are written without waiting for the disk, which would be most of their
    time."""
    monkeypatch.setattr(os, "fsync", lambda file: None)


@pytest.fixture(autouse=True)
def _registries(monkeypatch):
    """Names that a test registers are gone after it, so that no other test meets them."""
    load_plugins()
    for registry in (trust_models, scenarios, attackers, learners, search_methods):
        monkeypatch.setattr(registry, "_factories", dict(registry._factories))


@pytest.fixture(scope="module")
def browser():
    """A real Chromium; it may take long to start where the machine is busy."""
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright drives the browser")
    chromium = (
        shutil.which("chromium")
        or shutil.which("chromium-browser")
        or shutil.which("google-chrome")
    )
    if chromium is None:
        pytest.skip("there is no Chromium here (Debian: apt-get install chromium)")
    flags = [
        "--no-sandbox",
        "--disable-gpu",
        "--disable-quic",
        "--no-first-run",
        "--disable-background-networking",
    ]
    with playwright.sync_playwright() as driver:
        found = driver.chromium.launch(executable_path=chromium, args=flags, timeout=240_000)
        yield found
        found.close()


@pytest.fixture(autouse=True)
def _own_clock(monkeypatch):
    """Let no test see a clock of the nodes that another test has moved, since it never goes
    back."""
    monkeypatch.setattr("roletrust_manager.admission.clock._last", (0, 0))


@pytest.fixture
def install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """Return a function that puts a package with one module and one entry point where Python finds
    packages."""

    def install(module: str, group: str, code: str, entry: str = "") -> None:
        monkeypatch.syspath_prepend(tmp_path)
        (tmp_path / f"{module}.py").write_text(code)
        about = tmp_path / f"{module}-1.0.dist-info"
        about.mkdir()
        (about / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {module}\nVersion: 1.0\n")
        (about / "entry_points.txt").write_text(
            f"[{group}]\n{entry or f'{module} = {module}:made'}\n"
        )

    return install
