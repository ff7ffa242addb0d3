"""Virtual environments with nothing but what is installed from the wheel, and programs that run in
them."""

import os
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

HOUSE = Path(__file__).parents[2]
PINNED = HOUSE / "constraints.txt"
PACKAGES = (
    *("roletrust_env", "agents/roletrust_agents", "baselines/roletrust_baselines"),
    *("experiments/roletrust_experiments", "experiments/roletrust_manager"),
)
HELPS = """
import typer
from typer.testing import CliRunner
from roletrust_experiments.cli import app
for command in typer.main.get_command(app).commands:
    assert "Examples" in CliRunner().invoke(app, [command, "--help"]).output, command
"""
SMALL = """extends = "quick"
own = []
solo = { common = "mean", own = "mean" }
games = 1
selection_games = 1
[settings.clean]
[settings.raters]
roles = ["SR"]
share = 0.3
"""
"""Fields of a suite of two settings, beside its trust models and attacks."""


class Run(NamedTuple):
    """How a program ended."""

    code: int
    out: str
    err: str


class Environment:
    """A fresh virtual environment, and a folder to work in."""

    def __init__(self, path: Path, python: str = sys.executable) -> None:
        self.path, self.folder = path, path / "work"
        subprocess.run([python, "-m", "venv", "--without-pip", path], check=True)
        self.folder.mkdir()

    def install(self, what: str, constraints: Path = PINNED) -> None:
        pip(
            "install",
            "--no-compile",
            what,
            python=self.path / "bin" / "python",
            constraints=constraints,
        )

    def python(self, code: str) -> str:
        run = self.run("python", "-c", code)
        assert run.code == 0, run.err
        return run.out

    def roletrust(self, *arguments: object) -> str:
        """What the command prints when all is well."""
        run = self.run("roletrust", *arguments)
        assert run.code == 0, run.err
        return run.out

    def refused(self, *arguments: object) -> str:
        """The one line that it prints when something is missing; nothing is written."""
        before = sorted(self.folder.iterdir())
        run = self.run("roletrust", *arguments)
        assert (run.code, run.out, len(run.err.splitlines())) == (2, "", 1), run
        assert sorted(self.folder.iterdir()) == before
        return run.err

    def run(self, program: str, *arguments: object) -> Run:
        """How a program of the environment ends."""
        clean = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"} | {
            "COLUMNS": "120"
        }
        command = [self.path / "bin" / program, *map(str, arguments)]
        done = subprocess.run(command, cwd=self.folder, env=clean, capture_output=True, text=True)
        return Run(done.returncode, done.stdout, done.stderr)


def pip(
    command: str,
    *arguments: object,
    python: Path = Path(sys.executable),
    constraints: Path = PINNED,
) -> None:
    """Run pip, by default in the versions that are pinned."""
    pinned = ("--constraint", constraints)
    start = (
        sys.executable,
        "-m",
        "pip",
        "--python",
        python,
        "--quiet",
        "--disable-pip-version-check",
    )
    done = subprocess.run(
        [*map(str, (*start, command, *pinned, *arguments))], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
