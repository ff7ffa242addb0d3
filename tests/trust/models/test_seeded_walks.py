"""Personalized PageRank, MeritRank and SybilRank against loops, another library and worked
examples."""

from collections.abc import Iterator, Sequence
from functools import partial
from math import ceil, log2

import networkx
import numpy as np
import pytest
from model_cases import Matrix, Vector, assert_matches
from walks import numbers

from roletrust_env.trust import Ratings
from roletrust_env.trust.edge_run import EdgeRun
from roletrust_env.trust.models.central.seeded_walks import (
    MeritRank,
    PersonalizedPageRank,
    SybilRank,
)

Graph = dict[int, dict[int, float]]
Rounds = Sequence[tuple[Matrix, Matrix]]
ALPHA = 0.4


def graphs(rounds: Rounds, peers: Matrix, back: bool) -> Iterator[tuple[Graph, set[int]]]:
    """The links of each agent after each round, and the agents that cannot rate."""
    raters, providers, _ = numbers(peers)
    mute, scores = set(providers) - set(raters), [[0.0 for _ in row] for row in peers]
    for ratings, mask in rounds:
        for i, row in enumerate(mask):
            for j, rated in enumerate(row):
                scores[i][j] += 2 * ratings[i][j] - 1 if rated else 0
        links: Graph = {agent: {} for agent in {*raters, *providers}}
        for i, rater in enumerate(raters):
            for j, provider in enumerate(providers):
                if rater != provider and scores[i][j] > 1e-6:
                    links[rater][provider] = scores[i][j]
                    if back and provider in mute:
                        links[provider][rater] = scores[i][j]
        yield links, mute


def published(
    found: dict[int, float], peers: Matrix, named: set[int], links: Graph
) -> tuple[Vector, Vector]:
    raters, providers, _ = numbers(peers)
    most = max((value for agent, value in found.items() if agent not in named), default=0.0)
    if not any(links.values()):
        most = 0.0
    trust = {a: 1.0 if a in named or not most else found[a] / most for a in found}
    return [trust[a] for a in raters], [trust[a] for a in providers]


def walked(links: Graph, start: dict[int, float]) -> dict[int, float]:
    """Visits, the start included, step by step."""
    found, now = dict.fromkeys(links, 0.0), start
    while sum(now.values()) > 1e-13:
        after: dict[int, float] = dict.fromkeys(links, 0.0)
        for agent, share in now.items():
            found[agent] += share
            for other, weight in links[agent].items():
                after[other] += (1 - ALPHA) * share * weight / sum(links[agent].values())
        now = after
    return found


def places(seeds: Sequence[int], peers: Matrix) -> tuple[set[int], dict[int, float]]:
    """The seeds, and the shares of walkers at the start."""
    there = {seed for seed in seeds if seed < len(peers)} if seeds else set(range(len(peers)))
    return there, {agent: 1 / len(there) for agent in there}


def pagerank(
    rounds: Rounds, peers: Matrix, seeds: Sequence[int], back: bool
) -> Iterator[tuple[Vector, Vector]]:
    there, start = places(seeds, peers)
    for links, _ in graphs(rounds, peers, back):
        yield published(walked(links, start), peers, there if seeds else set(), links)


def reached(links: Graph, seeds: set[int], without: int | None) -> set[int]:
    found, ahead = set(), [seed for seed in seeds if seed != without]
    while ahead:
        agent = ahead.pop()
        if agent not in found:
            found.add(agent)
            ahead += [other for other in links[agent] if other != without]
    return found


def merit_rank(
    rounds: Rounds, peers: Matrix, seeds: Sequence[int], gamma: float
) -> Iterator[tuple[Vector, Vector]]:
    """Bridges are agents without which another is not reached."""
    there, start = places(seeds, peers)
    merits: dict[int, float] = {}
    for links, _ in graphs(rounds, peers, True):
        found = walked(links, start)
        counted = {
            a: 0.0
            if seeds and a in there
            else max(found[a] - start.get(a, 0.0), 0.0)
            if found[a]
            else 0.0
            for a in links
        }
        all_visits, everybody = sum(counted.values()), reached(links, there, None)
        for agent in links:
            bridged = agent in everybody - there and any(
                agent not in reached(links, there, other) for other in everybody - there - {agent}
            )
            share = counted[agent] / all_visits if all_visits else 0.0
            merits[agent] = (1 - gamma) * merits.get(agent, 0.0) + (0.5 if bridged else 1.0) * share
        yield published(merits, peers, there if seeds else set(), links)


def sybil_rank(
    rounds: Rounds, peers: Matrix, seeds: Sequence[int], steps: int | None
) -> Iterator[tuple[Vector, Vector]]:
    there, start = places(seeds, peers)
    for links, mute in graphs(rounds, peers, False):
        near = {a: {b for b in links if a != b and agreed(links, mute, peers, a, b)} for a in links}
        trust, before = {a: start.get(a, 0.0) for a in links}, dict.fromkeys(links, 0.0)
        for _ in range(steps or ceil(log2(len(links)))):
            before, trust = trust, {a: sum(trust[b] / len(near[b]) for b in near[a]) for a in links}
        if len(links) == len(peers) + len(peers[0]):
            trust = {a: trust[a] + before[a] for a in links}
        found = {a: trust[a] / len(near[a]) if near[a] else 0.0 for a in links}
        yield published(found, peers, there if seeds else set(), links)


def agreed(links: Graph, mute: set[int], peers: Matrix, a: int, b: int) -> bool:
    both = {a, b} <= set(numbers(peers)[1]) - mute
    return b in links[a] and a in links[b] if both else b in links[a] or a in links[b]


@pytest.mark.parametrize(
    ("seeds", "back", "gamma", "steps"),
    [((), True, 1.0, None), ((0,), True, 1.0, None), ((0, 2, 99), False, 0.3, 3)],
)
def test_the_models_match_their_references(
    seeds: tuple[int, ...], back: bool, gamma: float, steps: int | None
) -> None:
    assert_matches(
        PersonalizedPageRank(seeds, ALPHA, back), partial(pagerank, seeds=seeds, back=back), 3
    )
    assert_matches(
        MeritRank(seeds, ALPHA, gamma=gamma), partial(merit_rank, seeds=seeds, gamma=gamma), 3
    )
    assert_matches(SybilRank(seeds, steps), partial(sybil_rank, seeds=seeds, steps=steps), 3)


def play(model: object, n: int, edges: Sequence[tuple[int, int]]) -> dict[int, float]:
    """The trust of n peers, of which each pair is a rating of 1."""
    run = EdgeRun(model, one_role=False)
    run.join(n, n)
    raters, providers = np.array(edges).T
    run.play(raters, providers, np.ones(len(edges)))
    np.testing.assert_allclose(run.rater_trust, run.provider_trust, atol=1e-12)
    return dict(enumerate(np.asarray(run.rater_trust)))


def random_digraph(seed: int, n: int, each: int) -> list[tuple[int, int]]:
    rng = np.random.default_rng(seed)
    return [(i, int(j)) for i in range(n) for j in rng.choice(n, each, replace=False) if i != j]


@pytest.mark.parametrize("seed", range(3))
def test_large_graphs_against_another_library(seed: int) -> None:
    """PageRank with dangling agents that go to the seeds, and dominators of a flow graph, which are
    bridges."""
    n, seeds, edges = 80, (0, 1), random_digraph(seed, 80, 2)
    graph = networkx.DiGraph(edges)
    graph.add_nodes_from(range(n))
    ranks = networkx.pagerank(graph, 0.85, personalization={0: 1, 1: 1}, tol=1e-14, max_iter=1000)
    most = max(ranks[k] for k in range(2, n))
    found = play(PersonalizedPageRank(seeds), n, edges)
    assert [found[k] for k in range(2, n)] == pytest.approx(
        [ranks[k] / most for k in range(2, n)], abs=1e-9
    )
    graph.add_edges_from([("root", 0), ("root", 1)])
    dominators = networkx.immediate_dominators(graph, "root")
    plain, decayed = (play(MeritRank(seeds, beta=beta), n, edges) for beta in (0.0, 1.0))
    assert plain == pytest.approx(found, abs=1e-9)
    bridged = {k for k in range(2, n) if plain[k] and dominators[k] not in ("root", *seeds)}
    assert 5 < len(bridged) < 60
    assert {k for k in range(2, n) if plain[k] and not decayed[k]} == bridged


@pytest.mark.parametrize("seeds", [(0,), (0, 5, 9)])
def test_sybil_rank_is_powers_of_the_matrix_of_agreed_edges(seeds: tuple[int, ...]) -> None:
    """The published code of BrightID multiplies step by step, too, and divides by degrees in the
    end."""
    n, edges = 60, random_digraph(7, 60, 20)
    graph = networkx.DiGraph(edges).to_undirected(reciprocal=True)
    matrix = networkx.to_numpy_array(graph, range(n))
    degrees = matrix.sum(axis=0)
    start = np.isin(np.arange(n), seeds) / len(seeds)
    landed = (
        np.linalg.matrix_power(matrix / np.maximum(degrees, 1), 6) @ start / np.maximum(degrees, 1)
    )
    others = [k for k in range(n) if k not in seeds]
    found = play(SybilRank(seeds), n, edges)
    assert [found[k] for k in others] == pytest.approx(list(landed[others] / landed[others].max()))
    assert len({found[k] for k in others}) > 20


def test_a_star_of_friends_by_hand() -> None:
    """Four agents, so two steps: from the seed 0 to its friends 1 and 2, and on: 1 sends half to 3,
    all else returns.

    Agent 3 has 1/4 and one friend, agents 1 and 2 have none after an even number of steps. Without
    the answer of 3 there is no edge, and nobody but the seed has trust, which tells nobody apart.
    """
    mutual = [(0, 1), (1, 0), (0, 2), (2, 0)]
    assert play(SybilRank((0,)), 4, [*mutual, (1, 3), (3, 1)]) == {0: 1, 1: 0, 2: 0, 3: 1}
    third = play(SybilRank((0,), steps=3), 4, [*mutual, (1, 3), (3, 1)])
    assert third == pytest.approx({0: 1, 1: (3 / 8 + 1 / 4) / 2 / (3 / 8), 2: 1, 3: 0})
    assert play(SybilRank((0,)), 4, [*mutual, (1, 3)]) == dict.fromkeys(range(4), 1)


def test_sybils_in_a_line_a_cycle_and_side_by_side_by_hand() -> None:
    """The seed 0 trusts the attacker 1 and an honest agent 2. A step has 9 in 10 walks.

    In a line and side by side the Sybils have in all .9 / (1 - .9) or .9 of the attacker's visits;
    a cycle sends those back, which is .9^2 of its visits, so that these are 1 / (1 - .81) as many.
    """
    shapes = {
        "line": [(1, 3), (3, 4), (4, 5)],
        "cycle": [(1, 3), (3, 1), (1, 4), (4, 1), (1, 5), (5, 1)],
        "parallel": [(1, 3), (1, 4), (1, 5)],
    }
    of_sybils = {"line": [0.9, 0.81, 0.729], "cycle": [0.3] * 3, "parallel": [0.3] * 3}
    for shape, edges in shapes.items():
        for beta in (0.0, 0.5):
            found = play(MeritRank((0,), alpha=0.1, beta=beta), 6, [(0, 1), (0, 2), *edges])
            assert found[2] / found[1] == pytest.approx(1 - 0.81 if shape == "cycle" else 1)
            assert [found[k] / found[1] for k in (3, 4, 5)] == pytest.approx(
                [(1 - beta) * x for x in of_sybils[shape]]
            )


def test_a_second_honest_agent_makes_a_way_around_the_bridge() -> None:
    edges = [(0, 1), (0, 2), (1, 3), (3, 4)]
    alone, helped = (play(MeritRank((0,), beta=1.0), 5, edges + more) for more in ([], [(2, 3)]))
    assert alone[3] == alone[4] == 0
    assert helped[3] > 0 == helped[4]


def test_trust_ends_where_providers_cannot_rate_unless_walks_go_back() -> None:
    """The seed likes the first product, and rater 1 likes both, for which it needs no help: so it
    lifts the second."""
    ratings, mask = np.array([[1.0, 0.0], [1.0, 1.0]]), np.array([[True, False], [True, True]])
    backward = [PersonalizedPageRank((0,)), MeritRank((0,)), SybilRank((0,), steps=3)]
    for model in [*backward, PersonalizedPageRank((0,), back=False), MeritRank((0,), back=False)]:
        state = model.update(model.start(ratings, ratings < 0), Ratings(ratings, mask))
        assert model.rater_trust(state)[0] == 1
        assert (
            (model.rater_trust(state)[1] > 0)
            == (model.provider_trust(state)[1] > 0)
            == (model in backward)
        )
