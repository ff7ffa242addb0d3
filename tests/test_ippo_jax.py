"""The example of independent PPO on JAX learns."""

import numpy as np
import pytest

pytest.importorskip("optax")
ippo_jax = pytest.importorskip("ippo_jax")
pytestmark = pytest.mark.slow


def test_the_attacker_learns(capsys):
    (curve,) = ippo_jax.main(["--updates", "60", "--seeds", "2"]).values()
    assert curve.shape == (2, 60)
    assert np.asarray(curve[:, -6:]).mean() > np.asarray(curve[:, :6]).mean() + 0.02
    assert "attacker: mean reward" in capsys.readouterr().out


def test_many_agents_have_networks_of_their_own():
    import jax

    from roletrust_env import RoleTrustJaxEnv

    env = RoleTrustJaxEnv("peers", max_cycles=10, agents=[{"role": "SR+SP", "count": 3}])
    train = ippo_jax.make_train(env, ippo_jax.Settings(games=4, rounds=8, updates=2, hidden=8))
    nets, curves = jax.jit(train)(jax.random.key(0))
    assert list(nets) == list(curves) == env.agents
    assert all(np.isfinite(curve).all() for curve in curves.values())
