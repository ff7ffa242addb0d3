"""Choose the run of a trust model: on edges or on a grid.

A run takes ratings between agents at indices 0, 1, 2, ... Agents join, rate and leave.
"""

from typing import Any

import numpy as np

from roletrust_env.trust.edge_run import EdgeRun
from roletrust_env.trust.edges import runs_on_edges
from roletrust_env.trust.grid_run import GridRun, check_grid_memory, pairs_of
from roletrust_env.trust.trust_run import TrustRun


def make_run(model: Any, shape: tuple[int, int] = (0, 0), *, one_role: bool = True) -> TrustRun:
    """Return a run with so many raters and providers: on edges if the model runs there, otherwise
    on a grid.

    Args:
        model: Trust model.
        shape: Number of raters and of providers at the start.
        one_role: Whether raters and providers are different agents. Otherwise rater 7 and provider
            7 are one agent.

    Raises:
        MemoryError: The state on a grid would take more than `MEMORY`. The message says how much.
    """
    if not runs_on_edges(model):
        check_grid_memory(model, shape)
        return GridRun(
            model, np.zeros(shape), pairs_of(shape, one_role=one_role), one_role=one_role
        )
    run = EdgeRun(model, one_role=one_role)
    run.join(*shape)
    return run
