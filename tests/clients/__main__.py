"""Check the environments with other libraries: `make test-clients`, or `make test-clients
CLIENTS='torchrl rllib'`.

Each client gets a fresh virtual environment with this package, but without `constraints.txt`, whose
pins conflict with most clients. The public functions of its file are its checks. The environment is
removed when all of them pass.
"""

import inspect
import json
import os
import shutil
import subprocess
import sys
import traceback
from importlib import import_module
from importlib.metadata import version
from pathlib import Path
from time import perf_counter
from typing import NamedTuple

_TORCH, _VISION = "torch==2.13.0", "opencv-python-headless==4.14.0.94"
CLIENTS = {
    "torchrl": ("torchrl==0.14.1", _TORCH, _VISION),
    "minari": ("minari[create,hdf5]==0.5.4", "pillow==13.0.0"),
    "skrl": ("skrl==2.1.1", _TORCH, _VISION),
    "agilerl": ("agilerl==2.7.1", _TORCH, _VISION),  # later ones want PettingZoo before 1.27
    "benchmarl": ("benchmarl==1.5.2", _TORCH),
    "rllib": ("ray[rllib]==2.60.0", _TORCH),
    "sb3": ("stable-baselines3==2.9.2", "moviepy==2.2.1", "matplotlib==3.11.2", _TORCH),
    "supersuit": ("supersuit==3.11.0",),
    "jaxmarl": (
        "jaxmarl==0.2.0",
        "jax==0.10.2",
        "six==1.17.0",
    ),  # its gymnax imports six, and does not ask for it
    "tianshou": ("tianshou==2.0.1", "supersuit==3.11.0", _TORCH),
}
"""Packages to install for each client."""

_TESTS = Path(__file__).parents[1]
_BUILD = _TESTS.parent / "build" / "clients"
_TIMEOUT_S = 1800


class Check(NamedTuple):
    """A check of a client, its result, and its time in seconds."""

    what: str
    passed: bool
    seconds: float


def try_client(name: str) -> tuple[dict[str, str], list[Check]]:
    """Install a client in a fresh environment and run its checks.

    Returns:
        The versions of the installed packages, and the checks; the last one failed if the client
        crashed.
    """
    home, report = _BUILD / name, _BUILD / f"{name}.json"
    shutil.rmtree(home, ignore_errors=True)
    report.unlink(missing_ok=True)
    home.mkdir(parents=True)
    python, pins = str(home / "bin" / "python"), CLIENTS[name]
    packages = [
        "gymnasium",
        "pettingzoo",
        *(pin.partition("==")[0].partition("[")[0] for pin in pins),
    ]
    steps = {
        "venv": [sys.executable, "-m", "venv", str(home)],
        "pip": [python, "-m", "pip", "install", "--quiet", *pins, "--editable", str(_TESTS.parent)],
        "checks": [python, "-m", "clients", "--inside", name, str(report), *packages],
    }
    kept = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    surroundings = kept | {"MPLBACKEND": "agg", "OMP_NUM_THREADS": "1", "PYTHONPATH": str(_TESTS)}
    with (_BUILD / f"{name}.log").open("w") as log:
        options = {
            "cwd": home,
            "env": surroundings,
            "stdout": log,
            "stderr": log,
            "timeout": _TIMEOUT_S,
        }
        for step, command in steps.items():
            try:
                subprocess.run(command, check=True, **options)
            except (subprocess.CalledProcessError, subprocess.TimeoutExpired) as error:
                versions, checks = read(report)
                return versions, [*checks, Check(f"{step}: {type(error).__name__}", False, 0.0)]
    versions, checks = read(report)
    if all(check.passed for check in checks):
        shutil.rmtree(home, ignore_errors=True)
    return versions, checks


def inside(name: str, report: Path, packages: list[str]) -> None:
    """Run the checks of a client in its own environment, each with a line in the report.

    Args:
        name: Name of the client.
        report: File that gets one line of JSON for the versions, and one for each check.
        packages: Packages whose versions are reported.
    """
    module = import_module(f"clients.{name}")
    checks = [
        one
        for one in vars(module).values()
        if inspect.isfunction(one) and one.__module__ == module.__name__
    ]
    with report.open("w", encoding="utf-8", buffering=1) as lines:
        print(json.dumps({package: version(package) for package in packages}), file=lines)
        for check in (one for one in checks if not one.__name__.startswith("_")):
            began, passed = perf_counter(), True
            try:
                check()
            except Exception:  # from a foreign library; the other checks still run
                traceback.print_exc()
                passed = False
            print(json.dumps([inspect.getdoc(check), passed, perf_counter() - began]), file=lines)


def read(report: Path) -> tuple[dict[str, str], list[Check]]:
    """Return the versions and the checks of a report, which may be incomplete."""
    if not report.exists():
        return {}, []
    versions, *checks = (
        json.loads(line) for line in report.read_text(encoding="utf-8").splitlines()
    )
    return versions, [Check(*check) for check in checks]


def main(names: list[str]) -> int:
    """Try some clients, or all, and print what passed.

    Returns:
        0 if all has passed, 1 if something has not, 2 if a name is unknown.
    """
    if unknown := [name for name in names if name not in CLIENTS]:
        print(f"there is no client {unknown[0]!r}; there are {', '.join(CLIENTS)}", file=sys.stderr)
        return 2
    code = 0
    for name in names or CLIENTS:
        versions, checks = try_client(name)
        print(f"{name}: {', '.join(f'{package} {number}' for package, number in versions.items())}")
        for check in checks:
            print(
                f"  {'passed' if check.passed else 'FAILED'} {check.seconds:4.0f} s  {check.what}",
                flush=True,
            )
        if not all(check.passed for check in checks):
            print(f"  What it said: {_BUILD / name}.log")
            code = 1
    return code


if __name__ == "__main__":
    if sys.argv[1:2] == ["--inside"]:
        inside(sys.argv[2], Path(sys.argv[3]), sys.argv[4:])
    else:
        raise SystemExit(main(sys.argv[1:]))
