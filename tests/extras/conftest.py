"""The wheel, and fresh environments in which it is installed."""

import shutil
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from fresh_environments import HOUSE, PACKAGES, PINNED, Environment, pip


@pytest.fixture(scope="session")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel of the files that are here now, and of no older build."""
    here = tmp_path_factory.mktemp("wheel")
    try:
        pip("download", "--retries=0", "--no-deps", "--dest", here, "typing-extensions")
    except AssertionError as error:
        pytest.skip(f"no package index can be reached to install from: {error}")
    for name in PACKAGES:
        shutil.copytree(
            HOUSE / name, here / "house" / name, ignore=shutil.ignore_patterns("__pycache__")
        )
    for name in ("pyproject.toml", "hatch_build.py", "README.md", "LICENSE"):
        shutil.copy(HOUSE / name, here / "house" / name)
    pip("wheel", "--no-deps", "--wheel-dir", here, here / "house")
    (built,) = here.glob("roletrust_env-*.whl")
    return built


@pytest.fixture
def fresh(wheel: Path, tmp_path: Path) -> Iterator[Callable[..., Environment]]:
    """Makes the environment of some extras; it goes after the test, for it is large."""

    def make(
        extras: str = "", constraints: Path = PINNED, python: str = sys.executable
    ) -> Environment:
        environment = Environment(tmp_path / "environment", python)
        environment.install(f"{wheel}[{extras}]" if extras else str(wheel), constraints)
        return environment

    yield make
    shutil.rmtree(tmp_path)
