"""Games are played in floats of 32 or 64 bits."""

import numpy as np
import pytest
import torch

from roletrust_env import Game, make_scenario


@pytest.mark.parametrize("like", [np.zeros((), np.float16), np.zeros((), int), torch.zeros((), dtype=torch.bfloat16)])
def test_other_dtypes_are_refused(like: object) -> None:
    with pytest.raises(ValueError, match="float32 or float64"):
        Game(make_scenario("paper-3x3"), like=like)
