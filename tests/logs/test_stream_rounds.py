"""Rounds of a stream by time: what is published does not depend on how ratings are cut into
batches."""

from pathlib import Path
from typing import Any

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given, settings
from refusals import refuses

from roletrust_env.logs import Reading, TrustStream, read
from roletrust_env.logs.log_rounds import numbers_of, played
from roletrust_env.logs.models import LOG_MODELS
from roletrust_env.testing.trust_models import play_rounds
from roletrust_env.trust import Ratings, Traits, make_trust_model, trust_models

CENTRAL = [name for name in trust_models() if Traits.of(make_trust_model(name)).family == "central"]
EVERY = 10.0


def model_of(name: str) -> Any:
    return LOG_MODELS[name]() if name in LOG_MODELS else make_trust_model(name)


def published(stream: TrustStream) -> tuple[dict[Any, float], dict[Any, float]]:
    return stream.rater_trust(), stream.provider_trust()


def same(one: Any, other: Any) -> None:
    for found, wanted in zip(one, other, strict=True):
        assert found == pytest.approx(wanted, abs=1e-9)


RATING = st.tuples(
    st.integers(0, 5),
    st.integers(6, 9) | st.integers(0, 5),
    st.sampled_from([0.0, 0.3, 0.5, 1.0]),
    st.integers(0, 39),
)


@st.composite
def cut_logs(draw: st.DrawFn) -> tuple[list[Any], list[int]]:
    """Return ratings (rater, provider, rating, time), in any order within a round, and the sizes of
    batches."""
    ratings = [
        one for one in draw(st.lists(RATING, min_size=1, max_size=25)) if one[0] != one[1]
    ] or [(0, 6, 1.0, 0)]
    start = min(one[3] for one in ratings)
    ratings.sort(key=lambda one: (one[3] - start) // EVERY)
    return ratings, draw(st.lists(st.integers(1, 9), min_size=1, max_size=30))


FEW = {
    "role-trust",
    "mean",
    "eigentrust",
    next(iter(LOG_MODELS)),
}  # with a memory of pairs, without, not local
NAMES = [
    name if name in FEW else pytest.param(name, marks=pytest.mark.slow)
    for name in (*CENTRAL, *LOG_MODELS)
]


@pytest.mark.parametrize("name", NAMES)
@settings(max_examples=20)
@given(case=cut_logs(), same_agents=st.booleans())
def test_what_is_published_does_not_depend_on_batches(
    name: str,
    same_agents: bool,
    case: tuple[list[Any], list[int]],
) -> None:
    """After each round that has ended it is what `roletrust rate` computes from the ratings up to
    there."""
    ratings, sizes = case
    model, start = model_of(name), min(one[3] for one in ratings)
    stream = TrustStream(model, every=EVERY, same_agents=same_agents)
    cut, seen = list(ratings), 0
    while cut:
        size = sizes[seen % len(sizes)]
        batch, cut, seen = cut[:size], cut[size:], seen + 1
        stream.update(*([one[n] for one in batch] for n in range(4)))
        same(
            published(stream),
            rated(model, ratings, start + stream.rounds * EVERY, same_agents),
        )
    stream.finish()
    assert stream.rounds == 1 + max((one[3] - start) // EVERY for one in ratings)
    same(published(stream), rated(model, ratings, np.inf, same_agents))


def rated(
    model: Any, ratings: list[Any], until: float, same_agents: bool
) -> list[dict[int, float]]:
    """Return the trust of raters and of providers from a log of the ratings before a time."""
    some = [one for one in ratings if one[3] < until]
    if not some:
        return [{}, {}]
    columns = dict(zip(("rater", "ratee", "rating", "time"), zip(*some, strict=True), strict=True))
    log = read(columns, same_agents=same_agents, reading=Reading(repeats=True))
    run = played(model, log, numbers_of(log, EVERY))
    if until < np.inf:
        run.skip(round((until - min(one[3] for one in some)) / EVERY) - run.rounds)
    names = log.rater_names, log.ratee_names
    return [
        dict(zip(map(int, who), trust.tolist(), strict=True))
        for who, trust in zip(names, (run.rater_trust, run.provider_trust), strict=True)
    ]


@pytest.mark.parametrize("every", [None, EVERY])
@pytest.mark.parametrize("name", ["leave-one-out", "eigentrust", "travos"])
def test_a_stream_of_a_log_goes_on_where_the_log_ends(
    name: str, every: float | None, tmp_path: Path
) -> None:
    """All agents of the log are present from the start, and a saved one goes on, too."""
    random, size = np.random.default_rng(0), 300
    people = random.integers(0, 9, (2, size)).astype(str)
    times = np.sort(random.integers(0, 100, size)).astype(float)
    columns = dict(zip(("rater", "ratee"), people, strict=True), rating=random.random(size))
    log = read(columns | {"time": times}, reading=Reading(repeats=True))
    model = make_trust_model(name)
    settings: dict[str, Any] = {"every": every, "keep_evidence": True}
    agents = log.rater_names, log.ratee_names
    run = played(model, log, numbers_of(log, every))
    stream = TrustStream.of_log(model, log, **settings)
    stream.save(tmp_path / "state.npz")
    loaded = TrustStream.load(tmp_path / "state.npz", model, agents=agents, **settings)
    for one in (stream.finished(), loaded.finished()):
        assert list(one.provider_trust().values()) == run.provider_trust.tolist()
        assert list(one.rater_trust().values()) == run.rater_trust.tolist()
        found = one.evidence("ratee")
        assert found.ratings.sum() == size
        assert found.last.max().astype(int) == times.max() * 1e9
    assert (stream.rounds == run.rounds) == (every is None)
    later = [1e4] if every else None
    for one in (stream, loaded):
        one.update(["0"], ["1"], [1.0], later)
    assert stream.provider_trust() == loaded.provider_trust()


def test_members_of_a_round_that_has_not_ended_are_not_listed() -> None:
    """Whatever their place in a batch that is not in the order of time."""
    stream = TrustStream(make_trust_model("power-trust"), every=1, same_agents=True)
    stream.update(["late", "a"], ["later", "b"], [1.0, 0.0], [1.5, 0.5])
    assert published(stream)[0].keys() == {"a", "b"}
    stream.finish()
    assert published(stream)[0].keys() == {"a", "b", "late", "later"}


def test_the_first_round_begins_at_the_earliest_time_until_it_ends() -> None:
    stream = TrustStream(make_trust_model("mean"), every=10)
    stream.update([1], [2], [1.0], [14.0])
    stream.update([1], [3], [1.0], [5.0])
    stream.update([1], [4], [1.0], [3.0])
    assert stream.rounds == 1
    assert stream.provider_trust().keys() == {3, 4}
    stream.update([1, 1], [2, 2], [1.0, 1.0], [12.9, 13.0])
    assert stream.n_late == 1
    stream.finish()
    assert stream.rounds == 2


def test_arrays_may_be_used_again_for_the_next_batch() -> None:
    """Ratings that wait are not changed with them."""
    stream = TrustStream(make_trust_model("mean"), every=10)
    columns = [np.array([1, 2]), np.array([3, 4]), np.array([1.0, 0.0]), np.array([0.0, 5.0])]
    for _ in range(2):
        stream.update(*columns)
    for column in columns:
        column += 100
    stream.finish()
    assert stream.rounds == 1
    assert published(stream)[0].keys() == {1, 2}
    assert stream.provider_trust() == {3: 0.75, 4: 0.25}


def test_rounds_end_when_a_later_rating_shows_it() -> None:
    """So do rounds without ratings, and a rating of one of them comes too late."""
    stream = TrustStream(make_trust_model("mean"), every=10)
    stream.update([1], [2], [1.0], [0.0])
    stream.update([1], [2], [0.5], [35.0])
    assert stream.rounds == 3
    stream.update([1], [2], [0.5], [29.9])
    assert stream.n_late == 1


def test_the_names_of_a_round_that_has_begun_are_all_of_one_type(tmp_path: Path) -> None:
    stream = TrustStream(make_trust_model("mean"), every=10)
    stream.update(["a"], [1], [1.0], [0.0])
    stream.save(tmp_path / "state.npz")
    for one in (
        stream,
        TrustStream.load(tmp_path / "state.npz", make_trust_model("mean"), every=10),
    ):
        with refuses(ValueError, "raters"):
            one.update([2], [1], [1.0], [0.0])


def test_a_stream_has_the_rounds_of_a_log_for_decimal_lengths() -> None:
    times = [n / 10 for n in range(200)]
    stream = TrustStream(make_trust_model("mean"), every=0.1)
    for n, time in enumerate(times):
        stream.update([1], [2], [0.5], [time])
        assert stream.rounds == n


@pytest.mark.parametrize("name", ["travos", "role-trust"])
def test_agents_may_be_there_from_the_start_and_then_any_model_plays(
    tmp_path: Path, name: str
) -> None:
    model, columns = make_trust_model(name), (["a", "b", "a"], ["x", "x", "y"], [1.0, 0.5, 0.0])
    stream = TrustStream(model, agents=(["a", "b", "c"], ["x", "y", "z"]))
    stream.update(*columns)
    assert list(stream.provider_trust()) == ["x", "y", "z"]
    state = play_rounds(model, [], np.zeros((3, 3)))
    mask = np.array([[True, True, False], [True, False, False], [False] * 3])
    state = model.update(
        state, Ratings(np.array([[1.0, 0.0, 0.0], [0.5, 0.0, 0.0], [0.0] * 3]), mask)
    )
    assert list(stream.provider_trust().values()) == pytest.approx(
        model.provider_trust(state).tolist()
    )
    stream.save(tmp_path / "state.npz")
    again = TrustStream.load(
        tmp_path / "state.npz", model, agents=(["a", "b", "c"], ["x", "y", "z"])
    )
    for one in (stream, again):
        one.update(["d"], ["x"], [1.0])
        assert list(one.rater_trust()) == ["a", "b", "c", "d"]
    assert published(stream) == published(again)
    if name == "travos":
        with refuses(ValueError, "0.2", "0.95"):
            TrustStream(model)
