"""Content of a report: a benchmark of trust models, of learners, or both."""

from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

from roletrust_env.benchmarking.learners.suite import LearnersSuite
from roletrust_env.benchmarking.store import Store
from roletrust_env.evaluation.specs import check_installed
from roletrust_env.trust.model import registry as trust_models
from roletrust_experiments.report.learners import Learners
from roletrust_experiments.report.robustness import Robustness
from roletrust_experiments.report.table import Table


class Content(NamedTuple):
    """Parts of a report, at least one."""

    robustness: Robustness | None = None
    learners: Learners | None = None

    @property
    def parts(self) -> list[Robustness | Learners]:
        """Parts that are present."""
        return [part for part in self if part is not None]

    @property
    def tables(self) -> dict[str, Table]:
        """All tables by the name of their figure."""
        return {name: table for part in self.parts for name, table in part.tables.items()}


def read(paths: Iterable[Path], *, allow_code: bool = False) -> Content:
    """Return the content of the files of runs.

    Args:
        paths: Paths of the files.
        allow_code: True if they may name trust models that are not installed.

    Raises:
        ValueError: A file cannot be read, is empty or names an uninstalled model, or two files have the same kind.
    """
    content, taken = Content(), dict[str, Path]()
    for path in paths:
        with Store(path) as store:
            suite, kept, software = store.suite, store.all(), store.software
        if suite.kind in taken:
            raise ValueError(
                f"{taken[suite.kind]} and {path} are both of a suite for {suite.kind}; a report has one of each kind"
            )
        taken[suite.kind] = path
        if isinstance(suite, LearnersSuite):
            content = content._replace(learners=Learners.of(suite, kept, software, path))
        else:
            if not allow_code:
                check_installed(trust_models, suite.model_names)
            content = content._replace(robustness=Robustness.of(suite, kept, software, path))
    return content
