"""Algorithms 1 to 3 against a loop-by-loop reference, and the properties that hold for any
ratings."""

from collections.abc import Callable
from typing import Any, NamedTuple

import hypothesis.strategies as st
import numpy as np
import pytest
import reference
import torch
from hypothesis import given
from hypothesis.extra.numpy import arrays
from refusals import refuses

from roletrust_env.trust import agent_trust, provider_trust, rater_trust
from roletrust_env.trust.algorithms import upper_median

TOLERANCE = 1e-12
NAMESPACES = pytest.mark.parametrize("asarray", [np.asarray, torch.asarray], ids=["numpy", "torch"])


class Game(NamedTuple):
    """What Algorithms 1 and 2 read, for S raters, P providers and any batch axes."""

    ratings: Any  # (S, P, ...)
    mask: Any  # (S, P, ...)
    tor: Any  # (S, ...)
    top: Any  # (P, ...)
    last: Any  # (S, P, ...)
    elapsed: Any  # (S, P, ...), whole numbers, 0 where never rated

    def map(self, function: Callable[[Any], Any]) -> "Game":
        return Game(*map(function, self))


def raters(game: Game, lam: float = 0.5) -> Any:
    return rater_trust(game.ratings, game.mask, previous=game.tor, lam=lam)


def providers(game: Game, lam: float = 0.5) -> Any:
    return provider_trust(
        game.ratings,
        game.mask,
        tor=game.tor,
        previous=game.top,
        lam=lam,
        last_ratings=game.last,
        elapsed=game.elapsed,
    )


def in_precision(array: np.ndarray, precision: type) -> np.ndarray:
    return array.astype(precision) if array.dtype == np.float64 else array


def assert_close(actual: Any, expected: Any) -> None:
    np.testing.assert_allclose(
        np.asarray(actual), np.asarray(expected), rtol=0, atol=TOLERANCE, strict=True
    )


# --- random cases ---------------------------------------------------------------------------------


def random_game(rng: np.random.Generator) -> Game:
    """A batch of 1 to 3 games full of corner cases; what nobody should read holds junk."""
    s, p = rng.integers(1, 6, 2)
    batch = rng.integers(1, 4)
    cells = (s, p, batch)
    ratings = np.where(
        rng.random(cells) < 0.2, rng.choice([0.0, 0.5, 1.0], cells), rng.random(cells)
    )
    ratings = np.where(
        rng.random((p, batch)) < 0.2, ratings[:1], ratings
    )  # some providers' raters all agree
    mask = rng.random(cells) < rng.choice([0.3, 0.7, 1.0])
    mask &= rng.random((s, 1, batch)) < 0.9  # some raters rate nobody
    mask &= rng.random((1, p, batch)) < 0.9  # some providers are rated by nobody
    elapsed = np.where(rng.random(cells) < 0.3, 0, rng.integers(1, 50, cells))
    last = np.where(rng.random(cells) < 0.2, ratings, rng.random(cells))
    return Game(
        ratings=np.where(mask, ratings, rng.normal(0, 9, cells)),
        mask=mask,
        tor=random_trust(rng, (s, batch)),
        top=random_trust(rng, (p, batch)),
        last=np.where(elapsed > 0, last, rng.normal(0, 9, cells)),
        elapsed=elapsed,
    )


def random_trust(rng: np.random.Generator, shape: tuple[int, ...]) -> np.ndarray:
    return np.where(rng.random(shape) < 0.2, rng.choice([0.0, 1.0], shape), rng.random(shape))


def looped(
    function: Callable[..., list[float]], *batched: np.ndarray, **settings: float
) -> np.ndarray:
    """The reference, one game of the batch after the other."""
    games = zip(*(np.moveaxis(array, -1, 0).tolist() for array in batched), strict=True)
    return np.stack([function(*game, **settings) for game in games], axis=-1)


def test_1000_random_rounds_match_the_reference() -> None:
    rng = np.random.default_rng(0)
    for _ in range(1000):
        game = random_game(rng)
        lam = rng.choice([0.5, rng.uniform(0.5, 1)])
        tor = looped(reference.rater_trust, game.ratings, game.mask, game.tor, lam=lam)
        top = looped(reference.provider_trust, *game, lam=lam)
        if rng.random() < 0.3:  # one game, without a batch axis
            game, tor, top = game.map(lambda a: a[..., 0]), tor[..., 0], top[..., 0]
        for asarray in (np.asarray, torch.asarray):
            inputs = game.map(asarray)
            assert_close(raters(inputs, lam), tor)
            assert_close(providers(inputs, lam), top)


@NAMESPACES
def test_1000_random_agents_match_the_reference(asarray: Callable) -> None:
    rng = np.random.default_rng(0)
    for _ in range(1000):
        shape = tuple(rng.integers(1, 6, 2))
        tor, top = random_trust(rng, shape), random_trust(rng, shape)
        rated, provided = rng.integers(0, 4, (2, *shape))
        initial = rng.random()
        expected = looped(reference.agent_trust, tor, top, rated, provided, initial=initial)
        counts = {"rated": asarray(rated), "provided": asarray(provided)}
        assert_close(agent_trust(asarray(tor), asarray(top), **counts, initial=initial), expected)


# --- properties -----------------------------------------------------------------------------------

anything = st.floats(0, 1)
steps = st.integers(0, 64).map(
    lambda k: k / 64
)  # sums of these are exact, in whatever order they are taken
lams = st.floats(0.5, 1, exclude_max=True)


@st.composite
def games(draw: st.DrawFn, values: st.SearchStrategy[float] = steps) -> Game:
    s, p = draw(st.integers(1, 5)), draw(st.integers(1, 5))
    batch = draw(st.sampled_from([(), (1,), (3,), (2, 2)]))

    def cells(*shape: int, of: st.SearchStrategy = values, dtype: type = np.float64) -> np.ndarray:
        return draw(arrays(dtype, (*shape, *batch), elements=of))

    return Game(
        ratings=cells(s, p),
        mask=cells(s, p, of=st.booleans(), dtype=np.bool_),
        tor=cells(s),
        top=cells(p),
        last=cells(s, p),
        elapsed=cells(s, p, of=st.integers(0, 9), dtype=np.int64),
    )


@given(games(anything), lams, st.sampled_from([np.float64, np.float32]))
def test_trust_stays_between_0_and_1(game: Game, lam: float, precision: type) -> None:
    game = game.map(lambda a: in_precision(a, precision))
    for trust in (raters(game, lam), providers(game, lam)):
        assert np.all((trust >= 0) & (trust <= 1))


@given(games(anything), lams, st.sampled_from([0.0, 1.0]))
def test_no_trust_and_full_trust_move_by_at_most_lam(
    game: Game, lam: float, previous: float
) -> None:
    tor, top = np.full_like(game.tor, previous), np.full_like(game.top, previous)
    for trust in (raters(game._replace(tor=tor), lam), providers(game._replace(top=top), lam)):
        assert np.all(np.abs(trust - previous) <= lam + TOLERANCE)
        assert np.all((trust >= 0) & (trust <= 1))


@given(games(), lams, st.data())
def test_permuting_agents_permutes_their_trust(game: Game, lam: float, data: st.DataObject) -> None:
    i = np.array(data.draw(st.permutations(range(len(game.tor)))))
    j = np.array(data.draw(st.permutations(range(len(game.top)))))
    cells = np.ix_(i, j)
    permuted = Game(
        ratings=game.ratings[cells],
        mask=game.mask[cells],
        tor=game.tor[i],
        top=game.top[j],
        last=game.last[cells],
        elapsed=game.elapsed[cells],
    )
    assert_close(raters(permuted, lam), raters(game, lam)[i])
    assert_close(providers(permuted, lam), providers(game, lam)[j])


@given(games(), lams)
def test_a_batch_is_its_games_one_by_one(game: Game, lam: float) -> None:
    for function in (raters, providers):
        together = function(game, lam)
        for index in np.ndindex(game.ratings.shape[2:]):
            single = game.map(lambda a, index=index: a[..., *index])
            assert_close(function(single, lam), together[..., *index])


@given(games(), lams)
def test_numpy_and_torch_agree(game: Game, lam: float) -> None:
    tensors = game.map(torch.asarray)
    for function in (raters, providers):
        trust = function(tensors, lam)
        assert isinstance(trust, torch.Tensor)
        assert_close(trust, function(game, lam))


@given(games(anything), lams)
def test_who_took_no_part_keeps_its_trust(game: Game, lam: float) -> None:
    idle, unrated = ~game.mask.any(axis=1), ~game.mask.any(axis=0)
    assert np.array_equal(raters(game, lam)[idle], game.tor[idle])
    assert np.array_equal(providers(game, lam)[unrated], game.top[unrated])


@given(games())
def test_inputs_are_not_mutated(game: Game) -> None:
    for asarray in (np.asarray, torch.asarray):
        inputs = game.map(lambda a, asarray=asarray: asarray(a.copy()))
        raters(inputs), providers(inputs)
        for after, before in zip(inputs, game, strict=True):
            assert np.array_equal(np.asarray(after), before)


@given(games())
def test_agents_trust_lies_between_their_two_roles(game: Game) -> None:
    n = min(len(game.tor), len(game.top))
    tor, top, rated, provided = (
        game.tor[:n],
        game.top[:n],
        game.elapsed[:n, 0],
        game.elapsed[:n, -1],
    )
    trust = agent_trust(tor, top, rated=rated, provided=provided, initial=0.3)
    idle = rated + provided == 0
    assert np.all(trust[idle] == 0.3)
    assert np.all((trust >= np.minimum(tor, top) - TOLERANCE)[~idle])
    assert np.all((trust <= np.maximum(tor, top) + TOLERANCE)[~idle])
    assert np.array_equal(trust[(rated > 0) & (provided == 0)], tor[(rated > 0) & (provided == 0)])
    assert np.array_equal(trust[(rated == 0) & (provided > 0)], top[(rated == 0) & (provided > 0)])


# --- conventions ----------------------------------------------------------------------------------


@pytest.fixture
def game() -> Game:
    """Two raters, three providers, four games, everyone rated and rated before."""
    rng = np.random.default_rng(0)
    cells = (2, 3, 4)
    return Game(
        ratings=rng.random(cells),
        mask=np.ones(cells, dtype=bool),
        tor=rng.random((2, 4)),
        top=rng.random((3, 4)),
        last=rng.random(cells),
        elapsed=np.ones(cells, dtype=np.int64),
    )


@NAMESPACES
def test_raters_that_agree_keep_full_trust(asarray: Callable) -> None:
    """Whatever they agree on: the mean of equal ratings is that rating, to the last bit."""
    notes = np.random.default_rng(0).random(1000)
    for n in range(1, 12):
        ratings = asarray(np.tile(notes, (n, 1, 1)))
        trust = rater_trust(ratings, ratings >= 0, previous=asarray(np.ones((n, 1000))), lam=0.5)
        assert_close(trust, np.ones((n, 1000)))


@NAMESPACES
@pytest.mark.parametrize("precision", [np.float64, np.float32])
def test_a_leap_from_0_to_1_earns_nothing(asarray: Callable, precision: type, game: Game) -> None:
    """Not even a trust below 0, which a rounded sin(pi) would give."""
    leap = game._replace(
        ratings=np.ones_like(game.ratings),
        last=np.zeros_like(game.last),
        top=np.zeros_like(game.top),
    )
    trust = np.asarray(providers(leap.map(lambda a: asarray(in_precision(a, precision)))))
    assert np.all((trust >= 0) & (trust < 1e-6))


@NAMESPACES
def test_cells_outside_the_mask_are_never_read(asarray: Callable, game: Game) -> None:
    rated = np.random.default_rng(1).random(game.mask.shape) < 0.5
    seen = game._replace(mask=rated)
    unseen = seen._replace(ratings=np.where(rated, game.ratings, np.nan))
    for function in (raters, providers):
        assert_close(function(unseen.map(asarray)), function(seen))


@NAMESPACES
def test_elapsed_may_be_kept_in_floats(asarray: Callable, game: Game) -> None:
    whole = game.map(asarray)
    floats = whole._replace(elapsed=asarray(game.elapsed.astype(np.float64)))
    assert_close(providers(floats), providers(whole))


@NAMESPACES
def test_single_precision_stays_single(asarray: Callable, game: Game) -> None:
    single = game.map(lambda a: asarray(in_precision(a, np.float32)))
    counts = single.elapsed[:, 0]
    for trust, double in (
        (raters(single), raters(game)),
        (providers(single), providers(game)),
        (agent_trust(single.tor, single.tor, rated=counts, provided=counts, initial=0.5), game.tor),
    ):
        assert trust.dtype == single.ratings.dtype
        np.testing.assert_allclose(np.asarray(trust), double, rtol=0, atol=1e-5)


@pytest.mark.parametrize("lam", [-1.0, 0.0, 0.49, 1.01, float("nan")])
@pytest.mark.parametrize("function", [raters, providers])
def test_lam_out_of_range_is_refused(function: Callable, lam: float, game: Game) -> None:
    with refuses(ValueError, "lam", "0.5", "1", str(lam)):
        function(game, lam)


def test_lam_of_1_forgets_the_past_of_raters_only(game: Game) -> None:
    fresh = raters(game._replace(tor=np.zeros_like(game.tor)), lam=1)
    assert_close(raters(game, lam=1), fresh)
    with refuses(ValueError, "lam", "1"):
        providers(game, lam=1)


@pytest.mark.parametrize(
    ("function", "field", "shape"),
    [
        (raters, "mask", (3, 2, 4)),
        (raters, "mask", (2, 1, 4)),
        (raters, "tor", (3, 4)),
        (raters, "tor", (4,)),
        (providers, "mask", (2, 3)),
        (providers, "tor", (3, 4)),
        (providers, "tor", (1, 4)),
        (providers, "top", (2, 4)),
        (providers, "last", (2, 3, 1)),
        (providers, "elapsed", (2, 3)),
    ],
)
def test_shapes_that_do_not_fit_are_refused(
    function: Callable, field: str, shape: tuple, game: Game
) -> None:
    wrong = np.ones(shape, dtype=getattr(game, field).dtype)
    with refuses(ValueError, shape) as error:
        function(game._replace(**{field: wrong}))
    assert "(2, 3, 4)" in str(error.value) or str(getattr(game, field).shape) in str(error.value)


@given(st.lists(st.tuples(st.sampled_from([-0.5, 0.0, 0.25, 1.0]), st.booleans()), max_size=9))
def test_the_median_of_one_game_is_that_of_a_batch_and_the_upper_of_two(
    entries: list[tuple[float, bool]],
) -> None:
    values = np.array([value for value, _ in entries])
    present = np.array([there for _, there in entries], bool)
    chosen = sorted(values[present].tolist())
    wanted = chosen[len(chosen) // 2] if len(chosen) > 1 else 0.0
    assert upper_median(values, present) == wanted
    if entries:
        batch = upper_median(np.stack([values, values], 1), np.stack([present, present], 1))
        assert batch.tolist() == [wanted, wanted]
