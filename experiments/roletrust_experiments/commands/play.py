"""`roletrust play`: any scenario, under any trust models, with any attackers."""

import json
import math
import re
import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.markup import escape
from rich.table import Table

from roletrust_env import Game, JointPolicy, Policy, make_scenario
from roletrust_env.evaluation.resources import in_time
from roletrust_env.evaluation.specs import (
    parse_attacks,
    parse_settings,
    parse_trust_model,
    with_settings,
)
from roletrust_env.memory import check_memory
from roletrust_env.metrics.confidence import Estimate
from roletrust_env.storage.files import prepare_folder, write_csv, write_json
from roletrust_env.storage.provenance import describe, describe_policies, provenance
from roletrust_env.storage.untrusted import parse_json
from roletrust_experiments.commands.console import (
    console,
    errors,
    number_table,
    print_json,
    progress_bar,
    tell,
)
from roletrust_experiments.commands.extras import require
from roletrust_experiments.commands.options import NAMED, OWN, Seed, SettingsOption
from roletrust_experiments.playing.games import (
    HEADER,
    Played,
    all_curve_bytes,
    attacks_in_words,
    foresee,
    play_games,
    rows,
)
from roletrust_experiments.playing.group_measures import (
    AUC_FINALLY,
    AUC_MEANWHILE,
    MEASURES,
    UTILITY_WITHOUT,
    measured_since,
)
from roletrust_experiments.plots.figure_files import write_figure


def play(
    scenario: Annotated[
        str, typer.Argument(help="Name of a scenario, or path of a .toml or .yaml file.")
    ] = "paper-3x3",
    model: Annotated[
        list[str],
        typer.Option(
            metavar=NAMED, help="Trust model; repeat to compare several under one attack. " + OWN
        ),
    ] = ["role-trust"],  # noqa: B006 (typer copies it)
    attack: Annotated[
        list[str] | None,
        typer.Option(
            metavar=f"AGENT={NAMED}",
            help=f"Attack; repeat for more. AGENT may be like 'sr_*'. {OWN}",
        ),
    ] = None,
    settings: SettingsOption = None,
    games: Annotated[int, typer.Option(min=1, help="Number of games, played as one batch.")] = 1,
    seed: Seed = 0,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR", help="Folder for the results; a new one in results/play if left out."
        ),
    ] = None,
    force: Annotated[
        bool, typer.Option("--force", help="Overwrite results of another configuration.")
    ] = False,
    video: Annotated[
        bool,
        typer.Option(
            "--video", help="Also save a video of one game, play.mp4, and its last round, play.png."
        ),
    ] = False,
    as_json: Annotated[
        bool,
        typer.Option(
            "--json", help="Print results.json and nothing else, and write files only with --out."
        ),
    ] = False,
) -> None:
    r"""Play [bold]any scenario[/] with any attackers and trust models, and save the results.

    Written: [green]curves.png curves.csv results.json[/], and with --video [green]play.mp4
    play.png[/]. With several games every mean comes with its 95% confidence interval.

    Trust and reward are means over the agents of a group that are present; [bold]at end[/]: agents
    present in the last round / all agents. With an attack, the same games are played again with all
    agents honest. [bold]Damage[/]: mean trust of the honest agents there, minus that under the
    attack; an agent that has left counts with its last trust. [bold]AUC[/]: probability that an
    attacker has less trust than an honest agent of its role, by mean trust during the attack (left)
    and by final trust. [bold]False alarms[/]: share of rounds and honest agents in which trust is
    below 0.5. [bold]Utility[/]: quality of the most trusted provider, as a share of the best
    quality in the round; a provider that serves nobody in a round delivers nothing.
    [bold]Recovery[/]: rounds after the attack until the mean trust of the honest agents is within
    0.05 of that without the attack.

    Values are written as in TOML: 3, 0.5, true, \[0, 1], {kind = "choice"}.

    [bold]Examples[/]

    [dim]# a provider that alternates between good and bad service from round 100 on[/]
    [cyan]roletrust play --attack sp_2=on-off:start=100,period=4[/]

    [dim]# a third of a crowd lies; the damage over 20 games[/]
    [cyan]roletrust play crowd-10x10 --attack 'sr_\[0-2]=bad-mouthing' --games 20[/]

    [dim]# two trust models under one attack, aimed at a single provider[/]
    [cyan]roletrust play --model role-trust --model mean --attack sr_1=bad-mouthing:targets=sp_0[/]

    [dim]# a worse lie, and a video[/]
    [cyan]roletrust play --attack sr_1=bad-mouthing:level=0 --video[/]

    [dim]# for scripts: the damage under each model[/]
    [cyan]roletrust play --attack sr_1=bad-mouthing --json | jq '.measured | map_values(.damage)'[/]

    [dim]# a seller that leaves when it is distrusted and returns as a newcomer, up to three
    times[/]
    [cyan]roletrust play
    --set 'agents=\[{role="SR",count=9},{role="SP",count=5},{role="SP",reserve=3}]'
    --attack sp_5=whitewashing:reserve=3[/]

    [dim]# your own scenario, with some fields changed[/]
    [cyan]roletrust play mine.toml --set lam=0.7 --set 'admission={threshold=0.3}'[/]
    """
    given = parse_settings(settings or [])
    rules = with_settings(make_scenario(scenario), given)
    if len(set(model)) < len(model):
        raise ValueError("--model names the same model twice")
    attackers = parse_attacks(attack or [], rules)
    joint_policies = {
        text: JointPolicy(Game(rules, parse_trust_model(text, rules, given)), attackers)
        for text in model
    }  # all are checked before the first is played
    title = f"{rules.name}, {', '.join(model)}, {attacks_in_words(attackers)}"
    usual_out = Path("results/play") / _slug(title)
    if out is None and not as_json:
        out = usual_out
    if video:
        require("--video", "video", "imageio", "imageio_ffmpeg")
    if out is None and video:
        raise ValueError("--video needs a folder to write to; with --json give one with --out")
    first_play, *_ = joint_policies.values()
    config = {
        "command": "roletrust play",
        "games": games,
        **{
            key: value
            for key, value in provenance(first_play.game, seed).items()
            if key != "trust_model"
        },
        "attackers": describe_policies(attackers),
        "trust_models": {
            text: describe(joint_policy.game.model) for text, joint_policy in joint_policies.items()
        },
    }
    if out is not None:
        if not force:
            _check_folder(out, config)
        prepare_folder(out)
    aside = errors if as_json else console
    _check_memory(list(joint_policies.values()), attackers, games)
    with progress_bar(aside) as progress:
        played = [
            play_games(text, joint_policy, attackers, games=games, seed=seed, progress=progress)
            for text, joint_policy in joint_policies.items()
        ]
        results = {**config, "measured": _as_data(played)}
        written = [] if out is None else _write(out, results, played, attackers)
        if out is not None and video:
            from roletrust_experiments.plots.video import write_video

            for each in played:
                name = _file("play", each.model, played)
                write_video(out / f"{name}.mp4", JointPolicy(each.game, attackers), seed, progress)
                written += [f"{name}.mp4", f"{name}.png"]
    if as_json:
        print_json(results)
    else:
        console.print(_as_table(title, played, games))
        for note in _notes(played, games, attackers):
            console.print(f"[dim]{note}[/]")
        for each in played:
            if each.damage:
                tell(f"{each.model}: {_verdict(each)}")
    if written:
        tell(f"Written to {out}: {', '.join(written)}", where=aside)
    if not as_json and not video:
        rater = next(
            name
            for name in first_play.game.roster.names
            if "SR" in first_play.game.roster.role(name)
        )
        words = {
            "--attack": attack or [f"{rater}=bad-mouthing"],
            "--model": model,
            "--set": settings or [],
        }
        words |= {
            "--games": [f"{games}"],
            "--seed": [f"{seed}"],
            "--out": [f"{out}"],
        }  # it may hold no other games
        usual = {
            "--model": ["role-trust"],
            "--games": ["1"],
            "--seed": ["0"],
            "--out": [f"{usual_out}"],
        }
        options = [
            word
            for name, texts in words.items()
            if texts != usual.get(name)
            for text in texts
            for word in (name, text)
        ]
        tell(f"Next: {shlex.join(['roletrust', 'play', scenario, *options, '--video'])}")


def _check_memory(
    joint_policies: Sequence[JointPolicy], attackers: Mapping[str, Policy], games: int
) -> None:
    """Refuse more games or rounds than the memory can hold."""
    rules = joint_policies[0].game.scenario
    if games == 1 or isinstance(
        rules.frames, int
    ):  # one game needs memory for its curves only, and a live camera allows no trial
        each_round = games * all_curve_bytes(joint_policies, attackers) / rules.max_cycles
        check_memory("max_cycles", rules.max_cycles, each_round)
        return
    each = foresee(joint_policies, attackers)
    check_memory("--games", games, each.memory, f" and {in_time(games * each.seconds)}")


def _check_folder(out: Path, config: Mapping[str, Any]) -> None:
    """Refuse a folder with results of another configuration; the same games may be played again."""
    file = out / "results.json"
    if not file.is_file():
        return
    try:
        old = parse_json(file.read_bytes())
    except ValueError:
        old = {}
    new = json.loads(json.dumps(config))
    keys = ("command", "games", "seed", "scenario", "attackers", "trust_models")
    different = [key for key in keys if not isinstance(old, dict) or old.get(key) != new[key]]
    if different:
        raise ValueError(
            f"{out} holds results of another configuration (not the same: {', '.join(different)}); "
            "choose another folder with --out, or overwrite them with --force"
        )


def _write(
    out: Path, results: Mapping[str, Any], played: Sequence[Played], attackers: Mapping[str, Policy]
) -> list[str]:
    """Write all files but videos, and return their names."""
    from roletrust_experiments.plots.curves import curve_figure

    write_csv(
        out / "curves.csv", HEADER, [row for played_model in played for row in rows(played_model)]
    )
    written = ["curves.csv"]
    for played_model in played:
        name = f"{_file('curves', played_model.model, played)}.png"
        scenario = played_model.game.scenario.name
        title = f"{scenario}, {played_model.model}, {attacks_in_words(attackers)}"
        identities = played_model.game.roster.with_reserves(attackers)
        write_figure(
            out / name, curve_figure(title, played_model.game, played_model.curves, identities)
        )
        written.append(name)
    write_json(out / "results.json", results)
    return [*written, "results.json"]


def _file(stem: str, model: str, played: Sequence[Played]) -> str:
    """Return the name of a file that exists once for each model."""
    return stem if len(played) == 1 else f"{stem}-{_slug(model)}"


def _slug(text: str) -> str:
    return re.sub(r"[^\w.]+", "-", text).strip("-")


def _as_data(played: Sequence[Played]) -> dict[str, Any]:
    """Return all measurements by trust model; an undefined value is None, with the reason."""
    return {
        played_model.model: {
            "groups": {
                group.label: {"agents": group.size, "present at the end": _plain(group.present)}
                | {name: _plain(estimate) for name, estimate in group.measures.items()}
                for group in played_model.groups
            },
            "damage": {who: _plain(estimate) for who, estimate in played_model.damage.items()},
            "metrics": {name: _plain(estimate) for name, estimate in played_model.metrics.items()},
        }
        for played_model in played
    }


def _as_table(title: str, played: Sequence[Played], games: int) -> Table:
    """Return a table of the results of each group of agents under each model, and of the effects of
    the attack.
    """
    headings = (name.replace(" ", "\n") for name in MEASURES)
    table = number_table(escape(title), "", "at end", *headings, name="agents")
    table.padding = (0, 1, 0, 0)  # it fits into 80 columns
    for played_model in played:
        if len(played) > 1:
            table.add_row(f"[bold]{escape(played_model.model)}[/]")
        for group in played_model.groups:
            cells = [_shown(estimate) for estimate in group.measures.values()]
            here = f"{group.present.mean:.{0 if games == 1 else 1}f}".removesuffix(".0")
            style = None if group.honest else "dark_orange3"
            table.add_row(escape(group.label), f"{here}/{group.size}", *cells, style=style)
        for who, estimate in played_model.damage.items():
            table.add_row(f"damage, {who}", "", _shown(estimate), style="bold")
        for name, estimate in played_model.metrics.items():
            if name.startswith(AUC_MEANWHILE):
                role = name.removeprefix(AUC_MEANWHILE)
                table.add_row(
                    f"AUC{role}",
                    "",
                    _shown(estimate),
                    "",
                    _shown(played_model.metrics[AUC_FINALLY + role]),
                )
            elif not name.startswith(AUC_FINALLY) and not np.isnan(estimate.mean):
                table.add_row(name, "", _shown(estimate))
        table.add_section()
    return table


def _notes(played: Sequence[Played], games: int, attackers: Mapping[str, Policy]) -> list[str]:
    """Return explanations of the numbers in the table."""
    rules = played[0].game.scenario
    since = measured_since(attackers, rules.max_cycles)
    start = f"round {since} ({(since + 1) * rules.period_s:g} s)"
    when = "when the attack has begun" if attackers else "after the first rounds"
    many = (
        f"mean of {games} games ± half the 95% confidence interval, rounded up"
        if games > 1
        else "one game"
    )
    lines = [
        f"{many}; lowest trust: the least mean trust of the group from {start} on, {when}; "
        "what all numbers are: roletrust play --help"
    ]
    if unrated := [
        played_model.model for played_model in played if not played_model.game.model.rates_raters
    ]:
        lines.append(
            f"no trust in raters: {', '.join(unrated)}: false alarms and recovery are of providers "
            "only"
        )
    measured = [
        (played_model.model, name, estimate)
        for played_model in played
        for name, estimate in played_model.metrics.items()
    ]
    undefined: dict[str, list[str]] = {}
    for model, name, estimate in measured:
        if estimate.why:
            undefined.setdefault(f"{name}: undefined: {estimate.why}", []).append(model)
    lines += [
        f"{why} ({', '.join(models)})" if len(played) > 1 else why
        for why, models in undefined.items()
    ]
    return lines


def _verdict(played: Played) -> str:
    """Return what an attack does under a model, in a sentence."""
    *_, harm = played.damage.values()
    under, without = played.metrics["utility"], played.metrics[UTILITY_WITHOUT]
    loss = Estimate(without.mean - under.mean, np.nan)
    costs = (
        f"the attack costs honest agents {_shown(harm)} of trust, and consumers {_shown(loss)} "
        "of utility"
    )
    apart = [
        f"with probability {_shown(auc)} an attacker ends with less trust than an honest "
        f"{name.rpartition(' ')[2]}"
        for name, auc in played.metrics.items()
        if name.startswith(AUC_FINALLY) and not np.isnan(auc.mean)
    ]
    return "; ".join([costs, *apart])


def _shown(estimate: Estimate) -> str:
    if np.isnan(estimate.mean):
        return "undefined" if estimate.why else "nobody present"
    half = estimate.half
    return (
        f"{estimate.mean:.3f}"
        if np.isnan(half)
        else f"{estimate.mean:.3f}±{math.ceil(half * 1000) / 1000:.3f}"
    )


def _plain(estimate: Estimate) -> dict[str, float | str | None]:
    """Return an estimate for JSON, which has no NaN."""
    mean, half = (None if np.isnan(value) else value for value in (estimate.mean, estimate.half))
    return {"mean": mean, "half_95": half, **({"why": estimate.why} if estimate.why else {})}
