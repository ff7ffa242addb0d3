"""Tables of `roletrust rate` for a terminal of 80 columns: a ranking, an explanation, and
suspects.
"""

from rich.table import Table

from roletrust_env.logs.evidence import Evidence, as_dates
from roletrust_env.logs.explain import Explanation
from roletrust_env.logs.log import Log
from roletrust_env.logs.suspects import Search
from roletrust_experiments.commands.console import number_table, shown

_SHOWN = 4  # ratings of a rater, and members of a group


def ranking_table(ranked: Evidence, role: str, rank: str, top: int) -> Table:
    """Return the agents at both ends of a ranking as a table of 80 columns."""
    size, others = len(ranked.names), "raters" if role == "ratee" else "ratees"
    title = f"Trust in {size:,} {role}s, ranked by {'its lower end' if rank == 'low' else 'trust'}"
    table = number_table(
        title, "", "rank", "trust", "interval", "ratings", others, "indep.", "last"
    )
    ends = list(dict.fromkeys([*range(min(top, size)), *range(max(0, size - top), size)]))
    part = ranked.at(ends)
    for place, row in zip(
        ends, zip(*part._replace(last=as_dates(part.last)), strict=True), strict=True
    ):
        agent, trust, low, high, ratings, number, independent, last = row
        interval = "-" if low != low else f"{low:.2f} {high:.2f}"  # NaN
        when = "-" if last != last else f"{last!s:.10}"
        counts = f"{ratings:,}", f"{number:,}", f"{independent:.1f}"
        table.add_row(shown(agent), f"{place + 1:,}", f"{trust:.4f}", interval, *counts, when)
        if place == top - 1 and len(ends) < size:
            table.add_row("...")
    return table


def explanation_table(explanation: Explanation, log: Log, scale: tuple[float, float]) -> Table:
    """Return what makes the trust in an agent, with ratings on their scale."""
    rated, (worst, best) = explanation.role == "ratee", scale
    names, other = (log.rater_names, "rater") if rated else (log.ratee_names, "ratee")
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
        table.add_row(shown(names[agent]), last, view, *trusts, f"{rank:,}")
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
