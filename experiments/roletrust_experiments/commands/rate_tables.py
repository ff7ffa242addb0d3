"""Tables of `roletrust rate` for a terminal of 80 columns."""

from typing import Any

from rich.table import Table

from roletrust_env.errors import counted
from roletrust_env.logs.calibration import Calibration
from roletrust_env.logs.evidence import Role
from roletrust_env.logs.explain import Explanation
from roletrust_env.logs.log import Log
from roletrust_env.logs.suspects import Suspects
from roletrust_experiments.commands.console import number_table, shown

_SHOWN = 4  # ratings of a rater, and members of a group
_GROUPS = 20  # groups of suspects
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
            interval = "-" if row["low"] is None else f"{row['low']:.2f} to {row['high']:.2f}"
            cells += [f"{row['estimate']:.4f}", interval]
        last = "-" if row["last"] is None else str(row["last"]).removesuffix(".0").split(" ")[0]
        table.add_row(shown(row["name"]), *cells, f"{row['ratings']:,}", f"{row[others]:,}", last)
        if place == _ENDS - 1 and len(ends) < size:
            table.add_row("...")
    return table


def calibration_table(calibration: Calibration) -> Table:
    """Return how many later means intervals covered in the past of a log, by number of raters."""
    title = f"Intervals covered {calibration.coverage:.0%} of later means (wanted: 95%)"
    caption = "from, to: ends of the interval, from the estimate on"
    table = number_table(title, caption, "later means", "covered", "from", "to", name="raters")
    starts = [group.raters for group in calibration.groups]
    for group, after in zip(calibration.groups, [*starts[1:], None], strict=True):
        covered = "-" if group.coverage is None else f"{group.coverage:.0%}"
        ends = f"{group.low:+.2f}", f"{group.high:+.2f}"
        most = " or more" if after is None else f" to {after - 1}" * (after > group.raters + 1)
        table.add_row(f"{group.raters}{most}", f"{group.agents:,}", covered, *ends)
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
        f"with {counted(explanation.n_ratings, 'rating')}."
    )
    caption = (
        f"{many} Others: their mean rating, on the scale of the log. Without: trust, from 0 to 1, "
        f"after the log without {whose}."
    )
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


def suspects_table(suspects: Suspects, log: Log) -> Table:
    """Return the groups of raters that rate alike, and how many of them chance makes."""
    title = f"Raters that rate alike beyond chance: {len(suspects.groups)} groups"
    caption = (
        f"Any group in {suspects.false_positive_rate:.0%} of {suspects.shuffles} shuffled logs, "
        f"{suspects.false_groups:.2f} on average. "
        "Apart: distance from the ratings of others. "
        "p: chance makes it as large. An honest club has a large p."
    )
    table = number_table(title, caption, "raters", "ratees", "apart", "p")
    for group in suspects.groups[:_GROUPS]:
        size = len(group.raters)
        names = [log.rater_names[position] for position in group.raters[:_SHOWN].tolist()]
        if size > _SHOWN:
            names.append("...")
        cells = f"{size:,}", f"{len(group.ratees):,}", f"{group.apart:.3f}", f"{group.p:.2f}"
        table.add_row(shown(", ".join(names)), *cells)
    return table
