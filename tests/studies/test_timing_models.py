"""What trust models cost: which sizes are measured, which are left out, and how the growth is read."""

from functools import partial
from typing import Any

import numpy as np
import pytest

from roletrust_env.trust import Mean, Ratings, RoleTrust
from studies.timing.contestants import Contestant, Timing
from studies.timing.models import (
    LIBRARIES,
    Cell,
    Found,
    Limits,
    Size,
    Trial,
    growth,
    measure_models,
    sizes,
    too_much,
    trust_update,
)
from studies.timing.threads import torch_threads

pytestmark = pytest.mark.slow

quickly = partial(measure_models, repeats=2, slice_s=1e-9)


def test_numpy_has_the_sizes_from_which_growth_is_read() -> None:
    assert sizes((3, 30, 300), "NumPy") == [(3, 3), (30, 30), (30, 300), (300, 30), (300, 300)]
    assert sizes((3, 30, 300), "compiled torch") == [(3, 3), (30, 30), (300, 300)]


def test_every_model_is_timed_at_every_size() -> None:
    seen: list[str] = []
    models = {"role-trust": RoleTrust(), "mean": Mean()}
    found = quickly(models, (2, 3), advance=seen.append)
    assert list(found) == [(name, "NumPy", size) for size in sizes((2, 3), "NumPy") for name in models]
    assert len(seen) == len(found)
    for (name, _, size), cell in found.items():
        assert cell.timing is not None
        assert (cell.timing.contestant.name, cell.timing.contestant.ratings) == (name, size.raters * size.providers)
        assert len(cell.timing.seconds) == 2


def test_a_model_may_ask_who_is_who_and_nobody_rates_itself() -> None:
    seen = []

    class Sociable(Mean):
        takes_peers = True

        def start(self, like: Any, peers: Any) -> Any:  # type: ignore[override]
            seen.append(peers)
            return super().start(like)

        def update(self, state: Any, ratings: Ratings) -> Any:
            seen.append(ratings.mask)
            return super().update(state, ratings)

    trust_update("sociable", Sociable(), Size(2, 3), "NumPy", seed=0).step()
    assert np.array_equal(seen[0], np.eye(2, 3, dtype=bool))
    assert all(np.array_equal(mask, ~seen[0]) for mask in seen[1:])


def test_a_model_that_fails_is_left_out_and_harms_no_other() -> None:
    class Broken(Mean):
        def update(self, state: Any, ratings: Ratings) -> Any:
            if ratings.shape[0] > 2:
                raise RuntimeError("too many raters\nand a long story")
            return super().update(state, ratings)

    found = quickly({"broken": Broken(), "mean": Mean()}, (2, 3))
    assert found["broken", "NumPy", Size(2, 3)].timing
    assert found["broken", "NumPy", Size(3, 2)] == Cell(None, "too many raters")
    assert all(found["mean", "NumPy", size].timing for size in sizes((2, 3), "NumPy"))


def test_what_would_take_too_much_is_left_out_in_every_library() -> None:
    found = quickly({"mean": Mean()}, (2, 3), LIBRARIES[:1], limits=Limits(seconds=0))
    assert "an update would take about" in found["mean", "NumPy", Size(3, 3)].left_out
    assert all(found["mean", "NumPy", size].timing for size in sizes((2, 3), "NumPy")[:-1])


def test_what_an_update_takes_is_foretold_from_smaller_ones() -> None:
    """S^2 P: 10 times the raters take 100 times the time, 10 times the providers 10 times."""
    trials = {Size(30, 30): Trial(0.01, 1e6), Size(30, 300): Trial(0.1, 1e7), Size(300, 30): Trial(1.0, 1e8)}
    large = Size(300, 300)
    assert "10 seconds" in too_much(trials, large, Limits(seconds=9, memory=1e12))
    assert "1 GB" in too_much(trials, large, Limits(seconds=11, memory=0.9e9))
    assert not too_much(trials, large, Limits(seconds=11, memory=1.1e9))
    assert not too_much(trials, Size(300, 3000), Limits(0, 0))  # nothing tried tells of it


def test_growth_is_the_power_between_the_largest_sizes() -> None:
    def cell(size: Size, seconds: float) -> Cell:
        return Cell(Timing(Contestant("x", 1, 1, lambda: None, size.raters * size.providers), (seconds,)))

    found: Found = {
        ("x", "NumPy", size): cell(size, (size.raters**2 * size.providers + 50) / 1e9)
        for size in sizes((3, 30, 300), "NumPy")
    }
    assert growth(found, "x") == pytest.approx((2, 1), abs=1e-3)
    found["x", "NumPy", Size(300, 300)] = Cell(None, "too much")
    assert growth(found, "x") == pytest.approx((2, 1), abs=1e-2)
    assert np.isnan(growth(found, "y")).all()


@pytest.mark.slow
def test_a_model_is_timed_compiled() -> None:
    torch = pytest.importorskip("torch")
    contestant = trust_update("role-trust", RoleTrust(), Size(2, 3), "compiled torch", seed=0)
    state, raters, providers = contestant.step()
    assert isinstance(state, tuple)
    assert (tuple(raters.shape), tuple(providers.shape), raters.dtype) == ((2,), (3,), torch.float32)


def test_threads_of_torch_are_as_before_afterwards() -> None:
    torch = pytest.importorskip("torch")
    before = torch.get_num_threads()
    with torch_threads(3):
        assert torch.get_num_threads() == 3
    assert torch.get_num_threads() == before
