"""`python -m studies.equilibrium`: the game between trust models and attackers that a benchmark has played."""

import shlex
from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape

from roletrust_env.storage.files import prepare_folder, write_csv, write_text
from roletrust_env.storage.markdown import markdown_table
from roletrust_experiments.commands.console import console, number_table, print_next
from roletrust_experiments.commands.extras import require
from roletrust_experiments.commands.options import ModelsOption, Out, Seed
from roletrust_experiments.plots.figure_files import write_figure
from studies.charts import Panel, Series, panels_figure
from studies.running import run

_COLUMNS = ("weight", "alone", "exploitability")
_HEADER = ("model", *(f"{name}{end}" for name in _COLUMNS for end in ("", "_low", "_high")), "alpha_rank")
_SHOWN = 0.005  # least probability of an attack in the text


def equilibrium(
    results: Annotated[Path, typer.Argument(help="Results of `roletrust benchmark` for trust models, results.sqlite.")],
    model: ModelsOption = None,
    resamples: Annotated[int, typer.Option(min=20, help="Number of draws of games for the intervals.")] = 200,
    seed: Seed = 0,
    out: Out = Path("results/equilibrium"),
) -> None:
    """Solve [bold]the game between trust models and attackers[/]: is a mixture of models worth more than the best one?

    The payoff is the score of the suite. The defender draws a model for each game, the attacker knows the
    probabilities but not the draw, and each condition counts alike. Only attacks that every model has met count, so
    searches that were trained on one model are left out. Mixtures and attacks are chosen in one set of games, and
    scored in another. Intervals resample games. Alpha-rank is the share of the time in which a model is in use where
    both sides copy what does better, the mean over the conditions.

    Written: [green]equilibrium.md equilibrium.csv equilibrium.png[/]; [green]attacks.csv[/], the attacker's mixture.

    [bold]Examples[/]

    [dim]# the equilibrium of the quick suite[/]
    [cyan]roletrust benchmark --out results/quick[/]
    [cyan]python -m studies.equilibrium results/quick/results.sqlite[/]

    [dim]# of some models only[/]
    [cyan]python -m studies.equilibrium results/quick/results.sqlite --model beta --model median --model travos[/]
    """
    require("the equilibrium", "train", "scipy", "cma")  # to read a suite of the benchmark
    from roletrust_env.benchmarking.worst_case import attack_scores
    from roletrust_experiments.commands.leaderboard import read_run
    from studies.equilibria import equilibrium as solved
    from studies.equilibria import payoffs

    suite, stored = read_run(results)
    names = list(dict.fromkeys(model or suite.model_names))
    if unknown := [name for name in names if name not in suite.model_names]:
        raise ValueError(f"{results} has no model {unknown[0]!r}; it has {', '.join(suite.model_names)}")
    games = payoffs(attack_scores(suite, stored), names)
    found = solved(games, names, resamples, seed)
    order = sorted(range(len(names)), key=lambda k: -found.alone[k].value)
    rows = [(names[k], found.weights[k], found.alone[k], found.exploitability[k]) for k in order]
    shares = dict(zip(names, found.alpha_rank, strict=True))
    prepare_folder(out)
    write_csv(
        out / "equilibrium.csv",
        _HEADER,
        [[name, *(x for part in parts for x in part), shares[name]] for name, *parts in rows],
    )
    mixed = [(*where, name, weight) for where, of in found.attacks.items() for name, weight in of.items()]
    write_csv(out / "attacks.csv", ("scenario", "track", "share", "attack", "weight"), mixed)
    at = [row[0] for row in rows]
    panels = [
        Panel("alone, under its worst attack", "", suite.score, [Series(suite.score, at, [row[2] for row in rows])]),
        Panel("in the equilibrium", "", "probability", [Series("probability", at, [row[1] for row in rows])]),
    ]
    note = f"suite {suite.name}, {len(games)} conditions, 95% intervals over games"
    question = "What is a mixture of trust models worth against attackers who know it?"
    write_figure(out / "equilibrium.png", panels_figure(question, panels, note), colours=256)
    facts = [
        ("best mixture", found.mixture),
        ("what it has over the best model alone", found.gain),
        ("best model alone in each condition, if the condition is known", found.informed),
        ("best mixture in each condition, if the condition is known", found.informed_mixture),
    ]
    table = number_table("Equilibrium", note, *_COLUMNS, "alpha-rank", name="model")
    for name, *parts in rows:
        table.add_row(escape(name), *map(_text, parts), f"{shares[name]:.3f}")
    console.print(table)
    for what, value in facts:
        console.print(f"{what}: {_text(value)}", soft_wrap=True)
    weights = [[f"`{name}`", *map(_text, parts), f"{shares[name]:.3f}"] for name, *parts in rows]
    mixtures = [
        [where.description, ", ".join(f"{name} {weight:.0%}" for name, weight in of.items() if weight >= _SHOWN)]
        for where, of in found.attacks.items()
    ]
    chosen = [part for name in model or [] for part in ("--model", name)]
    command = shlex.join(["python", "-m", "studies.equilibrium", str(results), *chosen, "--resamples", str(resamples)])
    texts = [
        markdown_table(["model", *_COLUMNS, "alpha-rank"], weights, names=1),
        markdown_table(["defender", suite.score], [[what, _text(value)] for what, value in facts], names=1),
        markdown_table(["condition", "the attacker's mixture"], mixtures, names=2),
        f"{note}. Made by `{command} --seed {seed}`.",
    ]
    write_text(out / "equilibrium.md", "\n\n".join(texts) + "\n")
    console.print(
        escape(f"Written to {out}: equilibrium.md, equilibrium.csv, equilibrium.png, attacks.csv"), soft_wrap=True
    )
    print_next("report", results)


def _text(value: tuple[float, float, float]) -> str:
    return "{:.3f} ({:.3f}, {:.3f})".format(*(x + 0.0 for x in value))


if __name__ == "__main__":
    run(equilibrium)
