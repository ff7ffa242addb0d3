"""An environment with ROS 2 for tests: its wheels, and the project's messages built with colcon."""

import fcntl
import hashlib
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import pytest

HOUSE = Path(__file__).parents[3]
PACKAGES = [
    HOUSE / "experiments" / "roletrust_manager" / "dds" / name
    for name in ("roletrust_msgs", "roletrust_nodes")
]

ROS = {
    "rclpy": "9.1.2",
    "rmw-fastrtps-cpp": "9.3.3",
    "diagnostic-msgs": "5.5.1",
    "sensor-msgs": "5.5.1",
    "rosidl-default-generators": "1.7.1",
    "rosidl-core-generators": "0.3.1",
    "python-cmake-module": "0.11.1",
    "fastrtps-cmake-module": "3.6.2",
    "ament-package": "0.17.2",
    "ament-cmake": "2.7.3",
    "ament-cmake-ros": "0.14.5",
    "ament-cmake-ros-core": "0.14.5",
}
"""Packages of ROS 2 Kilted for the client and the messages, including some that CMake needs but no
package requires."""

AMENT = (
    "export-include-directories",
    "export-interfaces",
    "export-targets",
    "gen-version-h",
    "gmock",
    "gtest",
)
AMENT = (*AMENT, "include-directories", "pytest")
PINS = (
    *(f"ros-{name}=={version}" for name, version in ROS.items()),
    *(f"ros-ament-cmake-{name}=={ROS['ament-cmake']}" for name in AMENT),
    "colcon-ros==0.5.0",
    "cmake==4.4.4",
    "cryptography==50.0.2",
    "setuptools==80.9.0",
)


class Home(NamedTuple):
    """Paths of ROS 2 and of the messages."""

    python: Path
    messages: Path

    def environment(self, domain: int) -> dict[str, str]:
        """Return the environment variables of a process, restricted to this machine."""
        package = (
            self.messages
            / "lib"
            / f"python{sys.version_info[0]}.{sys.version_info[1]}"
            / "site-packages"
        )
        prefix = self.python.parents[1]
        return _clean() | {
            "ROS_DOMAIN_ID": str(domain),
            "FASTDDS_DEFAULT_PROFILES_FILE": str(HOUSE / "docs" / "guide" / "ros2" / "fastdds.xml"),
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET",
            "PYTHONPATH": str(package),
            "AMENT_PREFIX_PATH": f"{self.messages}:{prefix}",
            "LD_LIBRARY_PATH": f"{self.messages / 'lib'}:{prefix / 'lib'}",
        }


def ros2_environment() -> Home:
    """Return the environment, built if necessary; the test is skipped if it cannot be built."""
    root = HOUSE / "build" / "ros2"
    home = Home(root / "bin" / "python", root / "messages" / "roletrust_msgs")
    if not shutil.which("c++"):
        pytest.skip("ROS 2 needs a C++ compiler to build messages, and there is none")
    with _one_at_a_time(root):
        with _made_of(root / ".wheels", repr(PINS).encode()) as old:
            if old:
                shutil.rmtree(root, ignore_errors=True)
                subprocess.run([sys.executable, "-m", "venv", root], check=True)
                _install(home.python)
                _mend(root)
        sources = sorted(
            path for package in PACKAGES for path in package.rglob("*") if path.is_file()
        )
        with _made_of(root / ".messages", b"".join(path.read_bytes() for path in sources)) as old:
            if old:
                _build(root)
    return home


@contextmanager
def _one_at_a_time(root: Path) -> Iterator[None]:
    """Wait while another process of tests builds the environment."""
    root.parent.mkdir(parents=True, exist_ok=True)
    with root.with_suffix(".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield


@contextmanager
def _made_of(mark: Path, what: bytes) -> Iterator[bool]:
    """Yield whether something must be rebuilt, according to a file that is written after each
    build."""
    digest = hashlib.sha256(what).hexdigest()
    old = not mark.exists() or mark.read_text() != digest
    yield old
    mark.write_text(digest)


def _clean() -> dict[str, str]:
    return {
        name: value
        for name, value in os.environ.items()
        if not name.startswith(("PYTHON", "COVERAGE", "CYCLONE"))
    }


def _install(python: Path) -> None:
    command = [python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", *PINS]
    done = subprocess.run(command, capture_output=True, text=True, env=_clean())
    if "No matching distribution" in done.stderr or "onnection" in done.stderr:
        pytest.skip(
            "the wheels of ROS 2 cannot be downloaded for this platform: "
            f"{done.stderr.splitlines()[-1]}"
        )
    assert done.returncode == 0, done.stderr


def _mend(root: Path) -> None:
    """Let CMake find the headers of Python; the wheels name the folders of the machine that built
    them."""
    script = "import sysconfig as s; print(s.get_path('include'), s.get_path('purelib'))"
    printed = subprocess.run(
        [root / "bin" / "python", "-c", script],
        capture_output=True,
        text=True,
        check=True,
        env=_clean(),
    )
    include, library = printed.stdout.split()
    for path in root.glob("share/*/cmake/*Export.cmake"):
        text = path.read_text()
        parts = text.split('"')
        for at, part in enumerate(parts):
            if part.startswith("/opt/python/"):
                parts[at] = f"{include};{library}/numpy/_core/include"
        path.write_text('"'.join(parts))


def _build(root: Path) -> None:
    command = [
        root / "bin" / "colcon",
        "build",
        "--base-paths",
        *PACKAGES,
        "--install-base",
        root / "messages",
    ]
    command += [
        "--build-base",
        root / "colcon",
        "--cmake-args",
        f"-DPython3_EXECUTABLE={root / 'bin' / 'python'}",
    ]
    command += ["-DBUILD_TESTING=OFF"]
    path = f"{root / 'bin'}:{os.environ['PATH']}"
    environment = _clean() | {
        "PATH": path,
        "AMENT_PREFIX_PATH": str(root),
        "LD_LIBRARY_PATH": str(root / "lib"),
    }
    done = subprocess.run(command, cwd=root, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
