"""Large teams are taken in blocks of raters, which changes nothing but the rounding of sums."""

import numpy as np
import pytest

from roletrust_env.trust import Ratings, RoleTrust
from roletrust_env.trust import ratings as prepared


@pytest.mark.parametrize("block", [1, 7, 12, 40])
@pytest.mark.parametrize("shape", [(7, 3), (5, 2, 4)], ids=str)
def test_blocks_of_raters_add_up_to_all_of_them(
    monkeypatch: pytest.MonkeyPatch, shape: tuple[int, ...], block: int
) -> None:
    model, rng = RoleTrust(), np.random.default_rng(0)
    blocked = whole = model.start(np.zeros(shape))
    for t in range(20):
        ratings, mask = rng.random(shape), None if t % 3 else rng.random(shape) < 0.6
        whole = model.update(whole, Ratings(ratings, mask))
        with monkeypatch.context() as patch:
            patch.setattr(prepared, "_LARGE", 3)
            patch.setattr(prepared, "_BLOCK", block)
            blocked = model.update(blocked, Ratings(ratings, mask))
        for one, other in zip(blocked[:4], whole[:4], strict=True):
            np.testing.assert_allclose(one, other, rtol=0, atol=1e-12)
