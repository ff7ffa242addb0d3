"""`python -m studies.scale`: cities of up to a million agents: what liars cost consumers, and what a round costs."""

import math
from collections.abc import Sequence
from pathlib import Path
from statistics import mean
from typing import Annotated

import typer
from rich.markup import escape
from rich.table import Table

from roletrust_env import make_scenario
from roletrust_env.evaluation.resources import in_bytes
from roletrust_env.evaluation.specs import parse_trust_model
from roletrust_env.storage.files import prepare_folder, replacing, write_csv
from roletrust_env.storage.markdown import markdown_table
from roletrust_env.trust.edge_state import edge_model
from roletrust_experiments.commands import completion
from roletrust_experiments.commands.console import console, number_table, plus_minus, print_next, progress_bar, short
from roletrust_experiments.commands.options import NAMED, OptionalOut, Seed
from studies.cities import ATTACKS, LEAST, MET, Harm, city, city_sizes, measure_harm
from studies.costs import machine
from studies.running import run
from studies.timing.cities import PLAIN, RoundCost, measure_rounds
from studies.timing.contestants import Spread

_SIZES = 25, 100, 1000, 10_000
_COST_SIZES = 1000, 10_000, 100_000, 1_000_000
_MODELS = "role-trust", "mean", "median"
_SHARES = 0.2, 0.4
_TITLE = "Cities of up to a million agents"
_HARM = "Skill that consumers lose to attackers"
_COSTS = "What a round costs"
_PARTS = "noise", "policies", "step"
_COST_HEADINGS = ("model", "agents", "services", "ms", "least - greatest", *_PARTS, "times plain", "memory")


def scale(
    agents: Annotated[
        list[int] | None,
        typer.Option(
            min=1,
            help="Number of agents of an attacked city; repeat for more; 25, 100, 1,000 and 10,000 if left out.",
            show_default=False,
        ),
    ] = None,
    cost: Annotated[
        list[int] | None,
        typer.Option(
            min=1,
            help="Number of agents of a city whose rounds are timed; repeat for more; 1,000 to 1,000,000 if left out.",
            show_default=False,
        ),
    ] = None,
    model: Annotated[
        list[str] | None,
        typer.Option(
            metavar=NAMED,
            help="Central trust model; repeat for more; role-trust, mean and median if left out.",
            autocompletion=completion.models,
            show_default=False,
        ),
    ] = None,
    rounds: Annotated[int, typer.Option(min=2, help="Rounds of an attacked city.")] = 30,
    seeds: Annotated[int, typer.Option(min=2, help="Seeds of each attacked city, from --seed on.")] = 10,
    seed: Seed = 0,
    out: OptionalOut = None,
) -> None:
    """Play [bold]cities[/], in which each rater meets five of many providers in a round, from 25 agents to a million.

    The first table is what attackers cost consumers, by the number of agents: a consumer goes to the most trusted of
    the providers that it meets. Four in five agents are raters, so that every provider has 20 ratings a round in every
    city. The second table is the time of a round and its memory, beside a round of `mean` in plain NumPy.

    Only central models can be played.

    Written with --out: [green]scale-harm.csv scale-costs.csv scale.md[/].

    [bold]Examples[/]

    [dim]# a first look, in half a minute[/]
    [cyan]python -m studies.scale --agents 25 --agents 1000 --cost 10000 --seeds 3[/]

    [dim]# the page in docs/, up to half an hour[/]
    [cyan]python -m studies.scale --seeds 20 --out results/scale[/]
    """
    sizes, cost_sizes = sorted(set(agents or _SIZES)), sorted(set(cost or _COST_SIZES))
    scenario = make_scenario("city")
    models = {name: edge_model(parse_trust_model(name, scenario)) for name in dict.fromkeys(model or _MODELS)}
    for size in (sizes[0], sizes[-1], cost_sizes[0], cost_sizes[-1]):
        city(size, rounds)  # refuses what is too small or too large
    if out is not None:
        prepare_folder(out)
    with progress_bar() as progress:
        conditions = 1 + len(ATTACKS) * len(_SHARES)
        steps = len(sizes) * len(models) * conditions + len(cost_sizes) * (len(models) + 1)
        task = progress.add_task("", total=steps)

        def advance(what: str) -> None:
            progress.update(task, description=what, advance=1)

        chosen = range(seed, seed + seeds)
        harms = measure_harm(sizes, models, _SHARES, rounds=rounds, seeds=chosen, advance=advance)
        costs = measure_rounds(cost_sizes, models, seed=seed, advance=advance)
    harm_caption = _harm_caption(harms, seeds, rounds)
    cost_caption = (
        "Milliseconds of processor time of a round in which a fifth of the raters bad-mouths, the median; noise, "
        f"policies and step are its parts. {PLAIN}: a round of mean by hand, in turn with each of the others. Memory: "
        "the peak of three rounds, beyond the agents and their names; role-trust remembers every pair that ever met."
    )
    harm_lines, cost_lines = _harm_lines(harms), _cost_lines(costs)
    console.print(_screen(_HARM, harm_caption, harm_lines, ("model", "attack", "share")))
    console.print(_screen(_COSTS, cost_caption, cost_lines, ("model", "agents"), ("services", "least - greatest")))
    if out is not None:
        _write(out, harms, costs)
        with replacing(out / "scale.md") as path:
            path.write_text(_page(harm_caption, harm_lines, cost_caption, cost_lines), encoding="utf-8")
        console.print(f"Written to {out}: scale-harm.csv, scale-costs.csv, scale.md", soft_wrap=True)
    print_next("costs", "--ratings", 1_000_000)


def _harm_caption(found: Sequence[Harm], seeds: int, rounds: int) -> str:
    """Return what the table of harm shows, and how harm changes with the number of agents."""
    text = (
        "Skill is 1 for the best of the five providers in every round, and 0 for a blind choice. Shown is the skill "
        "that honest agents bring, and the skill that is lost to each attack in the same luck: means of "
        f"{seeds} seeds with 95% intervals, games of {rounds} rounds. With {LEAST} agents, all raters meet all "
        "providers, so that whoever rates all alike changes no order."
    )
    sizes = sorted({one.agents for one in found if city_sizes(one.agents)[1] > MET})
    if len(sizes) < 2:
        return text
    small, large = ([one.harm for one in found if one.agents == size and one.share] for size in (sizes[0], sizes[-1]))
    pairs = list(zip(small, large, strict=True))
    changes = [high.mean - low.mean for low, high in pairs]
    clear = sum(abs(high.mean - low.mean) > math.hypot(high.half, low.half) for low, high in pairs)
    return (
        f"{text} From {sizes[0]:,} to {sizes[-1]:,} agents the harm of a condition changes by {mean(changes):+.3f} "
        f"on average, from {min(changes):+.3f} to {max(changes):+.3f}; in {clear} of {len(pairs)} conditions the "
        "change is more than its 95% interval, and one in twenty is so by chance."
    )


def _screen(
    title: str, caption: str, lines: list[list[str]], names: Sequence[str], hidden: Sequence[str] = ()
) -> Table:
    """Return a table for a terminal of 80 columns: names in one column, and without what stands in the files only."""
    headings, *rows = lines
    shown = [at for at, heading in enumerate(headings) if heading not in (*names, *hidden)]
    table = number_table(title, caption, *(headings[at].replace(" ", "\n") for at in shown), name=", ".join(names))
    for row in rows:
        name = ", ".join(cell for cell in row[: len(names)] if cell)
        table.add_row(escape(name), *(short(row[at]) for at in shown))
    return table


def _harm_lines(found: Sequence[Harm]) -> list[list[str]]:
    """Return the headings, and a row for each model and condition with a cell for each number of agents."""
    sizes = sorted({one.agents for one in found})
    by_row: dict[tuple[str, str, float], dict[int, Harm]] = {}
    for one in found:
        by_row.setdefault((one.model, one.attack, one.share), {})[one.agents] = one
    lines = [["model", "attack", "share", *(f"{size:,} agents" for size in sizes)]]
    for (model, attack, share), cells in by_row.items():
        shown = [plus_minus(cells[size].harm if share else cells[size].skill) for size in sizes]
        lines.append([model, attack if share else "honest: skill", f"{share:.0%}" if share else "", *shown])
    return lines


def _cost_lines(found: Sequence[RoundCost]) -> list[list[str]]:
    """Return the headings, and a row for each model and number of agents."""
    lines = [list(_COST_HEADINGS)]
    for one in found:
        ms = Spread.of(1e3 * s for s in one.seconds)
        parts = ["-"] * 3 if one.parts is None else [f"{1e3 * s:,.1f}" for s in one.parts]
        ratio = Spread.of(one.seconds).median / Spread.of(one.by_hand).median
        numbers = [f"{ms.median:,.1f}", f"{ms.low:,.1f} - {ms.high:,.1f}", *parts, f"{ratio:.1f}", in_bytes(one.memory)]
        lines.append([one.name, f"{one.agents:,}", f"{one.services:,}", *numbers])
    return lines


def _write(out: Path, harms: Sequence[Harm], costs: Sequence[RoundCost]) -> None:
    header: tuple[str, ...] = ("agents", "model", "attack", "share", "skill", "skill_half", "harm", "harm_half")
    write_csv(out / "scale-harm.csv", header, [(*one[:4], *one.skill[:2], *one.harm[:2]) for one in harms])
    header = ("agents", "services", "name", "ms", "ms_least", "ms_greatest", "plain_ms")
    header += ("noise_ms", "policies_ms", "step_ms")
    rows = [
        (
            *(one.agents, one.services, one.name),
            *Spread.of(1e3 * s for s in one.seconds),
            1e3 * Spread.of(one.by_hand).median,
            *((None,) * 3 if one.parts is None else (1e3 * s for s in one.parts)),
            one.memory,
        )
        for one in costs
    ]
    write_csv(out / "scale-costs.csv", (*header, "peak_bytes"), rows)


def _page(harm_caption: str, harms: list[list[str]], cost_caption: str, costs: list[list[str]]) -> str:
    """Return both tables as a page of Markdown."""
    parts = [f"# {_TITLE}"]
    for title, caption, names, (headings, *rows) in (
        (_HARM, harm_caption, 3, harms),
        (_COSTS, cost_caption, 1, costs),
    ):
        parts += [f"## {title}", caption, markdown_table(headings, rows, names)]
    parts.append(f"Written by `python -m studies.scale` on {machine(1)}; `make scale` measures again.")
    return "\n\n".join(parts) + "\n"


if __name__ == "__main__":
    run(scale)
