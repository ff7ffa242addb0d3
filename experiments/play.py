"""`roletrust play`: any scenario, under any trust model, with any attackers."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.box import SIMPLE_HEAD
from rich.table import Table

from experiments.attacks import parse_attacks, parse_settings, parse_trust_model
from experiments.confidence import Floats, mean_where, over_games
from experiments.console import console
from experiments.files import cast_list, described, provenance, write_csv, write_figure, write_json
from experiments.recording import Curves, progress_bar, record
from roletrust_env import Cast, Game, Policy, make_scenario

_MEASURES = ("mean trust", "lowest trust", "final trust", "mean reward")


def play(
    scenario: Annotated[
        str, typer.Argument(help="Name of a scenario, or path of a .toml or .yaml file.")
    ] = "paper-3x3",
    trust_model: Annotated[
        str, typer.Option(metavar="NAME[:key=value,...]", help="Trust model, with parameters of its own.")
    ] = "role-trust",
    attack: Annotated[
        list[str] | None,
        typer.Option(
            metavar="AGENT=NAME[:key=value,...]",
            help="Who attacks and how; repeat for more. AGENT may be a pattern such as 'sr_*'. Times are in rounds.",
            show_default=False,
        ),
    ] = None,
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="FIELD=VALUE", help="Change a field of the scenario; repeat for more."),
    ] = None,
    games: Annotated[int, typer.Option(min=1, help="Number of games, played as one batch.")] = 1,
    seed: Annotated[int, typer.Option(min=0, help="Of all luck; the same seed gives the same files.")] = 0,
    out: Annotated[Path, typer.Option(help="Folder for the results; it is made if need be.")] = Path("results/play"),
    video: Annotated[
        bool, typer.Option("--video", help="Also save play.mp4, one game as it unfolds, and play.png, its last round.")
    ] = False,
) -> None:
    r"""Play [bold]any scenario[/] with any attackers and trust model, and save what came of it.

    Written: [green]curves.png curves.csv results.json[/], and [green]play.mp4[/] if asked.
    With several games every mean comes with its 95% confidence interval.
    Values are as in TOML: 3, 0.5, true, \[0, 1], {kind = "choice"}.

    [bold]Examples[/]

    [dim]# a provider that is good and bad by turns from round 100 on[/]
    [cyan]roletrust play --attack sp_2=on-off:start=100,period=4[/]

    [dim]# a third of a crowd lies; 20 games; how sure is the damage?[/]
    [cyan]roletrust play crowd-10x10 --attack 'sr_\[0-2]=bad-mouthing' --games 20[/]

    [dim]# another trust model, a worse lie, and a video[/]
    [cyan]roletrust play --trust-model mean --attack sr_1=bad-mouthing:level=0 --video[/]

    [dim]# your own scenario, with some fields changed[/]
    [cyan]roletrust play mine.toml --set lam=0.7 --set 'admission={threshold=0.3}'[/]
    """
    rules = make_scenario(scenario)
    changes = parse_settings(settings or [])
    if changes:
        rules = rules.change(**changes)
    game = Game(rules, parse_trust_model(trust_model, rules))
    attackers = parse_attacks(attack or [], rules)
    cast = Cast(game, attackers)
    with progress_bar() as progress:
        curves = record(cast, seed, progress, "Playing", games=games)
        if video:
            from experiments.video import write_video

            write_video(out / "play.mp4", game, attackers, seed, progress)
    found = _measure(game, curves, attackers)
    title = f"{rules.name}, {trust_model}, " + (f"{len(attackers)} attacking" if attackers else "everyone honest")
    written = _write(out, game, curves, attackers, seed, title, found)
    console.print(_table(title, found, games))
    console.print(
        f"Written to {out}: {', '.join([*written, 'play.mp4', 'play.png'] if video else written)}", soft_wrap=True
    )


Found = dict[str, dict[str, tuple[float, float]]]
"""Group of agents -> measure -> its mean over games and half the width of the 95% interval."""


def _measure(game: Game, curves: Curves, attackers: Mapping[str, Policy]) -> Found:
    """The measures of each group of agents that have a role and a policy in common."""
    groups: dict[tuple[str, Any], list[int]] = {}
    for i, name in enumerate(game.roster.names):
        groups.setdefault((name.partition("_")[0], attackers.get(name)), []).append(i)
    found: Found = {}
    for (role, policy), places in groups.items():
        who = game.roster.names[places[0]] if len(places) == 1 else f"{len(places)} {role}"
        plays = "honest" if policy is None else str(described(policy)["class"]).rpartition(".")[2]
        label = f"{who}, {plays}"
        if label in found:  # the same attack with other parameters
            label = f"{label} ({game.roster.names[places[0]]} ...)"
        found[label] = _measure_group(curves.trust[:, places], curves.rewards[:, places])
    return found


def _measure_group(trust: Floats, rewards: Floats) -> dict[str, tuple[float, float]]:
    """One number a game for each measure, and of these the mean; both arrays are (T, agents, games)."""
    each_round = mean_where(trust, axis=1)
    lowest = np.where(np.isnan(each_round), np.inf, each_round).min(axis=0)
    per_game = (
        mean_where(trust, axis=(0, 1)),
        np.where(np.isinf(lowest), np.nan, lowest),
        each_round[-1],
        mean_where(rewards, axis=(0, 1)),
    )
    means = [over_games(values) for values in per_game]
    return {name: (float(m.mean), float(m.half)) for name, m in zip(_MEASURES, means, strict=True)}


def _write(
    out: Path,
    game: Game,
    curves: Curves,
    attackers: Mapping[str, Policy],
    seed: int,
    title: str,
    found: Found,
) -> list[str]:
    """Write all files but the video, and return their names."""
    from experiments.curve_plots import curve_figure

    write_csv(out / "curves.csv", ("time_s", "agent", "trust", "mean", "low", "high", "games"), _rows(game, curves))
    write_figure(out / "curves.png", curve_figure(title, game, curves, attackers))
    games = curves.trust.shape[-1]
    measured = {
        group: {name: {"mean": _plain(mean), "half_95": _plain(half)} for name, (mean, half) in measures.items()}
        for group, measures in found.items()
    }
    results = {
        "command": "roletrust play",
        "games": games,
        **provenance(game, seed),
        "attackers": cast_list(attackers),
        "measured": measured,
    }
    write_json(out / "results.json", results)
    return ["curves.csv", "curves.png", "results.json"]


def _rows(game: Game, curves: Curves) -> list[tuple[Any, ...]]:
    """One row for each agent, trust and round: the mean over the games in which it was present, and its interval."""
    roster, rows = game.roster, []
    tables = [("ToR", roster.rater_names, curves.tor), ("ToP", roster.provider_names, curves.top)]
    if roster.n_both:
        first = roster.n_agents - roster.n_both
        tables.append(("ToA", roster.names[first:], curves.trust[:, first:]))
    for trust, names, values in tables:
        mean, half, games = over_games(values)
        for i, name in enumerate(names):
            columns = (mean[:, i], (mean - half)[:, i], (mean + half)[:, i], games[:, i])
            table = zip(curves.time_s.tolist(), *(column.tolist() for column in columns), strict=True)
            rows += [(time_s, name, trust, *rest) for time_s, *rest in table]
    return rows


def _table(title: str, found: Found, games: int) -> Table:
    caption = f"mean of {games} games ± half the 95% confidence interval, rounded up" if games > 1 else "one game"
    table = Table(title=title, title_justify="left", title_style="bold", box=SIMPLE_HEAD, pad_edge=False)
    table.caption, table.caption_justify = caption, "left"
    table.add_column("agents")
    for name in _MEASURES:
        table.add_column(name, justify="right", no_wrap=True)
    for group, measures in found.items():
        cells = [_shown(mean, half) for mean, half in measures.values()]
        table.add_row(group, *cells, style=None if group.endswith("honest") else "dark_orange3")
    return table


def _shown(mean: float, half: float) -> str:
    if np.isnan(mean):
        return "nobody there"
    return f"{mean:.3f}" if np.isnan(half) else f"{mean:.3f}±{math.ceil(half * 1000) / 1000:.3f}"


def _plain(value: float) -> float | None:
    """NaN is no JSON."""
    return None if np.isnan(value) else value
