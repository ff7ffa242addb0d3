"""What a compiler is given in place of calls and look-ups."""

import numpy as np
import torch

from roletrust_env.trust import algorithms


def test_the_polynomial_is_sinc_to_the_rounding_of_float32() -> None:
    x = torch.linspace(0, 1, 100_001)
    found = algorithms._sinc_polynomial(x)
    np.testing.assert_allclose(
        found.numpy(), np.sinc(x.numpy().astype(np.float64)), rtol=0, atol=1.2e-7
    )
    assert found[0] == 1
    assert found[-1] == 0
    assert bool((found.diff() <= 0).all())
