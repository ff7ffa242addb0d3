"""Fused sums: they compute what the formula does on edges, for every central model."""

import sys
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from model_cases import assert_close, named
from test_edges import CENTRAL, EVERY_CENTRAL, Edges, ledger_trust, logs, random_log

from roletrust_env.data import TrustStream
from roletrust_env.trust.edges import EdgeCells, EdgeRatings
from roletrust_env.trust.ledger import Ledger
from roletrust_env.trust.neighbours import NEIGHBOURS

pytest.importorskip("numba", reason="the extra `numba` is not installed")

from roletrust_env.trust import fused_kernels
from roletrust_env.trust.fused import FusedCells, FusedRatings, LazyCells

ALL = pytest.mark.parametrize("name", [*CENTRAL, *(name for name in NEIGHBOURS if name not in CENTRAL)])


def model(name: str) -> Any:
    return named(name) if name in CENTRAL else NEIGHBOURS[name]()


@ALL
@settings(max_examples=25, deadline=None)
@given(log=logs())
def test_fused_sums_are_those_of_edges(name: str, log: tuple[tuple[int, int], list[Edges]]) -> None:
    shape, rounds = log
    wanted = ledger_trust(model(name), shape, rounds)
    for found, right in zip(ledger_trust(model(name), shape, rounds, fused=True), wanted, strict=True):
        assert_close(found, right, 1e-11)


@ALL
def test_members_that_rate_members(name: str) -> None:
    rounds = [tuple(column[edges[0] != edges[1]] for column in edges) for edges in random_log(0, (9, 9))]
    wanted = ledger_trust(model(name), (9, 9), rounds, one_role=False)  # type: ignore[arg-type]
    fused = ledger_trust(model(name), (9, 9), rounds, one_role=False, fused=True)  # type: ignore[arg-type]
    for found, right in zip(fused, wanted, strict=True):
        assert_close(found, right, 1e-11)


@EVERY_CENTRAL
def test_many_edges_on_several_threads(monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    """Their number does not matter to the last bit, since no agent is shared."""
    monkeypatch.setattr("os.cpu_count", lambda: 3)
    found = []
    rounds = [tuple(np.tile(column, 1) for column in edges) for edges in random_log(1, (300, 60), 3)]
    for alone in (10**9, 700):
        monkeypatch.setattr(fused_kernels, "_ALONE", alone)
        found.append(ledger_trust(named(name), (300, 60), rounds, fused=True))  # type: ignore[arg-type]
    for one, other in zip(*found, strict=True):
        assert all(np.array_equal(a, b) for a, b in zip(one, other, strict=True))
    assert_close(found[0][-1], ledger_trust(named(name), (300, 60), rounds)[-1], 1e-11)  # type: ignore[arg-type]


def some_cells(n: int = 900, seed: int = 0, *, ordered: bool = False) -> tuple[EdgeCells, FusedCells]:
    rng = np.random.default_rng(seed)
    raters, providers = rng.integers(0, 40, n), rng.integers(0, 30, n)
    providers = np.sort(providers) if ordered else providers
    return EdgeCells(raters, providers, (40, 30)), FusedCells(raters, providers, (40, 30))


FORMULAS: dict[str, Any] = {
    "arithmetic": lambda x, y, v: (x - 2 * y) / (1 + v) - -v,
    "roots": lambda x, y, v: np.sqrt(abs(x - y)) * np.sin(3 * v) + np.exp(-x) * np.log(1 + y),
    "powers": lambda x, y, v: (v**2 + x**y) ** (v + 1) + (x ** np.where(v > 0.5, 1.0, 0.0)) ** y,
    "choices": lambda x, y, v: np.where((x > y) & (v < 0.7) | (y == v), np.clip(v, 0.2, 0.6), np.maximum(x, y)),
    "negation": lambda x, y, v: np.where(~(x >= y), np.minimum(v, y), np.clip(v, None, 0.5)),
    "types": lambda x, y, v: np.astype(x != y, v.dtype) + np.zeros_like(v) + np.ones_like(v) * np.float64(0.3),
    "an array of its own": lambda x, y, v: x * np.linspace(0, 1, 900) + np.array(2.0) * y,
    "long": lambda x, y, v: sum((x + n * y) * v for n in range(14)),
    "at once": lambda x, y, v: np.cumsum(v) * x + v.sum() * np.mean(x * y) + np.concatenate([v[:450], v[450:]]),
    "flags": lambda x, y, v: np.asarray(x > y) * v + (np.asarray(x > v) & (y > v)) * 1.0,
}


# Order changes nothing but the gathers, so that a few formulas show it.
@pytest.mark.parametrize(
    ("formula", "ordered"), [*((name, False) for name in FORMULAS), ("powers", True), ("an array of its own", True)]
)
def test_an_expression_is_what_numpy_computes(formula: str, ordered: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fused_kernels, "_SORTED", 0)
    plain, fused = some_cells(ordered=ordered)
    rng = np.random.default_rng(1)
    of_raters, of_providers, values = rng.random(40), rng.random(30), rng.random(900)

    def computed(cells: EdgeCells, values: Any) -> Any:
        return FORMULAS[formula](cells.of_raters(of_raters), cells.of_providers(of_providers), values)

    right, lazy = computed(plain, values), computed(fused, fused.values_of(values))
    np.testing.assert_allclose(np.asarray(lazy), right, rtol=1e-13, atol=1e-13)
    lazy = computed(fused, fused.values_of(values))  # without values that are known
    for name in ("sum_over_raters", "sum_over_providers"):
        np.testing.assert_allclose(getattr(fused, name)(lazy), getattr(plain, name)(right), rtol=1e-12, atol=1e-12)
    positive = abs(right)
    lazy = abs(computed(fused, fused.values_of(values)))
    np.testing.assert_allclose(fused.largest_over_raters(lazy), plain.largest_over_raters(positive), rtol=1e-13)


def test_a_sum_runs_without_arrays_of_the_edges() -> None:
    """Or else it would not be fused."""
    _, fused = some_cells()
    values = fused.values_of(np.ones(900))
    lazy = np.sqrt(abs(values - fused.of_providers(np.zeros(30)))) ** 3
    fused.sum_over_raters(lazy)
    assert isinstance(lazy, LazyCells)
    assert lazy._known is None


def test_single_precision_stays() -> None:
    _, cells = some_cells()
    ratings = FusedRatings(cells, np.ones(900, np.float32), cells, None)
    assert ratings.received.dtype == ratings.sum_over_providers(ratings.values * 2).dtype == np.float32
    assert np.asarray(ratings.values > 0.5).dtype == bool


def test_counts_are_those_of_edges() -> None:
    plain, fused = some_cells()
    one, other = EdgeRatings(plain, np.ones(900), plain, None), FusedRatings(fused, np.ones(900), fused, None)
    assert np.array_equal(one.received, other.received)
    assert np.array_equal(one.given, other.given)


def test_the_sine_is_that_of_the_library() -> None:
    sine = fused_kernels._helpers()["sine"]
    for x in [*np.linspace(-7, 7, 4001), 0.0, np.pi, 1e-30, np.pi * (1 - 1e-9)]:
        assert sine(x) == pytest.approx(np.sin(x), abs=4e-16)
    assert sine(np.pi) == np.sin(np.pi)


def test_a_stream_with_fused_sums() -> None:
    streams = [TrustStream(named("role-trust"), fused=fused) for fused in (False, True)]
    for raters, providers, values in random_log(4):
        for stream in streams:
            stream.update(raters, providers, values)
    assert streams[0].provider_trust() == pytest.approx(streams[1].provider_trust(), abs=1e-12)


def test_without_numba_a_line_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "numba", None)
    with pytest.raises(ValueError, match=r"fused sums need numba: pip install 'roletrust-env\[numba\]'"):
        Ledger(named("mean"), fused=True)
