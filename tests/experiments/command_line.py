"""`roletrust` and its `play`, as a person runs them."""

import json

from typer.testing import CliRunner

from roletrust_experiments.cli import app

TINY = ["--set", "max_cycles=12"]


def run(*arguments):
    return CliRunner().invoke(app, list(arguments))


def play(out, *arguments):
    """What a short run wrote and what it printed."""
    result = run("play", *arguments, *TINY, "--out", str(out))
    assert result.exit_code == 0, result.output
    return json.loads((out / "results.json").read_text()), result.output
