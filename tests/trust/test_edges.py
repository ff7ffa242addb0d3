"""Every central model on edges: it computes what it does on a grid."""

from typing import Any

import hypothesis.strategies as st
import numpy as np
import pytest
import torch
from hypothesis import given
from model_cases import assert_close, named, read
from refusals import refuses

from roletrust_env.trees import map_kinds
from roletrust_env.trust import Mean, Ratings, Traits, TrustModel, trust_models
from roletrust_env.trust.edge_run import EdgeRun
from roletrust_env.trust.edges import edge_model, no_ratings, runs_on_edges, start_on_edges
from roletrust_env.trust.model import start_model
from roletrust_env.trust.models.central.leave_one_out import LeaveOneOut

CENTRAL = [name for name in trust_models() if Traits.of(named(name)).family == "central"]
EVERY_CENTRAL = pytest.mark.parametrize("name", CENTRAL)
Edges = tuple[np.ndarray, np.ndarray, np.ndarray]


@st.composite
def logs(draw: st.DrawFn) -> tuple[tuple[int, int], list[Edges]]:
    """Rounds of ratings in any order: pairs repeat, some agents are alone or never rated, and
    rounds may be empty."""
    shape = draw(st.tuples(st.integers(1, 6), st.integers(1, 6)))
    note = st.floats(0, 1) | st.sampled_from([0.0, 0.1, 0.25, 0.5, 0.75, 1.0])
    edge = st.tuples(st.integers(0, shape[0] - 1), st.integers(0, shape[1] - 1), note)
    rounds = draw(st.lists(st.lists(edge, max_size=14), min_size=1, max_size=5))
    return shape, [as_arrays(edges) for edges in rounds]


def as_arrays(edges: list[tuple[int, int, float]]) -> Edges:
    raters, providers, values = (
        (np.array(column) for column in zip(*edges, strict=True)) if edges else (np.empty(0),) * 3
    )
    return raters.astype(np.int64), providers.astype(np.int64), values.astype(np.float64)


def on_grid(edges: Edges, shape: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
    """Ratings and mask; several ratings of a pair are their mean."""
    sums, counts = np.zeros(shape), np.zeros(shape)
    np.add.at(sums, edges[:2], edges[2])
    np.add.at(counts, edges[:2], 1)
    return np.where(counts > 0, sums / np.maximum(counts, 1), np.nan), counts > 0


def grid_trust(
    model: TrustModel[Any], shape: tuple[int, int], rounds: list[Edges], peers: Any = None
) -> list[Any]:
    """Both trusts after each round on a grid."""
    state = start_model(model, np.zeros(shape), np.zeros(shape, bool) if peers is None else peers)
    found = []
    for edges in rounds:
        state = model.update(state, Ratings(*on_grid(edges, shape)))
        found.append(read(model, state))
    return found


def run_trust(model: Any, shape: tuple[int, int], rounds: list[Edges], **options: Any) -> list[Any]:
    run = EdgeRun(model, **options)
    run.join(*shape)
    found = []
    for edges in rounds:
        run.play(*edges)
        found.append((run.rater_trust, run.provider_trust))
    return found


@given(log=logs())
def test_edges_are_a_grid(log: tuple[tuple[int, int], list[Edges]]) -> None:
    shape, rounds = log
    for name in CENTRAL:
        found, wanted = (
            run_trust(named(name), shape, rounds),
            grid_trust(named(name), shape, rounds),
        )
        for one, other in zip(found, wanted, strict=True):
            assert_close(one, other, 1e-11, name)


@pytest.mark.parametrize("name", [n for n in CENTRAL if Traits.of(named(n)).takes_peers])
@given(log=logs())
def test_agents_of_two_roles_are_one_agent_on_edges_too(
    name: str, log: tuple[tuple[int, int], list[Edges]]
) -> None:
    _, rounds = log
    shape, peers = (6, 6), np.eye(6, dtype=bool)
    others = [tuple(column[edges[0] != edges[1]] for column in edges) for edges in rounds]
    for played in (
        others,
        rounds,
    ):  # in the latter, agents may rate themselves, which counts for nothing
        wanted = grid_trust(named(name), shape, played, peers)
        for found, right in zip(
            run_trust(named(name), shape, played, one_role=False), wanted, strict=True
        ):
            assert_close(found, right, 1e-10)
            assert_close(found[:1], found[1:], 1e-12)


def random_log(seed: int, shape: tuple[int, int] = (40, 8), rounds: int = 6) -> list[Edges]:
    """Rounds in which half of the pairs meet; ratings are often exactly as far apart as others."""
    rng, log = np.random.default_rng(seed), []
    for _ in range(rounds):
        raters, providers = np.nonzero(rng.random(shape) < 0.5)
        order = rng.permutation(len(raters))
        log.append((raters[order], providers[order], rng.integers(0, 11, len(raters)) / 10))
    return log


@EVERY_CENTRAL
def test_the_order_of_edges_changes_nothing_but_rounding(name: str) -> None:
    """A square root magnifies the rounding of a sum, which depends on the order, where a gap should
    be 0."""
    for seed in range(5):
        rounds = random_log(seed)
        orders = [np.random.default_rng(99).permutation(len(edges[0])) for edges in rounds]
        mixed = [
            tuple(column[o] for column in edges) for o, edges in zip(orders, rounds, strict=True)
        ]
        found = run_trust(named(name), (40, 8), rounds)
        for wanted in (
            run_trust(named(name), (40, 8), mixed),
            grid_trust(named(name), (40, 8), rounds),
        ):
            for one, other in zip(found, wanted, strict=True):
                assert_close(one, other, 1e-13)


@EVERY_CENTRAL
def test_agents_may_join_in_any_round(name: str) -> None:
    """Whether room is made for them at first or when they rate does not matter to those that are
    there."""
    if Traits.of(named(name)).takes_peers:
        pytest.skip("its trust depends on the number of agents")
    model, rounds = named(name), random_log(3, (30, 20))
    late = [
        tuple(column[(edges[0] < 5 * t + 5)] for column in edges) for t, edges in enumerate(rounds)
    ]
    grown, whole = EdgeRun(model), run_trust(model, (30, 20), late)
    for edges, right in zip(late, whole, strict=True):
        grown.play(*edges)
        n, m = grown.shape
        assert_close((grown.rater_trust, grown.provider_trust), (right[0][:n], right[1][:m]), 1e-13)


@EVERY_CENTRAL
def test_a_local_model_in_a_round_of_few_changes_only_them(name: str) -> None:
    """And it computes what it does when all agents are updated, also with a memory of rounds long
    past."""
    model: Any = named(name)
    run, shape = EdgeRun(model), (300, 200)
    run.join(*shape)
    rng, rounds = np.random.default_rng(0), []
    for _ in range(8):
        rounds.append((rng.integers(0, 300, 12), rng.integers(0, 200, 12), rng.random(12)))
    rounds[5] = tuple(column[:0] for column in rounds[5])  # type: ignore[assignment]
    rounds[6], rounds[7] = (
        (*rounds[t][:2], rng.random(12)) for t in (0, 3)
    )  # the same pairs, later
    for edges in rounds:
        before = run.rater_trust, run.provider_trust
        run.play(*edges)
        if Traits.of(model).local:
            away = np.setdiff1d(np.arange(300), edges[0]), np.setdiff1d(np.arange(200), edges[1])
            after = run.rater_trust, run.provider_trust
            assert all(
                np.array_equal(a[x], b[x]) for a, b, x in zip(before, after, away, strict=True)
            )
    assert_close((run.rater_trust, run.provider_trust), grid_trust(model, shape, rounds)[-1], 1e-11)


class Counted(LeaveOneOut):
    """Leave-one-out trust, which counts its updates."""

    def update(self, state: Any, ratings: Ratings) -> Any:
        UPDATES.append(ratings.shape)
        return super().update(state, ratings)


UPDATES: list[tuple[int, int]] = []


def test_a_pause_is_played_until_a_round_without_ratings_changes_nothing() -> None:
    """The first one gives newcomers the prior of the model, which the ratings have lowered."""
    run, step_by_step = EdgeRun(Counted()), EdgeRun(LeaveOneOut())
    for one in (run, step_by_step):
        one.play(np.arange(20), np.arange(20) % 7, np.full(20, 0.2))
        one.join(22, 9)
    nobody = np.zeros(0, np.int64)
    for _ in range(5):
        step_by_step.play(nobody, nobody, np.zeros(0))
    before = run.provider_trust
    UPDATES.clear()
    run.skip(5)
    assert UPDATES == [(22, 9)] * 2
    assert run.rounds == step_by_step.rounds == 6
    assert np.array_equal(run.provider_trust, step_by_step.provider_trust)
    assert (before[7:] == 0.5).all()
    assert (run.provider_trust[7:] < 0.3).all()


class Watched(Mean):
    """The mean, which notes the numbers of agents in its updates."""

    def update(self, state: Any, ratings: Ratings) -> Any:
        SIZES.append(ratings.shape)
        return super().update(state, ratings)


SIZES: list[tuple[int, int]] = []


def test_a_local_model_takes_those_who_are_rated_or_all_where_these_are_nearly_all() -> None:
    run = EdgeRun(Watched())
    run.join(40, 24)
    SIZES.clear()
    for ratings in (1, 5, 6, 9, 10, 24):
        run.play(np.arange(ratings), np.arange(ratings), np.full(ratings, 0.5))
    run.play(np.zeros(3, np.int64), np.zeros(3, np.int64), np.full(3, 0.5))
    assert SIZES == [(1, 1), (5, 5), (6, 24), (9, 24), (40, 24), (40, 24), (1, 1)]
    run.play(
        np.array([80]), np.array([0]), np.array([0.5])
    )  # the first place for which the room of before is too small
    assert SIZES[-1] == (1, 1)


@EVERY_CENTRAL
@pytest.mark.parametrize(("dtype", "tolerance"), [(torch.float64, 1e-11), (torch.float32, 2e-4)])
def test_edges_on_torch(name: str, dtype: torch.dtype, tolerance: float) -> None:
    """All pairs are known from the start, as in a loop of one's own."""
    model, shape = edge_model(named(name)), (9, 7)
    rounds, like = random_log(5, shape), torch.zeros((), dtype=dtype)
    everyone = torch.arange(63)
    known = Ratings(None, raters=everyone // 7, providers=everyone % 7, shape=shape)
    state = start_on_edges(model, shape, like)
    state = map_kinds(
        lambda kind, leaf: leaf.new_zeros(63) if kind in ("pair", "age") else leaf, state
    )
    for raters, providers, values in rounds:
        i, j = torch.asarray(raters), torch.asarray(providers)
        given = torch.asarray(values, dtype=dtype)
        ratings = Ratings(given, raters=i, providers=j, shape=shape, pairs=known, slots=i * 7 + j)
        state = model.update(state, ratings)
    assert all(trust.dtype == dtype for trust in read(model, state))
    assert_close(read(model, state), grid_trust(named(name), shape, rounds)[-1], tolerance)


@EVERY_CENTRAL
def test_the_start_on_edges_is_that_on_a_grid(name: str) -> None:
    model = edge_model(named(name))
    on_edges, grid = (
        start_on_edges(model, (4, 3)),
        start_model(named(name), np.zeros((4, 3)), np.zeros((4, 3), bool)),
    )
    assert_close(read(model, on_edges), read(named(name), grid), 1e-12)
    again = model.update(on_edges, no_ratings(np.zeros(1), (4, 3)))
    assert_close(read(model, again), read(model, on_edges), 1e-12)


def test_several_ratings_of_a_pair_have_one_voice() -> None:
    """A rater that says it three times does not outvote two others."""
    rounds = [as_arrays([(0, 0, 0.0), (0, 0, 0.0), (1, 0, 1.0), (0, 0, 0.3), (2, 0, 1.0)])]
    (_, (trust,)) = run_trust(named("mean"), (3, 1), rounds)[0]
    assert trust == pytest.approx(0.7 * (0.1 + 1 + 1) / 3 + 0.3 * 0.3)


@given(
    st.lists(
        st.sampled_from([-0.0, 0.0, 5e-324, 0.1, 0.25, 1.0]) | st.floats(0, 1),
        min_size=1,
        max_size=30,
    )
)
def test_many_ratings_are_sorted_as_few_are(values: list[float]) -> None:
    numbers = np.array(values)
    raters, places = np.arange(len(numbers)), (numbers * 100_000).astype(np.int64)
    ratings = Ratings(numbers, raters=raters, providers=places, shape=(len(numbers), 100_001))
    found = []
    for block in (len(numbers) + 1, 0):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr("roletrust_env.trust.ratings._BLOCK", block)
            pairs, ordered, place = ratings.sorted_by_provider()
            found.append((pairs.raters, pairs.providers, ordered, place))
    assert all(np.array_equal(few, many) for few, many in zip(*found, strict=True))


@pytest.mark.parametrize("name", ["travos", "fire"])
def test_a_personal_model_is_refused(name: str) -> None:
    with refuses(ValueError, type(named(name)).__name__):
        edge_model(named(name))


def test_all_central_models_run_on_edges() -> None:
    assert all(runs_on_edges(named(name)) for name in CENTRAL)
