"""`roletrust` and its `play`, as a person runs them."""

import json

from typer.testing import CliRunner

from roletrust_experiments.cli import app

TINY = ["--set", "max_cycles=12"]


def run(*arguments):
    return CliRunner().invoke(app, [*map(str, arguments)])


def printed(*arguments, code=0):
    """What a command prints, in one line. It must end with this exit code."""
    result = run(*arguments)
    assert result.exit_code == code, result.output
    return " ".join(result.output.split())


def setting(**values):
    """The options `--set` of some values."""
    return [word for name, value in values.items() for word in ("--set", f"{name}={value}")]


def play(out, *arguments):
    """What a short run wrote and what it printed."""
    result = run("play", *arguments, *TINY, "--out", out)
    assert result.exit_code == 0, result.output
    return json.loads((out / "results.json").read_text()), result.output
