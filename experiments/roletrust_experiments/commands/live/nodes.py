"""`roletrust live agent`, `manager` and `keys`: single nodes of a team, and their keys."""

from functools import partial
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from roletrust_env import Game, JointPolicy, Policy, make_scenario
from roletrust_env import Scenario as Rules
from roletrust_env.errors import printable
from roletrust_env.evaluation.specs import parse_attacks, parse_trust_model
from roletrust_env.game.policy import Channel
from roletrust_env.storage.files import replacing
from roletrust_env.trust import TrustModel
from roletrust_experiments.commands.console import errors, progress_bar, stage, tell
from roletrust_experiments.commands.extras import require_live
from roletrust_experiments.commands.live.options import Keys, Network, Scenario, Speed, period_ns
from roletrust_experiments.commands.options import NAMED
from roletrust_manager.team import Team

_PAPER = "paper-3x3"
_UNSUPPORTED = {
    "treatment",
    "presence",
}  # all readers of a topic get the same message, and a process has one name

Role = Literal["rater", "provider"]


def agent(
    name: Annotated[
        str, typer.Argument(help="Name of an agent of the scenario, such as sp_0 or sr_0.")
    ],
    scenario: Scenario = _PAPER,
    role: Annotated[
        Role | None, typer.Option(help="Role to play; needed for an agent that has both.")
    ] = None,
    attack: Annotated[
        str | None,
        typer.Option(
            metavar=NAMED, help="Attack to play instead of honest play; see `roletrust list`."
        ),
    ] = None,
    frames: Annotated[
        str | None,
        typer.Option(
            metavar="PATH_OR_NUMBER",
            help="Video, image folder or camera number in place of the scenario's.",
        ),
    ] = None,
    loop: Annotated[
        bool, typer.Option("--loop", help="Start a video or image folder again at its end.")
    ] = False,
    keys: Keys = None,
    speed: Speed = 1.0,
    start: Annotated[
        int | None,
        typer.Option(
            min=10**18,
            max=2**31 * 10**9 - 1,
            help="Start of round 0, ns since 1970; the next whole period if left out.",
        ),
    ] = None,
    seed: Annotated[
        int,
        typer.Option(
            min=0,
            help="Random seed of the noise of bad service, or of the noise on a rater's links.",
        ),
    ] = 0,
    rounds: Annotated[
        int | None,
        typer.Option(
            min=1,
            max=10**9,
            help="Rounds until the agent ends; without it, the agent runs until Ctrl-C.",
        ),
    ] = None,
    network: Network = False,
) -> None:
    """Run an [bold]agent[/] of a team: a camera for a provider, and an assessor of pictures for a
    rater.

    A provider is the node [green]/NAME/cam[/], which publishes one picture a round on
    [green]/NAME/image_raw/compressed[/]. A rater is the node [green]/NAME/assess[/], which looks
    for a person in every picture: its rating of a camera, on [green]/NAME/ratings[/], is the
    probability that the picture shows one.

    It runs until Ctrl-C, however many rounds the scenario has; the disturbances come once. With
    --rounds, it says when it will end, and that it has ended.

    With --keys, pictures and ratings are signed, and agents that have keys ignore what is not. What
    a rater refuses is published on [green]/diagnostics[/].

    [bold]Examples[/]

    [dim]# the first camera of the paper, on the rendered scene, and an honest rater[/]
    [cyan]roletrust live agent sp_0 --keys keys[/]
    [cyan]roletrust live agent sr_0 --keys keys[/]

    [dim]# a real camera, on the whole network; a video again and again, for an hour[/]
    [cyan]roletrust live agent sp_1 --frames 0 --network[/]
    [cyan]roletrust live agent sp_1 --frames walk.mp4 --loop --rounds 7200[/]

    [dim]# a camera with ten rounds of good pictures and ten of bad ones, in turn; a rater that
    always rates 0.2[/]
    [cyan]roletrust live agent sp_2 --attack on-off:period=20[/]
    [cyan]roletrust live agent sr_2 --attack bad-mouthing:level=0.2[/]

    [dim]# trained attackers, see `roletrust list`; of the coalition, this rater is a member[/]
    [cyan]roletrust live agent sr_2 --attack learned:path=rater-3x3[/]
    [cyan]roletrust live agent sr_2 --attack learned:path=universal-raters[/]
    """
    require_live()
    from roletrust_manager.dds.nodes.agent_nodes import run_camera_node, run_rater_node
    from roletrust_manager.dds.nodes.run_loop import Timeline

    rules = make_scenario(scenario)
    period, played = period_ns(rules.period_s, speed), _role(Team.of(rules), name, role)
    timeline = Timeline.aligned(period) if start is None else Timeline(start, period)
    report = partial(tell, where=errors)
    shared: Any = {
        "timeline": timeline,
        "keys": keys,
        "seed": seed,
        "network": network,
        "rounds": rounds,
    }
    shared["report"] = report
    if played == "provider":
        policy = _policy(rules, name, attack, "quality")
        run_camera_node(name, rules, policy=policy, frames=frames, loop=loop, **shared)
    else:
        if frames is not None or loop:
            raise ValueError(
                f"--frames and --loop are for the pictures of a provider, and {name} plays a rater"
            )
        policy = _policy(rules, name, attack, "ratings", "silence")
        run_rater_node(name, rules, policy=policy, **shared)


def manager(
    journal: Annotated[
        Path, typer.Argument(help="Journal file for the rounds; an existing journal is continued.")
    ],
    scenario: Scenario = _PAPER,
    trust_model: Annotated[
        str, typer.Option("--model", metavar=NAMED, help="Trust model; see `roletrust list`.")
    ] = "role-trust",
    keys: Keys = None,
    speed: Speed = 1.0,
    network: Network = False,
    recording: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR", help="Recording to play in place of the network, into a new journal."
        ),
    ] = None,
) -> None:
    """Run the [bold]manager[/], which matches ratings and publishes [green]/trust, /NAME/tor,
    /NAME/top[/].

    It expects the agents of the scenario from the start, and others from their first message on.
    With --keys, a rating counts only if the rater that it names has signed it, and all agents with
    a key may join. Without keys, only a few may join that the scenario does not name. Refusals are
    published on [green]/diagnostics[/].

    With --recording, it does the same with recorded messages: with the same model and keys, the
    trust is the same to the last bit.

    [bold]Examples[/]

    [dim]# stopped and started again, it continues with the next round[/]
    [cyan]roletrust live manager results/live.journal --keys keys[/]

    [dim]# another trust model[/]
    [cyan]roletrust live manager results/travos.journal --model travos[/]

    [dim]# the trust that TRAVOS would have published[/]
    [cyan]roletrust live manager results/travos.jsonl --model travos --recording results/bag[/]
    """
    require_live()
    from roletrust_manager.dds.nodes.manager_node import run_manager_node

    rules = make_scenario(scenario)
    model, period, team = (
        parse_trust_model(trust_model, rules),
        period_ns(rules.period_s, speed),
        Team.of(rules),
    )
    if recording is not None:
        _replay(recording, journal, model, period, team, keys)
        return
    report = partial(tell, where=errors)
    run_manager_node(
        model, journal, period=period, team=team, keys=keys, network=network, report=report
    )


def _replay(
    recording: Path,
    journal: Path,
    model: TrustModel[Any],
    period: int,
    team: Team,
    keys: Path | None,
) -> None:
    """Play a recording through a manager, and print what came of it."""
    from roletrust_manager.admission.keys import PublicKeys
    from roletrust_manager.dds.manager import Manager
    from roletrust_manager.dds.nodes.manager_node import replay_recording
    from roletrust_manager.dds.rounds import RoundTiming
    from roletrust_manager.dds.wire.recording import read_recording

    if journal.exists():
        raise ValueError(f"{journal} exists already; a recording needs a new journal")
    with progress_bar(errors) as progress, replacing(journal) as path:
        keyring = None if keys is None else PublicKeys(keys)
        manager = Manager(model, path, timing=RoundTiming(period), team=team, keyring=keyring)
        messages = read_recording(recording, stage(progress, f"Playing {recording.name}"))
        rounds = sum(1 for _ in replay_recording(messages, manager, period))
        manager.close()
    counts = manager.admission.refusals.items()
    refusals = ", ".join(
        f"{printable(rater) or 'unknown'} {reason}: {n}" for (rater, reason), n in counts
    )
    tell(f"{rounds} rounds, written to {journal}; refused: {refusals or 'nothing'}")


def keys(
    folder: Annotated[Path, typer.Argument(help="Folder for the keys.")],
    names: Annotated[
        list[str] | None,
        typer.Argument(
            help="Names of agents, or manager.", show_default="manager and the agents of the paper"
        ),
    ] = None,
    replace: Annotated[
        bool,
        typer.Option(
            "--replace", help="Replace public keys that are there without their private keys."
        ),
    ] = False,
) -> None:
    """Make [bold]keys[/]: NAME.key, readable by its owner only, and NAME.pub for all others.

    The manager and each agent need their own private key and all public keys. Existing private keys
    are not changed.

    [bold]Examples[/]

    [cyan]roletrust live keys keys[/]

    [dim]# of a team of your own[/]
    [cyan]roletrust live keys keys manager sr_0 sr_1 sp_0[/]
    """
    require_live()
    from roletrust_manager.admission.keys import make_keys
    from roletrust_manager.admission.validation import MANAGER

    team = Team.of(make_scenario(_PAPER))
    names = names or [MANAGER, *team.raters, *team.providers]
    new = make_keys(folder, names, replace=replace)
    old = [name for name in names if name not in new]
    tell(f"Made in {folder}: {', '.join(new) or 'none'}")
    if old:
        tell(f"Unchanged: {', '.join(old)}")


def _role(team: Team, name: str, wanted: Role | None) -> Role:
    """Return the role that an agent plays.

    Raises:
        ValueError: The scenario has no such agent, or it has not that role, or has both.
    """
    names: dict[Role, tuple[str, ...]] = {"rater": team.raters, "provider": team.providers}
    roles = [role for role in names if name in names[role]]
    if not roles:
        raise ValueError(
            f"there is no agent {name!r}; the scenario has "
            f"{', '.join((*team.raters, *team.providers))}"
        )
    if wanted is None and len(roles) > 1:
        raise ValueError(
            f"{name} has both roles, each a process of its own: choose one with --role"
        )
    if wanted is not None and wanted not in roles:
        raise ValueError(
            f"there is no {wanted} {name!r}; the scenario has {', '.join(names[wanted])}"
        )
    return wanted or roles[0]


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
            f"{name} cannot play {attack}: that attacks by {needed}, but this node supports "
            f"attacks by {supported} only"
        )
    return policies[name]
