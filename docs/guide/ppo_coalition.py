"""PPO (Schulman et al., 2017) for a coalition in one file: `python docs/guide/ppo_coalition.py`.

Half of ten raters lie together, in the task `liars` of the suite `learners-coalitions`. The file
prints the reward during the training and the utility of consumers in fresh games at the end: 1 if
they always got the best service. The actor is a `DeepSet` in torch, and its noise is held over each
episode: noise drawn anew in each round would cancel in smoothed trust. Copy the file to try other
algorithms; `CoalitionPpo` does the same with Stable-Baselines3.
"""

import argparse
from dataclasses import dataclass, fields

import gymnasium
import numpy as np
import torch
from torch import nn
from torch.distributions import Normal

from roletrust_agents.learned.coalition_attacker import CoalitionAttacker
from roletrust_agents.learned.deep_set import GAIN, DeepSet, DeepSetArchitecture
from roletrust_env.benchmarking.learners.suite import LearnersSuite
from roletrust_env.benchmarking.suite_files import load_suite
from roletrust_env.evaluation.measurement import TaskArguments, exact_task, score
from roletrust_env.evaluation.specs import parse_trust_model
from roletrust_env.game.coalition import FEATURES

VALIDATED, MEASURED = 54_321, 12_345
"""Random seeds of the games that choose an agent, and of those at the end."""


@dataclass(frozen=True)
class Settings:
    """Settings of a training; each is an option of the command.

    Attributes:
        model: Spec of the trust model.
        task: Task of the suite: `liars`, `coalition` or `market`.
        rounds: Number of rounds of a training, over all games.
        starts: Number of trainings; the best agent counts, since from some random networks PPO
            finds nothing.
        seed: Random seed.
        games: Number of games at once.
        learning_rate: Initial learning rate; it falls linearly to a tenth of it.
        gamma: Discount factor.
        gae_lambda: Factor of generalised advantage estimation.
        epochs: Number of passes over a rollout.
        batches: Number of batches of a pass.
        clip: Clip range of the ratio of probabilities.
        value_weight: Weight of the loss of the critic.
        gradient: Largest norm of the gradient.
        spread: Initial standard deviation of the actions, in [-1, 1].
        units: Number of units of a layer of the actor.
        critic_units: Number of units of a layer of the critic.
        measured: Number of fresh games at the end.
    """

    model: str = "beta"
    task: str = "liars"
    rounds: int = 100_000
    starts: int = 3
    seed: int = 0
    games: int = 32
    learning_rate: float = 1e-2
    gamma: float = 0.95
    gae_lambda: float = 0.95
    epochs: int = 5
    batches: int = 4
    clip: float = 0.3
    value_weight: float = 0.5
    gradient: float = 0.5
    spread: float = 0.5
    units: int = 12
    critic_units: int = 24
    measured: int = 200


class Body(nn.Module):
    """Two layers that treat providers alike: features, (B, F, P), to units, (B, P, units)."""

    def __init__(self, units: int) -> None:
        super().__init__()
        self.first, self.second = linear(len(FEATURES), units), linear(units, units)
        self.mean = linear(units, units, bias=False)

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        """Return the units of the second layer, which sees the mean over the providers."""
        x = torch.tanh(self.first(x.transpose(1, 2)))
        result: torch.Tensor = torch.tanh(self.second(x) + self.mean(x.mean(dim=1, keepdim=True)))
        return result


class Agent(nn.Module):
    """An actor and a critic, each with a body of its own.

    Args:
        settings: Settings of the training.
        channels: Outputs of the actor that are actions: 0 for lies and 1 for qualities.
    """

    def __init__(self, settings: Settings, channels: tuple[int, ...]) -> None:
        super().__init__()
        self.channels = list(channels)
        self.actor, self.decision = Body(settings.units), linear(settings.units, 3, 0.1 / GAIN)
        self.skip = linear(len(FEATURES), 3, 0.1 / GAIN, bias=False)
        self.critic, self.value = Body(settings.critic_units), linear(settings.critic_units, 1, 0.1)
        self.log_std = nn.Parameter(torch.full((2,), settings.spread).log())

    def actions(self, observations: torch.Tensor) -> Normal:
        """Return the distribution of the actions, (B, A), before they are cut to [-1, 1]."""
        features = by_provider(observations)
        decided = torch.tanh(
            GAIN * (self.decision(self.actor(features)) + self.skip(features.transpose(1, 2)))
        )
        lie, quality, gate = decided.unbind(
            -1
        )  # a gate lets a liar tell the truth, and so keep its trust
        mean = torch.stack([lie * (0.5 + 0.5 * gate), quality], dim=1)[:, self.channels]
        spread = self.log_std.exp()[self.channels, None].expand_as(mean)
        return Normal(mean.flatten(1), spread.flatten(1))

    def values(self, observations: torch.Tensor) -> torch.Tensor:
        """Return the values, (B,)."""
        values: torch.Tensor = self.value(self.critic(by_provider(observations)).mean(dim=1))[:, 0]
        return values

    def attacker(self) -> CoalitionAttacker:
        """Return the attacker that plays the mean of the actions."""
        tensors = {
            "layer0.weight": self.actor.first.weight,
            "layer0.bias": self.actor.first.bias,
            "layer1.weight": self.actor.second.weight,
            "layer1.mean": self.actor.mean.weight,
            "layer1.bias": self.actor.second.bias,
            "layer2.weight": self.decision.weight,
            "layer2.skip": self.skip.weight,
            "layer2.bias": self.decision.bias,
        }
        architecture = DeepSetArchitecture(units=len(self.actor.first.bias))
        weights = {
            name: np.zeros(shape, np.float32) for name, shape in architecture.shapes().items()
        }
        weights |= {name: tensor.detach().numpy().copy() for name, tensor in tensors.items()}
        return CoalitionAttacker(DeepSet(architecture, weights))


def linear(inputs: int, outputs: int, scale: float = 1.0, bias: bool = True) -> nn.Linear:
    """Return a layer with normal weights of the variance 1 over the number of inputs, times the
    square of a scale.
    """
    layer = nn.Linear(inputs, outputs, bias=bias)
    nn.init.normal_(layer.weight, std=scale * inputs**-0.5)
    if bias:
        nn.init.zeros_(layer.bias)
    return layer


def by_provider(observations: torch.Tensor) -> torch.Tensor:
    """Return observations, (B, F P), as features of providers, (B, F, P)."""
    return observations.reshape(len(observations), len(FEATURES), -1)


def log_prob(chances: Normal, actions: torch.Tensor) -> torch.Tensor:
    """Return the log-probability of each action, (B,), as if every round had noise of its own."""
    result: torch.Tensor = chances.log_prob(actions).sum(dim=1)  # type: ignore[no-untyped-call]
    return result


@dataclass(frozen=True)
class Rollout:
    """Rounds of all games, each array of shape (T E, ...).

    Attributes:
        observations: Observations.
        actions: Actions before they are cut.
        log_probs: Log-probabilities of these actions.
        advantages: Advantages.
        returns: Targets of the critic.
    """

    observations: torch.Tensor
    actions: torch.Tensor
    log_probs: torch.Tensor
    advantages: torch.Tensor
    returns: torch.Tensor


class Player:
    """Games in which an agent gathers rollouts.

    Args:
        envs: Games.
        seed: Random seed.
    """

    def __init__(
        self, envs: gymnasium.vector.VectorEnv[np.ndarray, np.ndarray, np.ndarray], seed: int
    ) -> None:
        self.envs = envs
        self.observation = torch.as_tensor(envs.reset(seed=seed)[0])
        self.begins = torch.ones(envs.num_envs, dtype=torch.bool)
        self.noise = torch.zeros(envs.action_space.shape or ())

    @torch.no_grad()
    def play(
        self, agent: Agent, rounds: int, gamma: float, gae_lambda: float
    ) -> tuple[Rollout, float]:
        """Return a rollout of so many rounds of each game, and the mean reward of a round."""
        observations, actions, log_probs, values, rewards, ends = [], [], [], [], [], []
        for _ in range(rounds):
            # A game keeps its noise from its first round to its last.
            self.noise = torch.where(self.begins[:, None], torch.randn_like(self.noise), self.noise)
            chances = agent.actions(self.observation)
            action = chances.mean + chances.stddev * self.noise
            observations.append(self.observation)
            actions.append(action)
            log_probs.append(log_prob(chances, action))
            values.append(agent.values(self.observation))
            after, reward, terminated, truncated, _ = self.envs.step(
                (0.5 + 0.5 * action.clip(-1, 1)).numpy()
            )
            self.observation, self.begins = (
                torch.as_tensor(after),
                torch.as_tensor(terminated | truncated),
            )
            rewards.append(torch.as_tensor(reward, dtype=torch.float32))
            ends.append(self.begins)
        advantages, following = [], agent.values(self.observation)
        advantage = torch.zeros_like(following)
        for gain, value, end in zip(rewards[::-1], values[::-1], ends[::-1], strict=True):
            # The clock is observed, so that nothing follows the end of a game.
            error = gain + gamma * torch.where(end, 0.0, following) - value
            advantage = error + gamma * gae_lambda * torch.where(end, 0.0, advantage)
            following = value
            advantages.append(advantage)
        better = torch.cat(advantages[::-1])
        seen, done, chance = (torch.cat(parts) for parts in (observations, actions, log_probs))
        return Rollout(seen, done, chance, better, better + torch.cat(values)), torch.cat(
            rewards
        ).mean().item()


def update(
    agent: Agent, optimiser: torch.optim.Optimizer, rollout: Rollout, settings: Settings
) -> None:
    """Improve an agent by a rollout."""
    for _ in range(settings.epochs):
        for rows in torch.randperm(len(rollout.actions)).chunk(settings.batches):
            chances = agent.actions(rollout.observations[rows])
            ratio = (log_prob(chances, rollout.actions[rows]) - rollout.log_probs[rows]).exp()
            advantage = rollout.advantages[rows]
            advantage = (advantage - advantage.mean()) / (advantage.std() + 1e-8)
            clipped = ratio.clip(1 - settings.clip, 1 + settings.clip)
            gain = torch.min(ratio * advantage, clipped * advantage).mean()
            error = (
                (agent.values(rollout.observations[rows]) - rollout.returns[rows]).square().mean()
            )
            optimiser.zero_grad()
            (settings.value_weight * error - gain).backward()  # type: ignore[no-untyped-call]
            nn.utils.clip_grad_norm_(agent.parameters(), settings.gradient)
            optimiser.step()


def condition(settings: Settings) -> TaskArguments:
    """Return the arguments of the task, in which the coalition acts as one mind."""
    suite = load_suite("learners-coalitions")
    assert isinstance(suite, LearnersSuite)
    arguments = suite.tasks[settings.task].arguments()
    model = parse_trust_model(settings.model, arguments["scenario"])
    return {**arguments, "trust_model": model}


def train(settings: Settings) -> Agent:
    """Return the best of several trained agents, as validation games choose it."""
    agents = [
        train_once(settings, settings.seed * settings.starts + start)
        for start in range(settings.starts)
    ]
    return min(agents, key=lambda agent: utility(agent, settings, VALIDATED))


def train_once(settings: Settings, seed: int) -> Agent:
    """Return a trained agent, and print the mean reward of a round a few times."""
    arguments = condition(settings)
    task = exact_task(arguments)
    rounds = task.game.scenario.max_cycles
    updates = settings.rounds // (settings.games * rounds)
    if updates < 1:
        raise ValueError(f"rounds is {settings.rounds}; give {settings.games * rounds} or more")
    roles = {task.game.roster.role(name) for name in task.compromised}
    torch.manual_seed(seed)
    agent = Agent(
        settings, tuple(k for k, role in enumerate(("SR", "SP")) if {role, "SR+SP"} & roles)
    )
    optimiser = torch.optim.Adam(agent.parameters(), lr=settings.learning_rate, eps=1e-5)
    envs = gymnasium.make_vec(
        "RoleTrust/RaterAttack-v0", num_envs=settings.games, autoreset_mode="SameStep", **arguments
    )
    player = Player(envs, seed)
    for number in range(updates):
        optimiser.param_groups[0]["lr"] = settings.learning_rate * (1 - 0.9 * number / updates)
        rollout, reward = player.play(agent, rounds, settings.gamma, settings.gae_lambda)
        update(agent, optimiser, rollout, settings)
        if (number + 1) % max(1, updates // 10) == 0:
            played = (number + 1) * settings.games * rounds
            spread = agent.log_std[agent.channels[0]].exp().item()
            print(f"{played:>9,} rounds  reward {reward:.3f}  spread {spread:.2f}")
    envs.close()
    return agent


def utility(agent: Agent, settings: Settings, seed: int = MEASURED) -> float:
    """Return the mean utility of consumers in fresh games against the trained coalition."""
    task = exact_task(condition(settings))
    return float(
        score(task, agent.attacker(), seed, (1, settings.measured)).scores["utility"].mean()
    )


def main(words: list[str] | None = None) -> None:
    """Train and measure a coalition with the settings of the command line."""
    parser = argparse.ArgumentParser(description="PPO for a coalition in one file.")
    for field in fields(Settings):
        parser.add_argument(
            f"--{field.name.replace('_', '-')}", type=type(field.default), default=field.default
        )
    settings = Settings(**vars(parser.parse_args(words)))
    agent = train(settings)
    print(
        f"utility {utility(agent, settings):.3f} in {settings.measured} fresh games, "
        f"{settings.model}"
    )


if __name__ == "__main__":
    main()
