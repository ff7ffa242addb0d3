"""An agent of a team: the camera of a provider, or a rater of all cameras."""

from pathlib import Path
from typing import Literal

from roletrust_env import Game, JointPolicy, Policy, Scenario, make_scenario
from roletrust_env.evaluation.specs import parse_attacks
from roletrust_env.parameters import whole_number
from roletrust_manager.dds.nodes.agent_nodes import run_camera_node, run_rater_node
from roletrust_manager.dds.nodes.run_loop import Timeline, round_period
from roletrust_manager.team import Team

Role = Literal["rater", "provider"]
_CHANNELS = {"rater": {"ratings", "silence"}, "provider": {"quality"}}
# all readers of a topic get the same message, and a process has one name
_UNSUPPORTED = {"treatment", "presence"}


def run_agent(
    name: str,
    *,
    role: Role | None = None,
    attack: str | None = None,
    frames: str | None = None,
    keys: Path | None = None,
    scenario: str = "paper-3x3",
    speed: float = 1.0,
    network: bool = False,
    seed: int = 0,
) -> None:
    """Run an agent until a signal ends the process.

    Args:
        name: Name of an agent of the scenario, such as `sp_0`.
        role: Role to play; needed for an agent that has both.
        attack: Attack to play, `NAME[:key=value,...]`; None for honest play.
        frames: Pictures of a provider, see `run_camera_node`; None for those of the scenario.
        keys: Folder with the agent's private key and all public keys; None for no signatures.
        scenario: Name or file of the scenario, which sets agents, rounds and disturbances.
        speed: Speed relative to the scenario's clock, from 0.1 to 20.
        network: Whether to communicate with other machines, too.
        seed: Random seed of the noise of bad service, or of the noise on a rater's links, 0 or
            more.

    Raises:
        ValueError: The agent cannot play the role or the attack, a rater has frames, or another
            argument is not allowed.
    """
    rules = make_scenario(scenario)
    timeline = Timeline.aligned(round_period(rules.period_s, speed))
    seed = whole_number("seed", seed)
    played = _role(Team.of(rules), name, role)
    policy = None if attack is None else _policy(rules, name, attack, played)
    if played == "provider":
        run_camera_node(
            name,
            rules,
            timeline=timeline,
            policy=policy,
            frames=frames,
            keys=keys,
            seed=seed,
            network=network,
        )
    elif frames is not None:
        raise ValueError(f"frames must be those of a provider, and {name!r} is a rater")
    else:
        run_rater_node(
            name, rules, timeline=timeline, policy=policy, keys=keys, seed=seed, network=network
        )


def _role(team: Team, name: str, wanted: Role | None) -> Role:
    """Return the role that an agent plays."""
    names: dict[Role, tuple[str, ...]] = {"rater": team.raters, "provider": team.providers}
    roles = [role for role in names if name in names[role] and wanted in (None, role)]
    if not roles:
        known = names[wanted] if wanted else (*team.raters, *team.providers)
        raise ValueError(
            f"there is no {wanted or 'agent'} {name!r}; the scenario has {', '.join(known)}"
        )
    if len(roles) > 1:
        raise ValueError(f"role must be rater or provider, since {name!r} has both")
    return roles[0]


def _policy(rules: Scenario, name: str, attack: str, role: Role) -> Policy:
    """Return the policy of an attack that a node of this role can play."""
    policies = parse_attacks([f"{name}={attack}"], rules)
    JointPolicy(Game(rules), policies)  # raises if the agent cannot play it
    attacks, supported = policies[name].attacks, _CHANNELS[role]
    if not attacks & supported or attacks & _UNSUPPORTED:
        raise ValueError(
            f"{name} must attack by {' or '.join(sorted(supported))} only, and {attack} attacks by "
            f"{', '.join(sorted(attacks))}"
        )
    return policies[name]
