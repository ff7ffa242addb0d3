"""Independent PPO on JAX in one file, games and learners in one compiled function: `python
docs/guide/ippo_jax.py`.

The form is that of PureJaxRL (Lu et al., 2022): `train` is a pure function of a key, so `jax.vmap`
trains many seeds at once. Each agent has a network of its own (IPPO, de Witt et al., 2020). By
default there is one, the attacker of a task.
"""

import argparse
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import optax

from roletrust_env import AttackJaxEnv
from roletrust_env.envs.jax_env import JaxEnv


class Settings(NamedTuple):
    """The settings of a training."""

    games: int = 64
    rounds: int = 24  # between two updates
    updates: int = 200
    epochs: int = 4
    parts: int = 4  # of the rounds, in each epoch
    hidden: int = 64
    rate: float = 1e-3
    gamma: float = 0.95
    lam: float = 0.95
    clip: float = 0.2
    entropy: float = 0.001


class Sample(NamedTuple):
    """What an agent did and got in some rounds, each of shape (rounds, games, ...)."""

    seen: Any
    action: Any
    log_prob: Any
    value: Any
    reward: Any
    over: Any


def network(key: Any, inputs: int, outputs: int, hidden: int) -> dict[str, Any]:
    """Return the weights of an actor and a critic with one hidden layer each."""
    keys, orthogonal = jax.random.split(key, 4), jax.nn.initializers.orthogonal
    shapes = {
        "actor": (inputs, hidden),
        "mean": (hidden, outputs),
        "critic": (inputs, hidden),
        "value": (hidden, 1),
    }
    scales = {"actor": 2**0.5, "mean": 0.01, "critic": 2**0.5, "value": 1.0}
    weights = {
        name: (orthogonal(scales[name])(k, shape), jnp.zeros(shape[1]))
        for (name, shape), k in zip(shapes.items(), keys, strict=True)
    }
    return {**weights, "log_spread": jnp.full(outputs, -1.0)}


def act(weights: dict[str, Any], seen: Any) -> tuple[Any, Any, Any]:
    """Return the mean and the spread of the actions, and the value."""

    def layer(name: str, x: Any) -> Any:
        return x @ weights[name][0] + weights[name][1]

    value = layer("value", jnp.tanh(layer("critic", seen)))[..., 0]
    return (
        0.5 + layer("mean", jnp.tanh(layer("actor", seen))),
        jnp.exp(weights["log_spread"]),
        value,
    )


def log_probability(mean: Any, spread: Any, action: Any) -> Any:
    """Return the logarithm of the density of an action; the constant is left out."""
    return (-0.5 * ((action - mean) / spread) ** 2 - jnp.log(spread)).sum(axis=-1)


def advantages(sample: Sample, last: Any, settings: Settings) -> Any:
    """Return the generalised advantage estimates (Schulman et al., 2016), (rounds, games)."""

    def back(carry: tuple[Any, Any], step: tuple[Any, Any, Any]) -> tuple[tuple[Any, Any], Any]:
        (later, following), (reward, value, over) = carry, step
        error = reward + settings.gamma * following * (1 - over) - value
        later = error + settings.gamma * settings.lam * (1 - over) * later
        return (later, value), later

    steps = sample.reward, sample.value, sample.over
    return jax.lax.scan(back, (jnp.zeros_like(last), last), steps, reverse=True)[1]


def loss(weights: dict[str, Any], part: tuple[Sample, Any, Any], settings: Settings) -> Any:
    """Return the loss of PPO (Schulman et al., 2017)."""
    sample, advantage, target = part
    mean, spread, value = act(weights, sample.seen)
    ratio = jnp.exp(log_probability(mean, spread, sample.action) - sample.log_prob)
    advantage = (advantage - advantage.mean()) / (advantage.std() + 1e-8)
    gain = jnp.minimum(
        ratio * advantage, jnp.clip(ratio, 1 - settings.clip, 1 + settings.clip) * advantage
    )
    return (
        0.5 * ((value - target) ** 2).mean()
        - gain.mean()
        - settings.entropy * jnp.log(spread).sum()
    )


def make_train(env: JaxEnv, settings: Settings) -> Any:
    """Return the training: a pure function of a key that returns the networks and the mean reward
    of each update.
    """
    optimiser = optax.chain(optax.clip_by_global_norm(0.5), optax.adam(settings.rate, eps=1e-5))
    sizes = {
        a: (env.observation_space(a).shape[0], env.action_space(a).shape[0]) for a in env.agents
    }

    def train(key: Any) -> tuple[dict[str, Any], Any]:
        key, first, *keys = jax.random.split(key, 2 + env.num_agents)
        nets = {
            a: network(k, *sizes[a], settings.hidden) for a, k in zip(env.agents, keys, strict=True)
        }
        memories = {agent: optimiser.init(net) for agent, net in nets.items()}
        seen, state = jax.vmap(env.reset)(jax.random.split(first, settings.games))

        def play(carry: Any, key: Any) -> tuple[Any, dict[str, Sample]]:
            nets, seen, state = carry
            key, *keys = jax.random.split(key, 1 + env.num_agents)
            chosen = {}
            for agent, k in zip(env.agents, keys, strict=True):
                mean, spread, value = act(nets[agent], seen[agent])
                action = mean + spread * jax.random.normal(k, mean.shape)
                chosen[agent] = action, log_probability(mean, spread, action), value
            actions = {agent: action for agent, (action, *_) in chosen.items()}
            after, state, rewards, dones, _ = jax.vmap(env.step)(
                jax.random.split(key, settings.games), state, actions
            )
            samples = {
                a: Sample(seen[a], *chosen[a], rewards[a], dones[a].astype(float))
                for a in env.agents
            }
            return (nets, after, state), samples

        def learn(net: Any, memory: Any, sample: Sample, last: Any, key: Any) -> tuple[Any, Any]:
            advantage = advantages(sample, last, settings)
            flat = jax.tree.map(
                lambda x: x.reshape(-1, *x.shape[2:]), (sample, advantage, advantage + sample.value)
            )

            def epoch(carry: Any, key: Any) -> tuple[Any, None]:
                order = jax.random.permutation(key, settings.rounds * settings.games)
                parts = jax.tree.map(
                    lambda x: x[order].reshape(settings.parts, -1, *x.shape[1:]), flat
                )

                def improve(carry: Any, part: Any) -> tuple[Any, None]:
                    net, memory = carry
                    change, memory = optimiser.update(jax.grad(loss)(net, part, settings), memory)
                    return (optax.apply_updates(net, change), memory), None

                return jax.lax.scan(improve, carry, parts)

            return jax.lax.scan(epoch, (net, memory), jax.random.split(key, settings.epochs))[0]

        def update(carry: Any, key: Any) -> tuple[Any, dict[str, Any]]:
            nets, memories, seen, state = carry
            play_key, *keys = jax.random.split(key, 1 + env.num_agents)
            (_, seen, state), samples = jax.lax.scan(
                play, (nets, seen, state), jax.random.split(play_key, settings.rounds)
            )
            learnt = {
                a: learn(nets[a], memories[a], samples[a], act(nets[a], seen[a])[2], k)
                for a, k in zip(env.agents, keys, strict=True)
            }
            nets, memories = (
                {agent: both[part] for agent, both in learnt.items()} for part in (0, 1)
            )
            return (nets, memories, seen, state), {
                agent: sample.reward.mean() for agent, sample in samples.items()
            }

        (nets, *_), curves = jax.lax.scan(
            update, (nets, memories, seen, state), jax.random.split(key, settings.updates)
        )
        return nets, curves

    return train


def main(arguments: list[str] | None = None) -> dict[str, Any]:
    """Train an attacker with some seeds at once, and print its rewards. Return the curves, (seeds,
    updates) each.
    """
    parser = argparse.ArgumentParser(description="Train an attacker by PPO on JAX.")
    parser.add_argument(
        "--task", default="RoleTrust/ProviderAttack-v0", help="id of an attack task"
    )
    parser.add_argument("--model", default="role-trust", help="trust model under attack")
    parser.add_argument("--updates", type=int, default=Settings().updates, help="number of updates")
    parser.add_argument("--seeds", type=int, default=4, help="number of trainings, all at once")
    chosen = parser.parse_args(arguments)
    env = AttackJaxEnv(chosen.task, trust_model=chosen.model)
    train = jax.jit(jax.vmap(make_train(env, Settings(updates=chosen.updates))))
    _, curves = train(jax.random.split(jax.random.key(0), chosen.seeds))
    for agent, curve in curves.items():
        tenth = max(1, chosen.updates // 10)
        first, last = curve[:, :tenth].mean(axis=1), curve[:, -tenth:].mean(axis=1)
        print(
            f"{agent}: mean reward {first.mean():.3f} at first, {last.mean():.3f} ± "
            f"{last.std():.3f} at the end"
        )
    return curves


if __name__ == "__main__":
    main()
