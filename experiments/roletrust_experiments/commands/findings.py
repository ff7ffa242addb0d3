"""`roletrust findings`: what the paper claims or leaves open, answered with numbers."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.markup import escape

from roletrust_env.storage.files import prepare_folder, replacing, write_csv, write_json
from roletrust_env.storage.provenance import software
from roletrust_experiments.commands.console import console, progress_bar
from roletrust_experiments.commands.extras import require
from roletrust_experiments.plots.figure_files import write_figure

if TYPE_CHECKING:
    from roletrust_experiments.findings.finding import Finding

_HEADER = ("figure", "series", "at", "value", "low", "high")
_NAMES = "roles, dilution, noise, breaking, both-roles, admission, movement"


def findings(
    question: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help=f"One of {_NAMES}; repeat for more; all if left out.", show_default=False),
    ] = None,
    games: Annotated[
        int, typer.Option(min=2, help="Games of which means are taken; a quarter of them, but 6, for breaking.")
    ] = 48,
    seed: Annotated[int, typer.Option(min=0, help="Of all luck; the same seed gives the same files.")] = 0,
    quick: Annotated[
        bool, typer.Option("--quick", help="A trial: short games, and of what is varied only the first values.")
    ] = False,
    force: Annotated[bool, typer.Option("--force", help="Answer anew what --out holds.")] = False,
    out: Annotated[Path, typer.Option(help="Folder for the results; it is made if need be.")] = Path(
        "results/findings"
    ),
) -> None:
    """Answer [bold]what the paper claims or leaves open[/], each with a figure, numbers with intervals and a sentence.

    roles: whether raters do more harm than providers. dilution: whether larger systems dilute liars, a fixed number
    of them and a fixed share. noise: what it costs with everybody honest. breaking: which share of liars breaks each
    trust model. both-roles: what ToA does for agents that rate and provide. admission: what cutting off buys.
    movement: what it does, where each rater sees only the providers near it.

    What is compared is played with the same luck. A sentence is made of the numbers by a rule, and says so where a
    difference is not shown.

    Answers are kept as they come; stopped at any moment, the same command goes on. With other options, another version
    or --force a question is answered anew.

    Written: [green]findings.md findings.json[/], and for each question a [green].csv[/] and a [green].png[/] in the
    folder [green]findings[/] beside them.

    [bold]Examples[/]

    [dim]# all of them, as in docs/: some minutes[/]
    [cyan]roletrust findings[/]

    [dim]# one of them, surer[/]
    [cyan]roletrust findings --question dilution --games 200[/]
    """
    require("the findings", "train", "scipy", "cma", "torch", "stable_baselines3")
    from roletrust_experiments.findings.games import Asked
    from roletrust_experiments.findings.page import page
    from roletrust_experiments.findings.questions import QUESTIONS

    names = _asked(question, list(QUESTIONS))
    prepare_folder(out / "findings")
    prepare_folder(out)
    kept = _kept(out / "findings.json")
    made_with = {"games": games, "seed": seed, "quick": quick, **software()}
    with progress_bar() as progress:
        for name in names:
            if not force and kept.get(name, {}).get("made_with") == made_with and _written(out / "findings", name):
                continue
            finding = QUESTIONS[name](Asked(games, seed, quick, progress))
            _write(out / "findings", name, finding)
            kept[name] = _record(
                finding, f"roletrust findings --question {name}{_options(games, seed, quick)}", made_with
            )
            kept = {known: kept[known] for known in QUESTIONS if known in kept}
            write_json(out / "findings.json", {"questions": kept})
    with replacing(out / "findings.md") as temporary:
        temporary.write_text(page(kept), encoding="utf-8")
    for name in names:
        console.print(f"[bold]{escape(kept[name]['question'])}[/] {escape(kept[name]['sentence'])}\n", soft_wrap=True)
    console.print(
        f"Written to {out}: findings.md, findings.json; in findings: {', '.join(names)}, each as .csv and .png"
    )


def _asked(question: Sequence[str] | None, known: Sequence[str]) -> list[str]:
    """The names of the questions, in their order.

    Raises:
        ValueError: one is unknown.
    """
    for name in question or []:
        if name not in known:
            raise ValueError(f"unknown question {name!r}; known: {', '.join(known)}")
    return [name for name in known if not question or name in question]


def _kept(path: Path) -> dict[str, Any]:
    """The answers that are there.

    Raises:
        ValueError: the file is none of this command's.
    """
    if not path.exists():
        return {}
    try:
        kept = json.loads(path.read_text(encoding="utf-8"))["questions"]
        return {name: one for name, one in kept.items() if {"question", "sentence", "command", "made_with"} <= set(one)}
    except (ValueError, KeyError, TypeError, AttributeError):
        raise ValueError(f"{path} holds no findings; remove it, or choose another folder") from None


def _written(out: Path, name: str) -> bool:
    return all((out / f"{name}.{kind}").exists() for kind in ("csv", "png"))


def _write(out: Path, name: str, finding: "Finding") -> None:
    """The figure, and its numbers."""
    from roletrust_experiments.plots.findings import finding_figure

    note = f"{finding.games} games for each value; 95% intervals"
    rows = [
        (panel.title, series.label, at, *map(float, value))
        for panel in finding.panels
        for series in panel.series
        for at, value in zip(series.at, series.values, strict=True)
    ]
    write_csv(out / f"{name}.csv", _HEADER, rows)
    write_figure(out / f"{name}.png", finding_figure(finding.question, finding.panels, note))


def _record(finding: "Finding", command: str, made_with: dict[str, Any]) -> dict[str, Any]:
    """An answer as plain data."""
    return {
        "question": finding.question,
        "sentence": finding.sentence,
        "command": command,
        "differences": {what: {"mean": one.mean, "half_95": one.half} for what, one in finding.differences.items()},
        "made_with": made_with,
        "games": finding.games,
        "settings": finding.settings,
    }


def _options(games: int, seed: int, quick: bool) -> str:
    return f" --games {games} --seed {seed}{' --quick' * quick}"
