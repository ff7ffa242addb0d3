"""A slow reference of approximate time synchronisation: the rules one by one, on immutable
lists."""

from fractions import Fraction
from typing import Any, NamedTuple


class Slow(NamedTuple):
    """State: the stamps of each stream in order of arrival, and the number that is set aside at the
    front of each."""

    streams: tuple[tuple[int, ...], ...]
    aside: tuple[int, ...]
    dropped: frozenset[int]
    candidate: tuple[int, ...] | None
    pivot: tuple[int, int]


def slow_start(streams: int) -> Slow:
    return Slow(((),) * streams, (0,) * streams, frozenset(), None, (0, 0))


def slow_add(
    state: Slow, stream: int, stamp: int, *, interval: int, bound: int, penalty: Any, size: int
) -> tuple[Slow, list]:
    """Return the state after a message, and the matches that it completes."""
    found: list[tuple[int, ...]] = []
    was_empty = state.aside[stream] == len(state.streams[stream])
    state = state._replace(streams=put(state.streams, stream, (*state.streams[stream], stamp)))
    if was_empty:
        state = slow_search(state, found, interval, bound, 1 + Fraction(penalty))
    if len(state.streams[stream]) > size:
        had = state.candidate
        state = state._replace(
            streams=put(state.streams, stream, state.streams[stream][1:]),
            aside=(0,) * len(state.streams),
            dropped=state.dropped | {stream},
            candidate=None,
        )
        if had is not None:
            state = slow_search(state, found, interval, bound, 1 + Fraction(penalty))
    return state, found


def slow_search(state: Slow, found: list, interval: int, bound: int, factor: Fraction) -> Slow:
    n = range(len(state.streams))
    while all(state.aside[i] < len(state.streams[i]) for i in n):
        heads = [state.streams[i][state.aside[i]] for i in n]
        start, end = min(heads), max(heads)
        first = min(i for i in n if heads[i] == start)
        last = max(i for i in n if heads[i] == end)
        state = state._replace(dropped=state.dropped & {last})
        if state.candidate is None and (end - start > interval or last in state.dropped):
            assert not any(state.aside)
            state = state._replace(streams=put(state.streams, first, state.streams[first][1:]))
            continue
        better = state.candidate is None
        if state.candidate is None:
            state = state._replace(pivot=(last, end))
        else:
            better = (end - max(state.candidate)) * factor < start - min(state.candidate)
        if better:
            rest = tuple(state.streams[i][state.aside[i] :] for i in n)
            state = state._replace(streams=rest, aside=(0,) * len(n), candidate=tuple(heads))
        state = state._replace(aside=put(state.aside, first, state.aside[first] + 1))
        if (
            first == state.pivot[0]
            or slow_end(state, end, factor)
            or slow_proof(state, bound, factor)
        ):
            found.append(state.candidate)
            rest = tuple(stamps[1:] for stamps in state.streams)
            state = state._replace(streams=rest, aside=(0,) * len(n), candidate=None)
    return state


def slow_end(state: Slow, end: int, factor: Fraction) -> bool:
    return (end - max(state.candidate)) * factor >= state.pivot[1] - min(state.candidate)


def slow_proof(state: Slow, bound: int, factor: Fraction) -> bool:
    """Return whether a queue is empty and no continuation within the bounds is better."""
    n = range(len(state.streams))
    if all(state.aside[i] < len(state.streams[i]) for i in n):
        return False
    ahead = [list(state.streams[i][state.aside[i] :]) for i in n]
    soonest = [max(state.pivot[1], state.streams[i][-1] + bound) for i in n]
    while True:
        heads = [ahead[i][0] if ahead[i] else soonest[i] for i in n]
        if slow_end(state, max(heads), factor):
            return True
        if (max(heads) - max(state.candidate)) * factor < min(heads) - min(state.candidate):
            return False
        ahead[heads.index(min(heads))].pop(0)


def put(values: tuple, place: int, value: Any) -> tuple:
    return (*values[:place], value, *values[place + 1 :])
