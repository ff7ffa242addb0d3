"""A trial of methods on a panel: all its numbers, as rows, and as tables in Markdown."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import NamedTuple

from roletrust_baselines.panels.bribery import worst_bribe
from roletrust_baselines.panels.trials import Scope, draws, judge, scopes
from roletrust_baselines.panels.verdicts import Method
from roletrust_baselines.panels.votes import Votes
from roletrust_env.metrics.confidence import Interval
from roletrust_env.storage.markdown import markdown_table


class Row(NamedTuple):
    """A number of a trial.

    Attributes:
        scored: Kind of the items that are judged.
        labelled: Kind of the items with own labels.
        method: Method.
        labels: Number of own labels.
        bought: Number of bought judges.
        measure: What is measured, see `judge`.
        value: Value.
        low: Lower end of its 95% interval.
        high: Upper end.
        bribe: How the bought judges vote, if some are.
    """

    scored: str
    labelled: str
    method: str
    labels: int
    bought: int
    measure: str
    value: float
    low: float
    high: float
    bribe: str = ""


class Plan(NamedTuple):
    """What a trial measures.

    Attributes:
        labels: Numbers of own labels.
        draws: Number of sets of labels of each number.
        bought: Numbers of bought judges.
        budget: Number of bribes that are tried for each; 0 for no attack.
        seed: Random seed.
    """

    labels: tuple[int, ...] = (0, 5, 10, 20, 50)
    draws: int = 20
    bought: tuple[int, ...] = (1, 3, 10, 30)
    budget: int = 0
    seed: int = 0


_ATTACKED_DRAWS = 3  # sets of labels under attack, where each bribe plays all


def trial(
    votes: Votes, methods: Mapping[str, Method], plan: Plan, advance: Callable[[str], None] = lambda what: None
) -> Iterator[Row]:
    """Yield the numbers of a trial on votes with a known truth, method by method.

    Attacks are on all items, without labels and with the median of the numbers of labels.

    Args:
        votes: Votes and truth.
        methods: Methods by name.
        plan: What is measured.
        advance: Function that is called with the name of each method, once for each scope.
    """
    for scope in scopes(votes):
        for name, method in methods.items():
            advance(name)
            found: dict[str, Interval] = {}
            for labels in plan.labels:
                labelled = draws(scope, labels, plan.draws, plan.seed)
                if labelled and (method.takes_labels or not found):
                    found = judge(scope, method, labelled, plan.seed)
                for measure, value in found.items() if labelled else ():
                    yield Row(scope.scored, scope.labelled, name, labels, 0, measure, *value)
    for name, method in methods.items() if plan.budget else ():
        advance(name)
        yield from _attacked(scopes(votes)[0], name, method, plan)


def _attacked(scope: Scope, name: str, method: Method, plan: Plan) -> Iterator[Row]:
    """Yield the accuracy of a method under bought judges."""
    middle = sorted(plan.labels)[len(plan.labels) // 2]
    for labels in dict.fromkeys((0, middle)) if method.takes_labels else (0,):
        for bought in (0, *plan.bought):
            if bought < scope.votes.shape[0] and (labelled := draws(scope, labels, _ATTACKED_DRAWS, plan.seed)):
                budget = plan.budget if bought else 1
                value, bribe = worst_bribe(scope, method, bought, labelled, budget, plan.seed)
                yield Row(*scope[:2], name, labels, bought, "attacked", *value, str(bribe) if bought else "")


def accuracy_tables(rows: Sequence[Row]) -> dict[str, tuple[list[str], list[list[str]]]]:
    """Return tables by title: headings, and a line for each method, from the best to the worst with most labels."""
    tables = {}
    for scored, labelled in dict.fromkeys((row.scored, row.labelled) for row in rows):
        here = [row for row in rows if (row.scored, row.labelled, row.measure) == (scored, labelled, "accuracy")]
        title = f"Right on {scored} items, by the number of own labels" + f", of {labelled} items" * (
            scored != labelled
        )
        tables[title] = _table(here, lambda row: row.labels, lambda row: row.method)
    if attacked := [row for row in rows if row.measure == "attacked"]:
        title = "Right on all items, by the number of bought judges"
        named = lambda row: row.method + f", {row.labels} labels" * (row.labels > 0)  # noqa: E731
        tables[title] = _table(attacked, lambda row: row.bought, named)
    return tables


def _table(
    rows: Sequence[Row], across: Callable[[Row], int], down: Callable[[Row], str]
) -> tuple[list[str], list[list[str]]]:
    """Return headings and lines, sorted by the last column."""
    cells = {(down(row), across(row)): row for row in rows}
    columns = sorted({across(row) for row in rows})
    names = sorted(dict.fromkeys(map(down, rows)), key=lambda name: -max(cells[name, columns[-1]].value, 0.0))
    lines = [
        [name, *(f"{row.value:.3f} ({row.low:.3f}, {row.high:.3f})" for row in (cells[name, c] for c in columns))]
        for name in names
    ]
    return ["method", *map(str, columns)], lines


def markdown(rows: Sequence[Row], words: str) -> str:
    """Return the tables as Markdown, with words before them."""
    parts = ["# Trust in judges", words]
    for title, (headings, lines) in accuracy_tables(rows).items():
        parts += [f"## {title}", markdown_table(headings, lines, names=1)]
    return "\n\n".join(parts) + "\n"
