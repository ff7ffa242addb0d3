"""Tables of `roletrust rate` for a terminal of 80 columns."""

from typing import Any

from rich.table import Table

from roletrust_env.logs.calibration import Calibration
from roletrust_env.logs.evidence import Role
from roletrust_env.logs.explain import Explanation
from roletrust_env.logs.log import Log
from roletrust_env.logs.suspects import Search
from roletrust_experiments.commands.console import number_table, shown

_SHOWN = 4  # ratings of a rater, and members of a group
_ENDS = 5  # agents at either end of a ranking


def ranking_table(found: Any, role: Role) -> Table:
    """Return the agents at both ends of a table of `Rated` as one of 80 columns."""
    size, others = len(found), "raters" if role == "ratee" else "ratees"
    scores = ["trust", "estimate", "interval"] if role == "ratee" else ["trust"]
    table = number_table(
        f"Trust in {size:,} {role}s", "", "rank", *scores, "ratings", others, "last"
    )
    ends = list(dict.fromkeys([*range(min(_ENDS, size)), *range(max(0, size - _ENDS), size)]))
    for place, row in zip(ends, found.take(ends).to_pylist(), strict=True):
        cells = [f"{place + 1:,}", f"{row['trust']:.4f}"]
        if role == "ratee":
            interval = "-" if row["low"] is None else f"{row['low']:.2f} {row['high']:.2f}"
            cells += [f"{row['estimate']:.4f}", interval]
        last = "-" if row["last"] is None else f"{row['last']!s:.10}"
        table.add_row(shown(row["name"]), *cells, f"{row['ratings']:,}", f"{row[others]:,}", last)
        if place == _ENDS - 1 and len(ends) < size:
            table.add_row("...")
    return table


def calibration_table(calibration: Calibration) -> Table:
    """Return how many later means intervals covered in the past of a log, by number of raters."""
    title = f"Intervals covered {calibration.coverage:.0%} of later means"
    table = number_table(title, "", "later means", "covered", "from", "to", name="raters")
    for group in calibration.groups:
        covered = "-" if group.coverage is None else f"{group.coverage:.0%}"
        ends = f"{group.low:+.2f}", f"{group.high:+.2f}"
        table.add_row(f"{group.raters} or more", f"{group.agents:,}", covered, *ends)
    return table


def explanation_table(explanation: Explanation, scale: tuple[float, float]) -> Table:
    """Return what makes the trust in an agent, with ratings on their scale."""
    rated, (worst, best) = explanation.role == "ratee", scale
    other = "rater" if rated else "ratee"
    title = (
        f"Trust in the {explanation.role} {shown(explanation.name)}: {explanation.trust:.4f}, rank "
        f"{explanation.rank:,} by trust"
    )
    whose = "its ratings of the agent" if rated else "the agent's ratings of it"
    many = (
        f"{len(explanation.reasons)} of {explanation.n_others:,} {other}s "
        f"with {explanation.n_ratings:,} ratings."
    )
    caption = f"{many} Others: their mean rating. Without: trust after the log without {whose}."
    table = number_table(
        title, caption, "ratings", "others", "trust in it", "without", "change", "rank", name=other
    )
    for agent, trust, ratings, others, without, rank in explanation.reasons:
        values = [f"{worst + value * (best - worst):g}" for value in ratings[-_SHOWN:].tolist()]
        last = ", ".join(["..."] * (len(ratings) > _SHOWN) + values)
        view = f"{worst + others * (best - worst):.3g}" if others == others else "-"  # NaN
        trusts = f"{trust:.3f}", f"{without:.4f}", f"{without - explanation.trust:+.4f}"
        table.add_row(shown(agent), last, view, *trusts, f"{rank:,}")
    return table


def suspects_table(search: Search, log: Log) -> Table:
    """Return the groups of raters that rate alike, and what they do to ranks."""
    caption = (
        f"In {search.shuffles} shuffled logs: {search.false_groups} groups. "
        "Shift: of percentiles of their ratees. "
        "Apart: from ratings of others. With p = 1/n, the n-th log did as much; above 0.05, it may "
        "be an honest club."
    )
    title = f"Raters that rate alike beyond chance: {len(search.groups)} groups"
    table = number_table(title, caption, "raters", "ratees", "shift", "shuffled", "apart", "p")
    for raters, ratees, shift, apart, chance, p in search.groups:
        names = [
            *(log.rater_names[place] for place in raters[:_SHOWN].tolist()),
            *["..."] * (len(raters) > _SHOWN),
        ]
        cells = (
            f"{number:.3f}" if number == number else "-" for number in (shift, chance, apart)
        )  # NaN
        table.add_row(
            shown(", ".join(names)), f"{len(raters):,}", f"{len(ratees):,}", *cells, f"{p:.2f}"
        )
    return table
