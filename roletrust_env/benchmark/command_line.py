"""By which command a run was played, told from what its file keeps."""

import shlex
from pathlib import Path

from roletrust_env.benchmark.cells import attacks, models
from roletrust_env.benchmark.suite import Suite, load_suite, suites
from roletrust_env.benchmark.suite_types import AnySuite


def command(suite: AnySuite, path: Path) -> str:
    """The command that plays a suite again, or goes on with it.

    Args:
        suite: as the run's file keeps it, with the names that were asked for.
        path: of that file.

    Returns:
        It, as a person types it. A suite that does not come with the project is named by its file, as it was called.
    """
    options = ["--suite", f"{suite.name}.toml"]
    if suite.name in suites():
        shipped = load_suite(suite.name)
        names = {field: getattr(suite, field) for field in ("models", "attacks", "learners") if hasattr(suite, field)}
        if type(shipped) is type(suite) and shipped.model_copy(update=names) == suite:
            options = ["--suite", suite.name, *_asked(shipped, suite)]
    return shlex.join(["roletrust", "benchmark", *options, "--out", str(path.parent)])


def _asked(shipped: AnySuite, suite: AnySuite) -> list[str]:
    """The options by which a run differs from the suite that comes with the project."""
    if isinstance(suite, Suite) and isinstance(shipped, Suite):
        kinds = {"--model": (models(shipped), models(suite)), "--attack": (attacks(shipped), attacks(suite))}
    else:
        kinds = {"--learner": (list(shipped.learners), list(suite.learners))}  # type: ignore[union-attr]
    return [part for option, (all_, mine) in kinds.items() if mine != all_ for name in mine for part in (option, name)]
