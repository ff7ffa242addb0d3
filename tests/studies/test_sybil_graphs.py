"""Sybils that vouch for one another, by hand, and what they gain."""

from typing import get_args

import numpy as np
from refusals import refuses

from roletrust_env.logs.log import Log
from roletrust_env.trust import make_trust_model
from roletrust_env.trust.edge_run import EdgeRun
from studies.sybil_graphs import SybilGraph, Topology

NAMES = ["a", "b", "c"]
LOG = Log(np.r_[0, 1], np.r_[1, 2], np.r_[0.9, 0.3], np.r_[5, 9], NAMES, NAMES)


def added(graph: SybilGraph, helpers: list[int], bought: int | None = None) -> set[tuple[str, str]]:
    log = graph.added_to(LOG, helpers, bought)
    target, *sybils = (log.rater_names[place] for place in graph.identities(LOG, bought))
    assert target == ("target" if bought is None else NAMES[bought])
    assert sybils == [f"sybil {k}" for k in range(1, graph.sybils + 1)]
    assert list(log.rater_names) == [*NAMES, *([target] if bought is None else []), *sybils]
    assert log.same_agents
    assert log.values[:2].tolist() == [0.9, 0.3]
    assert log.times is not None
    assert log.values[2:].tolist() == [1.0] * (len(log.raters) - 2)
    assert log.times[2:].tolist() == [9.0] * (len(log.raters) - 2)
    pairs = [
        (log.rater_names[i], log.ratee_names[j])
        for i, j in zip(log.raters[2:], log.ratees[2:], strict=True)
    ]
    assert len(set(pairs)) == len(pairs)
    return set(pairs)


def pairs(text: str) -> set[tuple[str, str]]:
    """Pairs such as `b-t`, in which t is the target and 2 is the second Sybil."""
    names = {
        "t": "target",
        **{name: name for name in NAMES},
        **{str(k): f"sybil {k}" for k in range(1, 9)},
    }
    return {(names[pair[0]], names[pair[2]]) for pair in text.split()}


def test_the_topologies_by_hand() -> None:
    assert added(SybilGraph("line", 3), [1, 2]) == pairs("b-t c-t t-1 1-2 2-3")
    assert added(SybilGraph("cycle", 2), [1]) == pairs("b-t t-1 1-t t-2 2-t")
    assert added(SybilGraph("parallel", 2), [1]) == pairs("b-t t-1 t-2")
    assert added(SybilGraph("layers", 3), [1, 2]) == pairs("b-t c-1 t-2 t-3 1-2 1-3 1-t 2-t 3-t")
    assert added(SybilGraph("layers", 1), [0, 1, 2]) == pairs("a-t b-1 c-t 1-t")
    assert added(SybilGraph("line", 1, returned=True), [1]) == pairs("b-t t-b t-1 1-t")
    assert added(SybilGraph("line", 2), [], bought=1) == pairs("b-1 1-2")
    assert added(SybilGraph("layers", 2), [0, 1], bought=1) == pairs("a-b b-1 b-2 1-2 2-b 1-b")
    for topology in get_args(Topology):
        assert added(SybilGraph(topology), [0]) == pairs("a-t")
        assert added(SybilGraph(topology), []) == set()


def test_other_logs_and_helpers_are_refused() -> None:
    with refuses(ValueError, "same_agents"):
        SybilGraph("line", 1).added_to(LOG._replace(ratee_names=["x", "y", "z"]), [0])
    with refuses(ValueError, "member", "3"):
        SybilGraph("line", 1).added_to(LOG, [0, 3])
    with refuses(ValueError, "member", "-1"):
        SybilGraph("line", 1).added_to(LOG, [0], bought=-1)
    with refuses(ValueError, "topology"):
        SybilGraph(topology="star")  # type: ignore[arg-type]


def test_layers_go_around_the_bridge_that_merit_rank_decays() -> None:
    """Four Sybils behind the target lose all of their merit; with two ways in, only what is behind
    a single one."""
    ring = np.array([(i, j) for i in range(6) for j in range(6) if i != j])
    names = [str(k) for k in range(6)]
    log = Log(*ring.T, np.ones(len(ring)), None, names, names)
    kept = {}
    for topology in get_args(Topology):
        attacked = SybilGraph(topology, 4).added_to(log, [4, 5])
        run = EdgeRun(make_trust_model("merit-rank", seeds=[0], beta=1.0), one_role=False)
        run.join(*attacked.shape)
        run.play(attacked.raters, attacked.ratees, attacked.values)
        kept[topology] = int((run.provider_trust[7:] > 0).sum())
    assert kept == {"line": 0, "cycle": 0, "parallel": 0, "layers": 3}
