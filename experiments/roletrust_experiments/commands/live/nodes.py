"""`roletrust live cam`, `assess`, `manager` and `keys`: one node of a team, or what it needs."""

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
    from roletrust_env.live.nodes.running import Timeline

_PAPER = "paper-3x3"
_NOWHERE = {"treatment", "presence"}  # channels that no node has: a topic is the same to all, a name is of one process

Attack = Annotated[
    str | None,
    typer.Option(
        metavar="NAME[:key=value,...]",
        help="Play an attack in place of honest play; see `roletrust list`.",
        show_default=False,
    ),
]


def cam(
    name: Annotated[str, typer.Argument(help="Of the provider, such as sp_0.")],
    scenario: Scenario = _PAPER,
    attack: Attack = None,
    frames: Annotated[
        str | None,
        typer.Option(
            metavar="PATH_OR_NUMBER", help="A video, an image folder or a camera number.", show_default="rendered scene"
        ),
    ] = None,
    loop: Annotated[bool, typer.Option("--loop", help="Show --frames again where they end.")] = False,
    speed: Speed = 1.0,
    start: Start = None,
    seed: Annotated[int, typer.Option(min=0, help="Of the sensor noise of bad service.")] = 0,
    network: Network = False,
) -> None:
    """Be a [bold]camera[/]: publish pictures on [green]/NAME/image_raw/compressed[/], one a round.

    [bold]Examples[/]

    [dim]# the first camera of the paper, on the rendered scene[/]
    [cyan]roletrust live cam sp_0[/]

    [dim]# one that sells bad pictures by turns, ten rounds each[/]
    [cyan]roletrust live cam sp_2 --attack on-off:period=20[/]

    [dim]# a real camera, for all of the network[/]
    [cyan]roletrust live cam sp_1 --frames 0 --network[/]
    """
    require_live()
    from roletrust_env.live.nodes.cam import run_cam

    rules = make_scenario(scenario)
    timeline = _timeline(rules, speed, start)
    policy = _policy(rules, name, attack, "quality")
    run_cam(name, rules, timeline=timeline, policy=policy, frames=frames, loop=loop, seed=seed, network=network)


def assess(
    name: Annotated[str, typer.Argument(help="Of the rater, such as sr_0.")],
    scenario: Scenario = _PAPER,
    attack: Attack = None,
    keys: Keys = None,
    speed: Speed = 1.0,
    start: Start = None,
    seed: Annotated[int, typer.Option(min=0, help="Of the noise on its links.")] = 0,
    network: Network = False,
) -> None:
    """Be a [bold]rater[/]: look at every camera, and publish on [green]/NAME/ratings[/] how sure you are of a person.

    [bold]Examples[/]

    [dim]# an honest rater, whose ratings are signed[/]
    [cyan]roletrust live assess sr_0 --keys keys[/]

    [dim]# one that rates 0.2 whatever it sees[/]
    [cyan]roletrust live assess sr_2 --attack bad-mouthing:level=0.2[/]

    [dim]# one that was trained, see `roletrust zoo`[/]
    [cyan]roletrust live assess sr_2 --attack learned:path=agents/roletrust_agents/zoo/rater-3x3[/]
    """
    require_live()
    from roletrust_env.live.nodes.assess import run_assess

    rules = make_scenario(scenario)
    timeline, policy = _timeline(rules, speed, start), _policy(rules, name, attack, "ratings", "silence")
    run_assess(name, rules, timeline=timeline, policy=policy, keys=keys, seed=seed, network=network)


def manager(
    journal: Annotated[
        Path, typer.Argument(help="The file that every round is written to; one that is there is gone on with.")
    ],
    scenario: Scenario = _PAPER,
    trust_model: Annotated[
        str, typer.Option("--model", metavar="NAME[:key=value,...]", help="Any trust model; see `roletrust list`.")
    ] = "role-trust",
    keys: Keys = None,
    speed: Speed = 1.0,
    network: Network = False,
) -> None:
    """Be the [bold]manager[/]: match ratings round by round, and publish [green]/trust, /NAME/tor, /NAME/top[/].

    Who is in the scenario is waited for from the start, others are taken up when they come. With --keys, only ratings
    that are signed by the rater that they name count; what is refused is on [green]/diagnostics[/].

    [bold]Examples[/]

    [dim]# killed and started again, it goes on with the round after[/]
    [cyan]roletrust live manager results/live.journal --keys keys[/]

    [dim]# another trust model[/]
    [cyan]roletrust live manager results/travos.journal --model travos[/]
    """
    require_live()
    from roletrust_env.live.nodes.manage import run_manager
    from roletrust_env.live.trust_tracker import Team

    rules = make_scenario(scenario)
    roster = Roster.of(rules)
    run_manager(
        parse_trust_model(trust_model, rules),
        journal,
        period=period_ns(rules.period_s, speed),
        team=Team(roster.rater_names, roster.provider_names),
        keys=keys,
        network=network,
        tell=lambda line: errors.print(line, markup=False, soft_wrap=True),
    )


def keys(
    folder: Annotated[Path, typer.Argument(help="Where to write them.")],
    names: Annotated[list[str] | None, typer.Argument(help="Of the raters.", show_default="those of the paper")] = None,
) -> None:
    """Make [bold]keys[/] for raters: NAME.key, which only its owner may read, and NAME.pub for the manager.

    A rater needs its own private key, and the manager the public ones. Keys that are there are left as they are.

    [bold]Examples[/]

    [cyan]roletrust live keys keys sr_0 sr_1 sr_2[/]
    """
    require_live()
    from roletrust_env.live.wire.keys import make_keys

    names = names or list(Roster.of(make_scenario(_PAPER)).rater_names)
    made = make_keys(folder, names)
    old = [name for name in names if name not in made]
    console.print(f"Made in {folder}: {', '.join(made) or 'none'}", soft_wrap=True)
    if old:
        console.print(f"There already: {', '.join(old)}", soft_wrap=True)


def _timeline(rules: Rules, speed: float, start: int | None) -> "Timeline":
    from roletrust_env.live.nodes.running import Timeline

    period = period_ns(rules.period_s, speed)
    return Timeline.aligned(period) if start is None else Timeline(start, period)


def _policy(rules: Rules, name: str, attack: str | None, *channels: Channel) -> Policy | None:
    """The policy of a node that has these channels."""
    if attack is None:
        return None
    policies = parse_attacks([f"{name}={attack}"], rules)
    JointPolicy(Game(rules), policies)  # refuses what the agent cannot play
    attacks = policies[name].attacks
    if not attacks & set(channels) or attacks & _NOWHERE:
        needed, there = ", ".join(sorted(attacks)), " and ".join(channels)
        raise ValueError(f"{name} cannot play {attack}: that attacks by {needed}, and this node has {there}")
    return policies[name]
