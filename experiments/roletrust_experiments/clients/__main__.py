"""`python -m roletrust_experiments.clients [NAME ...]`: check the environments with other libraries.

Each client gets a fresh virtual environment with this package, but without `constraints.txt`, whose pins conflict with
most clients. The environment is removed when all its checks pass.
"""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

from rich.table import Table

from roletrust_experiments.commands.console import console

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
    "tianshou": ("tianshou==2.0.1", "supersuit==3.11.0", _TORCH),
}
"""Packages to install for each client."""

_ROOT = Path(__file__).parents[3]
_BUILD = _ROOT / "build" / "clients"
_MINUTES = 30
"""Time limit of a client in minutes."""


class Check(NamedTuple):
    """A check of a client, its result, and its time in seconds."""

    what: str
    passed: bool
    seconds: float


def try_client(name: str) -> tuple[dict[str, str], list[Check]]:
    """Install a client in a fresh environment and run its checks.

    Returns:
        The versions of the installed packages, and the checks; the last one failed if the client crashed.
    """
    home, log, report = _BUILD / name, _BUILD / f"{name}.log", _BUILD / f"{name}.json"
    shutil.rmtree(home, ignore_errors=True)
    report.unlink(missing_ok=True)
    home.mkdir(parents=True)
    python, pins = str(home / "bin" / "python"), CLIENTS[name]
    packages = [pin.partition("==")[0].partition("[")[0] for pin in pins]
    steps = {
        "venv": [sys.executable, "-m", "venv", str(home)],
        "pip": [python, "-m", "pip", "install", "--quiet", *pins, "--editable", str(_ROOT)],
        "checks": [
            python,
            "-m",
            "roletrust_experiments.clients.inside",
            name,
            str(report),
            "gymnasium",
            "pettingzoo",
            *packages,
        ],
    }
    with log.open("w") as output:
        for step, command in steps.items():
            try:
                subprocess.run(
                    command,
                    cwd=home,
                    env=_surroundings(),
                    stdout=output,
                    stderr=output,
                    timeout=60 * _MINUTES,
                    check=True,
                )
            except (subprocess.CalledProcessError, subprocess.TimeoutExpired) as error:
                versions, checks = read(report)
                return versions, [*checks, Check(f"{step}: {type(error).__name__}", False, 0.0)]
    versions, checks = read(report)
    if all(check.passed for check in checks):
        shutil.rmtree(home, ignore_errors=True)
    return versions, checks


def _surroundings() -> dict[str, str]:
    """Return the variables of this process without those of its own packages, and with one thread."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    return kept | {"MPLBACKEND": "agg", "OMP_NUM_THREADS": "1"}


def read(report: Path) -> tuple[dict[str, str], list[Check]]:
    """Return the versions and the checks of a report, which may be incomplete."""
    if not report.exists():
        return {}, []
    versions, *checks = (json.loads(line) for line in report.read_text(encoding="utf-8").splitlines())
    return versions, [Check(*check) for check in checks]


def main(names: list[str]) -> int:
    """Try some clients, or all, and print what passed.

    Returns:
        0 if all has passed, 1 if something has not, 2 if a name is unknown.
    """
    for name in names:
        if name not in CLIENTS:
            print(f"there is no client {name!r}; there are {', '.join(CLIENTS)}", file=sys.stderr)
            return 2
    failures = 0
    for name in names or CLIENTS:
        with console.status(f"{name}: installing it and running its checks"):
            versions, checks = try_client(name)
        table = Table("", "Seconds", name, title=", ".join(f"{package} {v}" for package, v in versions.items()))
        for check in checks:
            table.add_row("passed" if check.passed else "[red]FAILED", f"{check.seconds:.0f}", check.what)
        console.print(table)
        if failed := sum(not check.passed for check in checks):
            console.print(f"What it said: {_BUILD / name}.log", soft_wrap=True)
        failures += failed
    return int(failures > 0)


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
