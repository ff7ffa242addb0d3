"""Small panels."""

from typing import Any

import numpy as np

from roletrust_baselines.panels.votes import Votes


def votes_of(answers: Any, truth: Any, kinds: Any = None) -> Votes:
    """Votes of all judges on all items, from a table of answers, shape (J, I)."""
    table = np.asarray(answers)
    judges, items = (axis.ravel() for axis in np.indices(table.shape))
    many = max(2, int(table.max()) + 1)
    names = (
        [f"{what}{n}" for n in range(size)]
        for what, size in zip("jia", (*table.shape, many), strict=True)
    )
    of = np.zeros(table.shape[1], np.int64) if kinds is None else np.asarray(kinds)
    kind_names = [""] if kinds is None else [f"k{n}" for n in range(of.max() + 1)]
    return Votes(
        judges, items, np.eye(many)[table.ravel()], np.asarray(truth), of, *names, kind_names
    )
