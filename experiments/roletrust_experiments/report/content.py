"""What a report tells: of a benchmark of trust models, of one of learners, or of both."""

from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

from roletrust_env.benchmark.cells import model_names
from roletrust_env.benchmark.learners.suite import LearnersSuite
from roletrust_env.benchmark.store import Store
from roletrust_env.evaluation.specs import check_installed
from roletrust_env.trust.model import registry as trust_models
from roletrust_experiments.report.learners import Learners
from roletrust_experiments.report.robustness import Robustness
from roletrust_experiments.report.table import Table


class Content(NamedTuple):
    """What was found; one part at least is there."""

    robustness: Robustness | None = None
    learners: Learners | None = None

    @property
    def parts(self) -> list[Robustness | Learners]:
        """Those that are there."""
        return [part for part in self if part is not None]

    @property
    def tables(self) -> dict[str, Table]:
        """All tables, by the name of what shows them."""
        return {name: table for part in self.parts for name, table in part.tables.items()}


def read(paths: Iterable[Path], *, allow_code: bool = False) -> Content:
    """What the files of some runs hold.

    Args:
        paths: of the files.
        allow_code: whether they may name trust models that are not installed.

    Raises:
        ValueError: one cannot be read, holds nothing yet or names what it may not, or two are of suites of one kind.
    """
    content, taken = Content(), dict[str, Path]()
    for path in paths:
        with Store(path) as store:
            suite, kept, software = store.suite, store.all(), store.software
        if suite.kind in taken:
            raise ValueError(
                f"{taken[suite.kind]} and {path} are both of a suite for {suite.kind}; a report is on one of each kind"
            )
        taken[suite.kind] = path
        if isinstance(suite, LearnersSuite):
            content = content._replace(learners=Learners.of(suite, kept, software, path))
        else:
            if not allow_code:
                check_installed(trust_models, model_names(suite))
            content = content._replace(robustness=Robustness.of(suite, kept, software, path))
    return content
