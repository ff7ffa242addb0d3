"""`roletrust panel`: which judges to trust, from their votes on items or on one another's
answers.
"""

import re
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from roletrust_baselines.panels.peers import (
    PEOPLE,
    Comparisons,
    all_peer_methods,
    make_peer_method,
    read_comparisons,
)
from roletrust_baselines.panels.report import (
    AGENT,
    PeerRow,
    Plan,
    Row,
    accuracy_tables,
    cells,
    headline,
    judged,
    markdown,
    peer_tables,
    peer_trial,
    standings,
    trial,
    trial_steps,
)
from roletrust_baselines.panels.verdicts import all_methods, make_method
from roletrust_baselines.panels.votes import Votes, read_votes, write_votes
from roletrust_env.data.dialect import Dialect
from roletrust_env.storage.files import prepare_folder, write_csv, write_text
from roletrust_experiments.commands.console import (
    console,
    number_table,
    progress_bar,
    short,
    shown,
    tell,
    tell_left_out,
)
from roletrust_experiments.commands.extras import require
from roletrust_experiments.commands.options import NAMED, OWN, Out, Seed
from roletrust_experiments.plots.figure_files import write_figure

_FEW = 5  # judges at each end of a longer table
_BEST = 10  # methods of a longer table
_INTERVAL = re.compile(r" \((.*), (.*)\)")
_METHOD = "first-hand"


def panel(
    votes: Annotated[
        Path,
        typer.Argument(help="File of votes: CSV, JSON lines or Parquet, as for `roletrust rate`."),
    ],
    judge: Annotated[
        list[str] | None,
        typer.Option(metavar="COLUMN", help="Column of the judge; repeat for several together."),
    ] = None,
    item: Annotated[str, typer.Option(metavar="COLUMN", help="Column of the item.")] = "item",
    vote: Annotated[str, typer.Option(metavar="COLUMN", help="Column of the vote.")] = "vote",
    truth: Annotated[
        str | None,
        typer.Option(metavar="COLUMN|FILE", help="Column of the truth, or file of item and truth."),
    ] = None,
    kind: Annotated[
        str | None, typer.Option(metavar="COLUMN", help="Column of the kind of item.")
    ] = None,
    peers: Annotated[
        bool,
        typer.Option("--peers", help="Agents compare answers of agents: columns first and second."),
    ] = False,
    people: Annotated[
        str,
        typer.Option(
            help="With --peers, judge with votes of people, or a pattern such as 'expert_*'."
        ),
    ] = PEOPLE,
    method: Annotated[
        list[str] | None,
        typer.Option(metavar=NAMED, help=f"Method or trust model; repeat for more. {OWN}"),
    ] = None,
    measure: Annotated[
        bool, typer.Option("--measure", help="Measure all methods, against the truth.")
    ] = False,
    labels: Annotated[
        list[int] | None, typer.Option(min=0, help="Number of own labels; repeat for more.")
    ] = None,
    draws: Annotated[
        int, typer.Option(min=1, help="Number of sets of labels that are drawn.")
    ] = 20,
    bribes: Annotated[
        int,
        typer.Option(
            min=0, help="Number of bribes that a search tries for each number of bought judges."
        ),
    ] = 0,
    separator: Annotated[str | None, typer.Option(help="Separator of the file.")] = None,
    encoding: Annotated[str | None, typer.Option(help="Encoding of the file.")] = None,
    synthetic: Annotated[
        bool, typer.Option("--synthetic", help="First write a synthetic file of votes.")
    ] = False,
    seed: Seed = 0,
    out: Out = Path("results/panel"),
) -> None:
    """Say [bold]which judges to trust[/], from a file of their votes, and what the panel says of
    each item.

    Judges are annotators, reviewers or language models. A row is a vote: a judge, an item and any
    answer; several votes of a judge on an item are one opinion. Items with a known truth are labels
    of your own (--truth): they enter a trust model as the experience of one more judge, you, and
    the verdict on the other items is what it trusts.

    Written: [green]judges.csv[/], the trust in each judge; [green]verdicts.csv[/], the verdict on
    each item, empty in a tie.

    With --measure, the truth is hidden, and methods get few labels of it, drawn many times: how
    often is each right, with how many labels, and with labels of another kind of item (--kind)?
    With --bribes, some judges are bought: a search finds which, and when they lie. Written:
    [green]measures.csv[/], [green]panel.md[/], [green]panel.png[/].

    With --peers, agents judge one another's answers, so they are raters and providers: ToR, ToP and
    ToA, and with --measure the ranking against votes of people, and how many judges must be bought
    to put each agent first.

    [bold]Examples[/]

    [dim]# 20 of your own labels in labels.csv (item, truth)[/]
    [cyan]roletrust panel votes.csv --truth labels.csv[/]

    [dim]# a judge is a model and a prompt; which method, and how many labels?[/]
    [cyan]roletrust panel votes.csv --judge model --judge prompt --truth truth --kind subset
    --measure[/]

    [dim]# what do bought judges do?[/]
    [cyan]roletrust panel votes.csv --truth truth --measure --bribes 100 --method majority
    --method first-hand[/]
    """
    plan = Plan(
        tuple(sorted(set(labels))) if labels else Plan().labels, draws, budget=bribes, seed=seed
    )
    dialect, measured = Dialect(separator, encoding), measure or bribes > 0
    for wrong, words in (
        (peers and len(judge or ()) > 1, "with --peers a judge is one column (--judge)"),
        (
            peers and (truth or kind or synthetic),
            "--truth, --kind and --synthetic are not for --peers",
        ),
        (not measured and len(method or ()) > 1, "several methods need --measure"),
        (not measured and labels, "--labels needs --measure; your own labels are --truth FILE"),
        (
            synthetic and votes.exists(),
            f"{votes} is there already; leave out --synthetic, or name a new file",
        ),
        (
            synthetic and votes.suffix != ".csv",
            f"{votes} must end in .csv, as --synthetic writes CSV",
        ),
    ):
        if wrong:
            raise ValueError(words)
    require("roletrust panel", "data", "pyarrow")
    if synthetic:
        votes.parent.mkdir(parents=True, exist_ok=True)
        write_votes(votes, seed)
    if peers:
        (judge_column,) = judge or ("judge",)
        comparisons, crowd = read_comparisons(
            votes, judge_column, item, vote=vote, people=people, dialect=dialect, tell=tell
        )
        if measured:
            if crowd is None or (crowd.values == 0.5).all():
                raise ValueError(
                    f"--measure needs votes of people ({people!r}, --people) on these agents, not "
                    "only ties"
                )
            plan = _fitting(plan, len(crowd.values), "votes of people")
        prepare_folder(out)
        names = method or (all_peer_methods() if measured else [_METHOD])
        _peers(comparisons, crowd if measured else None, names, plan, out)
        return
    gold = Path(truth) if truth and Path(truth).is_file() else truth
    ballot = read_votes(
        votes, judge or ["judge"], item, vote, gold, kind, dialect=dialect, tell=tell
    )
    if measured and (ballot.truth < 0).all():
        raise ValueError("there is no truth to measure against (--truth COLUMN or FILE)")
    if measured:
        plan = _fitting(plan, int((ballot.truth >= 0).sum()), "items with a known truth")
    prepare_folder(out)
    if measured:
        _measured(ballot, method or all_methods(), plan, out)
    else:
        _verdicts(ballot, (method or [_METHOD])[0], out)


def _fitting(plan: Plan, known: int, what: str) -> Plan:
    """Return a plan without the numbers of labels that would leave nothing to judge, and say so.

    Raises:
        ValueError: No number of labels is left.
    """
    labels = tuple(n for n in plan.labels if n < known)
    left = ", ".join(f"{n}" for n in plan.labels if n >= known)
    if not labels:
        raise ValueError(f"--labels {left} leaves nothing to judge: there are {known:,} {what}")
    if left:
        tell_left_out(f"{left} labels, since there are {known:,} {what}")
    return plan._replace(labels=labels)


def _verdicts(votes: Votes, name: str, out: Path) -> None:
    """Write the trust in the judges and the verdicts, with all labels, and print the best and the
    worst judges.
    """
    judges, verdicts = judged(votes, make_method(name))
    write_csv(out / "judges.csv", ("judge", "trust", "items", "right"), judges)
    write_csv(out / "verdicts.csv", ("item", "verdict", "support", "truth"), verdicts)
    long = len(judges) > 2 * _FEW
    ends = [*judges[:_FEW], *judges[-_FEW:]] if long else judges
    title = (
        f"Judges by {name}, with {int((votes.truth >= 0).sum()):,} labels"
        + f": first and last {_FEW}" * long
    )
    _print(title, ["judge", "trust", "items", "right on labels"], [cells(line) for line in ends])
    if (votes.truth < 0).all():
        console.print(
            "Without labels, trust is agreement with the majority. --truth FILE (item, truth) adds "
            "yours."
        )
    tell(
        f"{votes.shape[0]:,} judges, {votes.shape[1]:,} items. Written to {out}: judges.csv, "
        "verdicts.csv"
    )


def _measured(votes: Votes, names: Sequence[str], plan: Plan, out: Path) -> None:
    """Measure methods, and write and print the tables and the figure."""
    from roletrust_experiments.plots.panel import panel_figure

    methods = {name: make_method(name) for name in dict.fromkeys(names)}
    left_out: list[str] = []
    steps = trial_steps(votes, plan) * len(methods)
    rows = _progress(lambda advance: trial(votes, methods, plan, advance, left_out.append), steps)
    for reason in left_out:
        tell_left_out(reason)
    if not rows:
        raise ValueError("nothing could be measured")
    write_csv(out / "measures.csv", Row._fields, rows)
    tables, words = accuracy_tables(rows), headline(rows)
    for title, (headings, lines) in tables.items():
        _print(
            title + f": first {_BEST} of {len(lines)}" * (len(lines) > _BEST),
            headings,
            lines[:_BEST],
        )
    tell(words)
    write_text(out / "panel.md", markdown(words, tables))
    write_figure(out / "panel.png", panel_figure(rows), colours=256)
    tell(f"Written to {out}: measures.csv, panel.md, panel.png")


def _peers(
    votes: Comparisons, people: Comparisons | None, names: Sequence[str], plan: Plan, out: Path
) -> None:
    """Write and print the standing of agents, and where people voted, its measures against them."""
    methods = {name: make_peer_method(name) for name in dict.fromkeys(names)}
    name = next(iter(methods))
    lines = standings(votes, methods[name], people)
    write_csv(out / "agents.csv", AGENT, lines)
    _print(f"Agents that judge one another, by {name}", AGENT, [cells(line) for line in lines])
    if people is not None:
        rows = _progress(
            lambda advance: peer_trial(votes, people, methods, plan, advance), len(methods)
        )
        write_csv(out / "measures.csv", PeerRow._fields, rows)
        tables = peer_tables(rows)
        for title, (headings, body) in tables.items():
            _print(title, headings, body)
        write_text(out / "panel.md", markdown("", tables))
    tell(f"Written to {out}")


def _progress(play: Callable[[Callable[[str], None]], Iterable[Any]], total: int) -> list[Any]:
    """Return the rows of a trial, with a bar."""
    with progress_bar(counted=False) as progress:
        task = progress.add_task("", total=total)
        return list(
            play(lambda name: progress.update(task, description=f"Measuring {name}", advance=1))
        )


def _print(title: str, headings: Sequence[str], lines: Iterable[Sequence[str]]) -> None:
    """Print a table, with half the width of an interval behind its value."""
    shortened = [[_INTERVAL.sub(_half, cell) for cell in line] for line in lines]
    caption = "± half of the 95% interval" * any("±" in cell for line in shortened for cell in line)
    table = number_table(shown(title), caption, *map(shown, headings[1:]), name=shown(headings[0]))
    for name, *numbers in shortened:
        table.add_row(shown(name), *map(short, numbers))
    console.print(table)


def _half(interval: re.Match[str]) -> str:
    return f" ± {(float(interval[2]) - float(interval[1])) / 2:.2f}"
