"""Compiled sums over edges: loops that numba makes from an expression, and the order of edges by agent.

A kernel is one loop over the edges of some agents: it gathers, computes the expression and adds, and writes nothing but
the sums. The expression comes from the formula of a model, see `roletrust_env.trust.fused`.
"""

import math
import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

Places = npt.NDArray[np.uint32]

_BLOCK = 512  # edges whose rows fit into the cache next to the processor
_ALONE = 50_000  # edges of a part at least
_SORTED = 20_000  # edges that came in order from which on a kernel of their own pays for its compiling
_PARTS = 4  # for each thread, so that none waits long for another that is interrupted

_HELPERS = """
def sine(x):  # odd series about the nearest multiple of pi: arithmetic alone, for many at a time
    turn = math.floor(x * {inverse!r} + 0.5)
    y = (x - turn * {pi!r}) - turn * {rest!r}
    z = y * y
    p = {series}
    return (1.0 - 2.0 * abs(turn - 2.0 * math.floor(turn * 0.5))) * (y + y * z * p)

def power(x, e):
    if e == 1.0:
        return x
    return 1.0 if e == 0.0 else x**e
"""

_KERNEL = """
def kernel(begin, end, raters, providers, order, out, {arguments}):
    rows = np.empty(({rows}, block))
{names}
    for low in range(begin, end, block):
        count = min(block, end - low)
        for n in range(count):
            k = low + n
{gathers}
{stages}
        for n in range(count):
            k = low + n
            {last}
"""
# Compilers make a loop work on several edges at a time only if it does not gather: so gathers have a loop of their own.

_COUNTING_SORT = """
def counting_sort(places, first, order):
    for e in range(len(places)):
        at = places[e]
        order[first[at]] = e
        first[at] += 1
"""


class Side(NamedTuple):
    """The edges in the order of one role.

    Attributes:
        order: Edge at each place, shape (E,), with the agents of the role in ascending order.
        raters: Rater of the edge at each place, shape (E,).
        providers: Provider of the edge at each place, shape (E,).
        first: Place of the first edge of each agent of the role, and E, shape (agents + 1,).
        sorted: Whether it is known that the edges came in this order, so that `order` is 0, 1, 2, ...
    """

    order: Places
    raters: Places
    providers: Places
    first: npt.NDArray[np.int64]
    sorted: bool


def numba() -> Any:
    """Return the package.

    Raises:
        ValueError: It is not installed.
    """
    try:
        import numba
    except ImportError:
        raise ValueError("fused sums need numba: pip install 'roletrust-env[numba]'") from None
    return numba


def side(raters: npt.NDArray[Any], providers: npt.NDArray[Any], size: int, *, by_rater: bool) -> Side:
    """Return the edges in the order of one of the roles, which has so many agents."""
    own = raters if by_rater else providers
    first = np.concatenate([[0], np.cumsum(np.bincount(own, minlength=size))])
    order = np.arange(len(own), dtype=np.uint32)
    in_order = bool((own[1:] >= own[:-1]).all())
    if not in_order:
        _compiled(_COUNTING_SORT, "counting_sort")(own, first.copy(), order)
        raters, providers = raters[order], providers[order]
    in_order &= len(own) >= _SORTED
    return Side(order, raters.astype(np.uint32), providers.astype(np.uint32), first, in_order)


class Program(NamedTuple):
    """An expression for each edge as loops of Python, over `n`, the place of an edge in its block.

    Attributes:
        gathers: Lines that put a value of each edge into a row, such as `g0[n] = a0[{rater}]`, with the place of the
            value in the array `a0` as `{edge}`, `{rater}` or `{provider}`.
        stages: Lines of the loops that compute from rows, one after the other.
        result: Row of the results.
        rows: Number of rows.
        arrays: The arrays `a0`, `a1`, ...
    """

    gathers: tuple[str, ...]
    stages: tuple[tuple[str, ...], ...]
    result: str
    rows: int
    arrays: tuple[Any, ...]


def add_up(program: Program, edges: Side, out: npt.NDArray[Any], *, by_rater: bool, largest: bool) -> None:
    """Add the expression of each edge to its agent's entry of `out`, or put the largest there."""
    at, value = f"out[{'raters' if by_rater else 'providers'}[k]]", program.result
    last = f"{at} = max({at}, {value})" if largest else f"{at} += {value}"
    _run(_kernel(program, edges.sorted, last), edges, out, program.arrays)


def evaluate(program: Program, edges: Side, out: npt.NDArray[Any]) -> None:
    """Put the expression of each edge into its entry of `out`; `edges` are as they came."""
    last = f"out[k] = {program.result}" + " != 0.0" * (out.dtype.kind == "b")
    _run(_kernel(program, True, last), edges, out, program.arrays)


def _run(kernel: Callable[..., None], edges: Side, out: npt.NDArray[Any], arrays: Sequence[Any]) -> None:
    """Run a kernel, on some threads if it is long; none shares an agent, so their number does not matter for sums."""
    many, first, threads = len(edges.raters), edges.first, os.cpu_count() or 1
    parts = max(1, min(_PARTS * threads, many // _ALONE))
    ends = [0, *(int(first[np.searchsorted(first, many * part / parts)]) for part in range(1, parts)), many]

    def run(begin: int, end: int) -> None:
        kernel(np.uint64(begin), np.uint64(end), edges.raters, edges.providers, edges.order, out, *arrays)

    if parts == 1:
        run(0, many)
        return
    with ThreadPoolExecutor(threads) as pool:
        list(pool.map(run, ends[:-1], ends[1:]))


def _kernel(program: Program, in_order: bool, last: str) -> Callable[..., None]:
    where = {"edge": "k" if in_order else "order[k]", "rater": "raters[k]", "provider": "providers[k]"}
    head, indent = "        for n in range(count):", " " * 12
    loops = ("\n".join([head, *(indent + line for line in lines)]) for lines in program.stages)
    source = _KERNEL.format(
        arguments=", ".join(f"a{n}" for n in range(len(program.arrays))),
        rows=program.rows,
        names="\n".join(f"    g{n} = rows[{n}]" for n in range(program.rows)),
        gathers="\n".join(indent + line.format_map(where) for line in program.gathers),
        stages="\n".join(loops),
        last=last,
    )
    return _compiled(source, "kernel")


@lru_cache(maxsize=512)
def _compiled(source: str, name: str) -> Callable[..., None]:
    """Return a function of a source, compiled when it is first called."""
    jit = numba().njit(nogil=True, error_model="numpy")
    made: dict[str, Any] = {"math": math, "np": np, "block": np.uint64(_BLOCK), **_helpers()}
    exec(source, made)
    compiled: Callable[..., None] = jit(made[name])
    return compiled


@lru_cache(maxsize=1)
def _helpers() -> dict[str, Any]:
    # The multiple of pi is taken off in two parts, so that what remains is exact to the last bit near a zero.
    series = "0.0"
    for n in range(10, 0, -1):
        series = f"({(-1) ** n / math.factorial(2 * n + 1)!r} + z * {series})"
    source = _HELPERS.format(inverse=1 / math.pi, pi=math.pi, rest=1.2246467991473532e-16, series=series)
    made: dict[str, Any] = {"math": math}
    exec(source, made)
    return {name: numba().njit(error_model="numpy")(made[name]) for name in ("sine", "power")}
