"""`python -m studies.findings`: answers to what the paper claims or leaves open, with numbers."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.markup import escape

from roletrust_env.storage.files import prepare_folder, replacing, write_csv, write_json
from roletrust_env.storage.provenance import software
from roletrust_experiments.commands.console import console, print_next, progress_bar
from roletrust_experiments.commands.extras import require
from roletrust_experiments.commands.options import Out, Seed, check_choice
from roletrust_experiments.plots.figure_files import write_figure
from studies.running import run

if TYPE_CHECKING:
    from studies.findings.finding import Finding

_HEADER = ("figure", "series", "at", "value", "low", "high")
_NAMES = "roles", "dilution", "noise", "breaking", "mirrored", "both-roles", "admission", "movement"


def findings(
    question: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME",
            help=f"Question to answer, one of {', '.join(_NAMES)}; repeat for more; all if left out.",
            autocompletion=lambda incomplete: [name for name in _NAMES if name.startswith(incomplete)],
            show_default=False,
        ),
    ] = None,
    games: Annotated[
        int, typer.Option(min=2, help="Number of games for each mean; for breaking a quarter of it, but at least 6.")
    ] = 48,
    seed: Seed = 0,
    quick: Annotated[
        bool, typer.Option("--quick", help="Try it out, with short games and only the first values of each parameter.")
    ] = False,
    force: Annotated[bool, typer.Option("--force", help="Answer again, even if --out holds the answers.")] = False,
    out: Out = Path("results/findings"),
) -> None:
    """Answer [bold]what the paper claims or leaves open[/], each with a figure, numbers with intervals and a sentence.

    roles: the harm by raters against the harm by providers. dilution: larger systems with a fixed number of liars and
    with a fixed share. noise: the cost of noise with all agents honest. breaking: the share of liars that breaks each
    trust model. both-roles: ToA for agents that rate and provide. admission: the value of cutting off agents.
    movement: raters that see only the providers near them.

    Compared games use the same random numbers. A rule turns the numbers into a sentence, and the sentence says where a
    difference is not shown.

    Each answer is saved when it is complete, so that an interrupted command continues when it is given again. Other
    options, another version or --force answer a question again.

    Written: [green]findings.md findings.json[/], and for each question a [green].csv[/] and a [green].png[/] in the
    folder [green]findings[/] beside them.

    [bold]Examples[/]

    [dim]# all questions as in docs/, in some minutes[/]
    [cyan]python -m studies.findings[/]

    [dim]# one question with narrower intervals[/]
    [cyan]python -m studies.findings --question dilution --games 200[/]
    """
    require("the findings", "train", "scipy", "cma", "torch", "stable_baselines3")
    from studies.findings.games import Effort
    from studies.findings.page import page
    from studies.findings.questions import QUESTIONS

    for name in question or []:
        check_choice("question", name, _NAMES)
    names = [name for name in QUESTIONS if not question or name in question]
    prepare_folder(out / "findings")
    prepare_folder(out)
    answers = _read(out / "findings.json")
    made_with = {"games": games, "seed": seed, "quick": quick, **software()}
    with progress_bar() as progress:
        for name in names:
            if not force and answers.get(name, {}).get("made_with") == made_with and _written(out / "findings", name):
                continue
            finding = QUESTIONS[name](Effort(games, seed, quick, progress))
            _write(out / "findings", name, finding)
            command = f"python -m studies.findings --question {name} --games {games} --seed {seed}{' --quick' * quick}"
            answers[name] = _record(finding, command, made_with)
            answers = {known: answers[known] for known in QUESTIONS if known in answers}
            write_json(out / "findings.json", {"questions": answers})
    with replacing(out / "findings.md") as temporary:
        temporary.write_text(page(answers), encoding="utf-8")
    for name in names:
        console.print(
            f"[bold]{escape(answers[name]['question'])}[/] {escape(answers[name]['sentence'])}\n", soft_wrap=True
        )
    console.print(
        f"Written to {out}: findings.md, findings.json; in findings: {', '.join(names)}, each as .csv and .png",
        soft_wrap=True,
    )
    print_next("findings", "--question", names[0], "--games", 4 * games)


def _read(path: Path) -> dict[str, Any]:
    """Return the saved answers.

    Raises:
        ValueError: This command did not write the file.
    """
    if not path.exists():
        return {}
    try:
        answers = json.loads(path.read_text(encoding="utf-8"))["questions"]
        fields = {"question", "sentence", "command", "made_with"}
        return {name: answer for name, answer in answers.items() if fields <= set(answer)}
    except (ValueError, KeyError, TypeError, AttributeError):
        raise ValueError(f"{path} holds no findings; remove it, or choose another folder") from None


def _written(out: Path, name: str) -> bool:
    return all((out / f"{name}.{kind}").exists() for kind in ("csv", "png"))


def _write(out: Path, name: str, finding: "Finding") -> None:
    """Write the figure and its numbers."""
    from studies.charts import panels_figure

    note = f"{finding.games} games for each value; 95% intervals"
    rows = [
        (panel.title, series.label, at, *map(float, value))
        for panel in finding.panels
        for series in panel.series
        for at, value in zip(series.at, series.values, strict=True)
    ]
    write_csv(out / f"{name}.csv", _HEADER, rows)
    write_figure(out / f"{name}.png", panels_figure(finding.question, finding.panels, note))


def _record(finding: "Finding", command: str, made_with: dict[str, Any]) -> dict[str, Any]:
    """Return an answer as plain data."""
    return {
        "question": finding.question,
        "sentence": finding.sentence,
        "command": command,
        "differences": {what: {"mean": one.mean, "half_95": one.half} for what, one in finding.differences.items()},
        "made_with": made_with,
        "games": finding.games,
        "settings": finding.settings,
    }


if __name__ == "__main__":
    run(findings)
