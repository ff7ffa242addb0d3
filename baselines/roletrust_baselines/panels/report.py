"""A trial of methods on a panel: all its numbers, as rows, and as tables in Markdown."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from roletrust_baselines.logs.measures import interval_text
from roletrust_baselines.panels.bribery import Bribe, bribed, chosen, find_bribe
from roletrust_baselines.panels.peers import Comparisons, PeerMethod, against_people, judges_to_win
from roletrust_baselines.panels.trials import ALL, Scope, accuracy, draws, judge, scopes
from roletrust_baselines.panels.verdicts import TIE, Method, leaders
from roletrust_baselines.panels.votes import Votes
from roletrust_env.metrics.confidence import Interval
from roletrust_env.randomness import generator
from roletrust_env.storage.markdown import markdown_table
from roletrust_env.trust.key_index import Ints

Tables = dict[str, tuple[list[str], list[list[str]]]]
"""Headings and lines by title."""


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


class PeerRow(NamedTuple):
    """A number of a trial of peers.

    Attributes:
        method: Method.
        own: Number of own votes.
        measure: What is measured, see `against_people`; or `to win`: how many bought judges put an
            agent first.
        agent: The agent, where the measure is of one.
        value: Value; NaN where all judges do not suffice.
        low: Lower end of its 95% interval; NaN without.
        high: Upper end.
    """

    method: str
    own: int
    measure: str
    agent: str
    value: float
    low: float = math.nan
    high: float = math.nan


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


_SEARCHED, _CHOSEN = (
    3,
    10,
)  # sets of labels with which bribes are searched, and with which the worst of them is chosen


def trial(
    votes: Votes,
    methods: Mapping[str, Method],
    plan: Plan,
    advance: Callable[[str], None] = lambda what: None,
    leave_out: Callable[[str], None] = lambda reason: None,
) -> Iterator[Row]:
    """Yield the numbers of a trial on votes with a known truth, method by method. What does not fit
    is left out.

    Attacks are on all items, without labels and with the median of the numbers of labels. Bribes
    are searched against each method, and each method meets all of them.

    Args:
        votes: Votes and truth.
        methods: Methods by name.
        plan: What is measured.
        advance: Function that is called with the name of each method, once for each scope.
        leave_out: Function that is called with the reason why a method is left out.
    """
    fitting = dict(methods)
    for scope in scopes(votes):
        for name, method in methods.items():
            advance(name)
            if name not in fitting:
                continue
            try:
                yield from _measured(scope, name, method, plan)
            except MemoryError as error:
                del fitting[name]
                leave_out(f"{name}: {error}")
    yield from _attacked(scopes(votes)[0], fitting, plan, advance) if plan.budget else ()


def _measured(scope: Scope, name: str, method: Method, plan: Plan) -> Iterator[Row]:
    """Yield the measures of a method by the number of labels."""
    found: dict[str, Interval] = {}
    for labels in plan.labels:
        labelled = draws(scope, labels, plan.draws, plan.seed)
        if labelled and (method.takes_labels or not found):
            found = judge(scope, method, labelled, plan.seed)
        for measure, value in found.items() if labelled else ():
            yield Row(scope.scored, scope.labelled, name, labels, 0, measure, *value)


def _attacked(
    scope: Scope, methods: Mapping[str, Method], plan: Plan, advance: Callable[[str], None]
) -> Iterator[Row]:
    """Yield the accuracy of methods under bought judges. Each meets the worst of the bribes found
    against any.
    """
    middle = sorted(plan.labels)[len(plan.labels) // 2]
    numbers = [number for number in plan.bought if number < scope.votes.shape[0]]

    def cells(name: str, many: int) -> Iterator[tuple[int, list[Ints]]]:
        """Yield numbers of labels, and sets of them that stand for those that the attacker does not
        know.
        """
        for labels in dict.fromkeys((0, middle)) if methods[name].takes_labels else (0,):
            if seen := draws(scope, labels, many, plan.seed + 1):
                yield labels, seen

    bribes: list[Bribe] = []
    for name, method in methods.items():
        advance(name)
        for _, seen in cells(name, _SEARCHED):
            own: list[Bribe] = []  # what was found for fewer judges is tried for more
            for bought in numbers:
                own.append(find_bribe(scope, method, bought, seen, plan.budget, plan.seed, own))
            bribes += own
    for name, method in methods.items():
        advance(name)
        for labels, seen in cells(name, _CHOSEN):
            labelled = draws(scope, labels, plan.draws, plan.seed)
            for bought in (0, *numbers):
                bribe = (
                    find_bribe(scope, method, bought, seen, 0, plan.seed, bribes)
                    if bought
                    else Bribe()
                )
                votes = bribed(
                    scope.votes, chosen(scope.votes, bought, bribe.choice, plan.seed), bribe
                )
                value = accuracy(scope, votes, method, labelled, plan.seed)
                yield Row(
                    *scope[:2],
                    name,
                    labels,
                    bought,
                    "attacked",
                    *value,
                    str(bribe) if bought else "",
                )


def trial_steps(votes: Votes, plan: Plan) -> int:
    """Return how often `trial` calls `advance` for each method."""
    return len(scopes(votes)) + 2 * (plan.budget > 0)


def accuracy_tables(rows: Sequence[Row]) -> Tables:
    """Return tables by title: headings, and a line for each method, from the best to the worst with
    most labels.
    """
    tables = {}
    for scored, labelled in dict.fromkeys((row.scored, row.labelled) for row in rows):
        here = [
            row
            for row in rows
            if (row.scored, row.labelled, row.measure) == (scored, labelled, "accuracy")
        ]
        title = (
            f"Right on {scored} items, by the number of own labels"
            + f", of {labelled} items" * (scored != labelled)
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
    found = {(down(row), across(row)): row for row in rows}
    columns = sorted({across(row) for row in rows})
    names = sorted(dict.fromkeys(map(down, rows)), key=lambda name: -found[name, columns[-1]].value)
    lines = [[name, *(_interval(found[name, at]) for at in columns)] for name in names]
    return ["method", *map(str, columns)], lines


def markdown(words: str, tables: Tables) -> str:
    """Return tables as Markdown, with words before them."""
    parts = ["# Trust in judges", *([words] if words else [])]
    for title, (headings, lines) in tables.items():
        parts += [f"## {title}", markdown_table(headings, lines, names=1)]
    return "\n\n".join(parts) + "\n"


def headline(rows: Sequence[Row]) -> str:
    """Return the sentence that is worth most: what the best method makes of few labels, beside the
    majority.
    """
    whole = [row for row in rows if row.scored == ALL and row.measure == "accuracy"]
    few = next((n for n in sorted({row.labels for row in whole}) if n), 0)
    best = max((row for row in whole if row.labels == few), key=lambda row: row.value)
    plain = [row for row in whole if row.method == "majority" != best.method][:1]
    beside = "".join(f", the majority in {_interval(row)}" for row in plain)
    return (
        f"With {few} own labels, {best.method} is right in {_interval(best)} of the items{beside}."
    )


def _interval(row: Row | PeerRow) -> str:
    return interval_text(Interval(row.value, row.low, row.high))


def judged(votes: Votes, method: Method) -> tuple[list[tuple[Any, ...]], list[tuple[Any, ...]]]:
    """Return lines of all judges, the most trusted first, and of all items, with all known truths
    as labels.

    Returns:
        Name of the judge, trust, number of items, share that is right; name of the item, verdict,
        its share of the support, truth. In a tie the verdict is empty, and so it is without votes.
    """
    labelled = np.flatnonzero(votes.truth >= 0)
    support, trust = method(votes, labelled)
    count = np.bincount(votes.judges, minlength=votes.shape[0])
    trusted = np.full(len(count), np.nan) if trust is None else trust
    order = np.lexsort((-count, -np.nan_to_num(trusted))).tolist()
    judges = [
        (votes.judge_names[at], float(trusted[at]), int(count[at]), float(votes.accuracy[at]))
        for at in order
    ]
    share = support - support.min(axis=1, keepdims=True).clip(max=0)
    share /= np.maximum(share.sum(axis=1, keepdims=True), TIE)
    answers = [*votes.answer_names, ""]  # the last is no answer
    tie = leaders(support).sum(axis=1) > 1
    verdicts = np.where(
        tie | (np.bincount(votes.items, minlength=len(tie)) == 0), -1, support.argmax(axis=1)
    )
    columns = votes.item_names, verdicts.tolist(), share.max(axis=1).tolist(), votes.truth.tolist()
    return judges, [
        (name, answers[at], most, answers[true])
        for name, at, most, true in zip(*columns, strict=True)
    ]


def cells(line: Sequence[Any]) -> list[str]:
    """Return a line as texts; a dash where there is no number."""
    return [
        one if isinstance(one, str) else f"{one:,}" if isinstance(one, int) else _number(one)
        for one in line
    ]


def _number(value: float) -> str:
    return "-" if math.isnan(value) else f"{value:.3f}"


# --- agents that judge one another
# --------------------------------------------------------------------

AGENT = ("agent", "ToP", "ToR", "ToA", "wins", "wins, people")
"""Headings of the lines of `standings`."""


def standings(
    votes: Comparisons, method: PeerMethod, people: Comparisons | None
) -> list[tuple[Any, ...]]:
    """Return a line for each agent, see `AGENT`: those with answers, the best first, then other
    judges with a ToR.
    """
    standing, empty = method(votes), np.full(len(votes.agents), np.nan)
    score = np.where(np.isin(np.arange(len(empty)), votes.authors), standing.score, np.nan)
    tor = empty if standing.tor is None else standing.tor
    columns = (score, tor, standing.toa, votes.win_rate, people and people.win_rate)
    order = np.lexsort((np.where(np.isnan(score), -tor, 0), -score))  # NaN is last
    order = order[~np.isnan(score[order]) | ~np.isnan(tor[order])].tolist()
    return [
        (votes.agents[at], *(float((empty if one is None else one)[at]) for one in columns))
        for at in order
    ]


def peer_trial(
    votes: Comparisons,
    people: Comparisons,
    methods: Mapping[str, PeerMethod],
    plan: Plan,
    advance: Callable[[str], None] = lambda what: None,
) -> Iterator[PeerRow]:
    """Yield how well methods agree with people, by the number of own votes, and how many bought
    judges win.

    Args:
        votes: Votes of agents.
        people: Votes of people; own ones are drawn from them.
        methods: Methods by name.
        plan: What is measured; with a budget, also how many judges must be bought.
        advance: Function that is called with the name of each method.
    """
    rng = generator(plan.seed)
    many = len(people.judges)
    sets = {
        n: [rng.choice(many, n, replace=False) for _ in range(plan.draws if n else 1)]
        for n in plan.labels
        if n < many
    }
    for name, method in methods.items():
        advance(name)
        found: dict[str, Interval] = {}
        for number, own in sets.items():
            if method.takes_own or not found:
                found = against_people(votes, people, method, own, plan.seed)
            yield from (
                PeerRow(name, number, measure, "", *value) for measure, value in found.items()
            )
        for agent in votes.authors.tolist() if plan.budget else ():
            least = judges_to_win(votes, method, agent, None, plan.budget, plan.seed)
            yield PeerRow(
                name, 0, "to win", votes.agents[agent], math.nan if least is None else least
            )


def peer_tables(rows: Sequence[PeerRow]) -> Tables:
    """Return tables by title: agreement with people by the number of own votes, and the numbers of
    bought judges.
    """
    agreement, bought = (
        _grid([row for row in rows if row.measure == one]) for one in ("agreement", "to win")
    )
    titles = (
        "Agreement with people, by the number of own votes",
        "Judges that must be bought to put an agent first",
    )
    return {
        title: table for title, table in zip(titles, (agreement, bought), strict=True) if table[1]
    }


def _grid(rows: Sequence[PeerRow]) -> tuple[list[str], list[list[str]]]:
    """Return headings and lines by method, across agents or numbers of own votes."""
    across = list(dict.fromkeys(row.agent or f"{row.own}" for row in rows))
    lines: dict[str, list[str]] = {}
    for row in rows:
        word = (
            ("none" if math.isnan(row.value) else f"{row.value:.0f}")
            if row.agent
            else _interval(row)
        )
        lines.setdefault(row.method, []).append(word)
    return ["method", *across], [[name, *line] for name, line in lines.items()]
