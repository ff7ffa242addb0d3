"""Command that reproduces a run, derived from the suite in its file."""

import shlex
from pathlib import Path

from roletrust_env.benchmarking.cells import attack_names, model_names
from roletrust_env.benchmarking.suite import Suite
from roletrust_env.benchmarking.suite_files import load_suite, suites
from roletrust_env.benchmarking.suite_types import AnySuite


def reproduction_command(suite: AnySuite, path: Path) -> str:
    """Return the command that plays a suite, or continues its run.

    Args:
        suite: Suite from the file of the run, with the selected models, attacks or learners.
        path: Path of that file.

    Returns:
        Command for a shell. A suite that is not part of the project is given by the name of its file, and known attacks
        by the file `known.json`.
    """
    options = ["--suite", f"{suite.name}.toml"]
    if suite.name in suites():
        bundled = load_suite(suite.name)
        names = {field: getattr(suite, field) for field in ("models", "attacks", "learners") if hasattr(suite, field)}
        more = isinstance(suite, Suite) and isinstance(bundled, Suite) and suite.known != bundled.known
        if more:
            names |= {field: getattr(suite, field) for field in ("known", "methods")}
        if type(bundled) is type(suite) and bundled.model_copy(update=names) == suite:
            options = ["--suite", suite.name, *_options(bundled, suite), *(["--known", "known.json"] if more else [])]
    return shlex.join(["roletrust", "benchmark", *options, "--out", str(path.parent)])


def _options(bundled: AnySuite, suite: AnySuite) -> list[str]:
    """Return the options that select the names in which a run differs from the bundled suite."""
    if isinstance(suite, Suite) and isinstance(bundled, Suite):
        selections = {
            "--model": (model_names(bundled), model_names(suite)),
            "--attack": (attack_names(bundled), attack_names(suite)),
        }
    else:
        selections = {"--learner": (list(bundled.learners), list(suite.learners))}  # type: ignore[union-attr]
    return [
        part
        for option, (default, names) in selections.items()
        if names != default
        for name in names
        for part in (option, name)
    ]
