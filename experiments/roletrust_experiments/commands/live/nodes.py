"""`roletrust live cam`, `assess`, `manager` and `keys`: single nodes of a team, and their keys."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from roletrust_env import Game, JointPolicy, Policy, make_scenario
from roletrust_env import Scenario as Rules
from roletrust_env.evaluation.specs import parse_attacks, parse_trust_model
from roletrust_env.game.policy import Channel
from roletrust_env.world.roster import Roster
from roletrust_experiments.commands.console import console, errors
from roletrust_experiments.commands.live.options import Keys, Network, Scenario, Speed, Start, period_ns, require_live

if TYPE_CHECKING:
    from roletrust_env.live.nodes.run_loop import Timeline

_PAPER = "paper-3x3"
_UNSUPPORTED = {"treatment", "presence"}  # all readers of a topic get the same message, and a process has one name

Attack = Annotated[
    str | None,
    typer.Option(
        metavar="NAME[:key=value,...]",
        help="Attack to play instead of honest play; see `roletrust list`.",
        show_default=False,
    ),
]


def cam(
    name: Annotated[str, typer.Argument(help="Name of the provider, such as sp_0.")],
    scenario: Scenario = _PAPER,
    attack: Attack = None,
    frames: Annotated[
        str | None,
        typer.Option(
            metavar="PATH_OR_NUMBER", help="Video, image folder or camera number.", show_default="rendered scene"
        ),
    ] = None,
    loop: Annotated[bool, typer.Option("--loop", help="Start --frames again at their end.")] = False,
    keys: Keys = None,
    speed: Speed = 1.0,
    start: Start = None,
    seed: Annotated[int, typer.Option(min=0, help="Random seed of the sensor noise of bad service.")] = 0,
    network: Network = False,
) -> None:
    """Run a [bold]camera[/], which publishes one picture a round on [green]/NAME/image_raw/compressed[/].

    With --keys, the pictures are signed. Raters that have keys ignore all others.

    [bold]Examples[/]

    [dim]# the first camera of the paper, on the rendered scene[/]
    [cyan]roletrust live cam sp_0 --keys keys[/]

    [dim]# a camera that sends ten rounds of good pictures and ten of bad ones, in turn[/]
    [cyan]roletrust live cam sp_2 --attack on-off:period=20[/]

    [dim]# a real camera, on the whole network[/]
    [cyan]roletrust live cam sp_1 --frames 0 --network[/]
    """
    require_live()
    from roletrust_env.live.nodes.agent_nodes import run_camera_node

    rules = make_scenario(scenario)
    timeline = _timeline(rules, speed, start)
    policy = _policy(rules, name, attack, "quality")
    run_camera_node(
        name,
        rules,
        timeline=timeline,
        policy=policy,
        frames=frames,
        loop=loop,
        keys=keys,
        seed=seed,
        network=network,
    )


def assess(
    name: Annotated[str, typer.Argument(help="Name of the rater, such as sr_0.")],
    scenario: Scenario = _PAPER,
    attack: Attack = None,
    keys: Keys = None,
    speed: Speed = 1.0,
    start: Start = None,
    seed: Annotated[int, typer.Option(min=0, help="Random seed of the noise on the rater's links.")] = 0,
    network: Network = False,
) -> None:
    """Run a [bold]rater[/], which looks for a person in every picture and publishes on [green]/NAME/ratings[/].

    Its rating of a camera is the probability that the picture shows a person. With --keys, ratings are signed, and
    pictures and trust count only if they are signed. What it refuses is published on [green]/diagnostics[/].

    [bold]Examples[/]

    [dim]# an honest rater with signed ratings[/]
    [cyan]roletrust live assess sr_0 --keys keys[/]

    [dim]# a rater that always rates 0.2[/]
    [cyan]roletrust live assess sr_2 --attack bad-mouthing:level=0.2[/]

    [dim]# trained attackers, see `roletrust zoo`; of the coalition, this rater is a member[/]
    [cyan]roletrust live assess sr_2 --attack learned:path=rater-3x3[/]
    [cyan]roletrust live assess sr_2 --attack learned:path=universal-raters[/]
    """
    require_live()
    from roletrust_env.live.nodes.agent_nodes import run_rater_node

    rules = make_scenario(scenario)
    timeline, policy = _timeline(rules, speed, start), _policy(rules, name, attack, "ratings", "silence")
    run_rater_node(name, rules, timeline=timeline, policy=policy, keys=keys, seed=seed, network=network)


def manager(
    journal: Annotated[Path, typer.Argument(help="Journal file for the rounds; an existing journal is continued.")],
    scenario: Scenario = _PAPER,
    trust_model: Annotated[
        str, typer.Option("--model", metavar="NAME[:key=value,...]", help="Trust model; see `roletrust list`.")
    ] = "role-trust",
    keys: Keys = None,
    speed: Speed = 1.0,
    network: Network = False,
) -> None:
    """Run the [bold]manager[/], which matches ratings and publishes [green]/trust, /NAME/tor, /NAME/top[/].

    It expects the agents of the scenario from the start, and others from their first message on. With --keys, a rating
    counts only if the rater that it names has signed it, and all agents with a key may join. Without keys, only a few
    may join that the scenario does not name. Refusals are published on [green]/diagnostics[/].

    [bold]Examples[/]

    [dim]# stopped and started again, it continues with the next round[/]
    [cyan]roletrust live manager results/live.journal --keys keys[/]

    [dim]# another trust model[/]
    [cyan]roletrust live manager results/travos.journal --model travos[/]
    """
    require_live()
    from roletrust_env.live.nodes.manager_node import run_manager_node
    from roletrust_env.live.trust_tracker import Team

    rules = make_scenario(scenario)
    roster = Roster.of(rules)
    run_manager_node(
        parse_trust_model(trust_model, rules),
        journal,
        period=period_ns(rules.period_s, speed),
        team=Team(roster.rater_names, roster.provider_names),
        keys=keys,
        network=network,
        report=lambda line: errors.print(line, markup=False, soft_wrap=True),
    )


def keys(
    folder: Annotated[Path, typer.Argument(help="Folder for the keys.")],
    names: Annotated[
        list[str] | None,
        typer.Argument(help="Names of agents, or manager.", show_default="manager and the agents of the paper"),
    ] = None,
    replace: Annotated[
        bool, typer.Option("--replace", help="Replace public keys that are there without their private keys.")
    ] = False,
) -> None:
    """Make [bold]keys[/]: NAME.key, readable by its owner only, and NAME.pub for all others.

    The manager and each agent need their own private key and all public keys. Existing private keys are not changed.

    [bold]Examples[/]

    [cyan]roletrust live keys keys[/]

    [dim]# of a team of your own[/]
    [cyan]roletrust live keys keys manager sr_0 sr_1 sp_0[/]
    """
    require_live()
    from roletrust_env.live.validation import MANAGER
    from roletrust_env.live.wire.keys import make_keys

    roster = Roster.of(make_scenario(_PAPER))
    names = names or [MANAGER, *roster.rater_names, *roster.provider_names]
    new = make_keys(folder, names, replace=replace)
    old = [name for name in names if name not in new]
    console.print(f"Made in {folder}: {', '.join(new) or 'none'}", soft_wrap=True)
    if old:
        console.print(f"Unchanged: {', '.join(old)}", soft_wrap=True)


def _timeline(rules: Rules, speed: float, start: int | None) -> "Timeline":
    from roletrust_env.live.nodes.run_loop import Timeline

    period = period_ns(rules.period_s, speed)
    return Timeline.aligned(period) if start is None else Timeline(start, period)


def _policy(rules: Rules, name: str, attack: str | None, *channels: Channel) -> Policy | None:
    """Return the policy of an attack, for a node that has these action channels."""
    if attack is None:
        return None
    policies = parse_attacks([f"{name}={attack}"], rules)
    JointPolicy(Game(rules), policies)  # raises if the agent cannot play it
    attacks = policies[name].attacks
    if not attacks & set(channels) or attacks & _UNSUPPORTED:
        needed, supported = ", ".join(sorted(attacks)), " and ".join(channels)
        raise ValueError(
            f"{name} cannot play {attack}: that attacks by {needed}, but this node supports attacks by {supported} only"
        )
    return policies[name]
