"""The page of `roletrust audit`: the curve of effect against price, and its tables, complete in one
file.
"""

from base64 import b64encode

from matplotlib.figure import Figure

from roletrust_env.logs.audit import AuditReport
from roletrust_env.logs.audit_ranking import Goal
from roletrust_experiments.plots.style import ATTACKER, DASHES, HONEST, INK, quiet
from roletrust_experiments.report.page import environment

WORDS: dict[Goal, str] = {"sink": "out of top", "lift": "into top", "enter": "newcomer in"}
"""Goals of attacks in words."""


def audit_page(report: AuditReport, picture: bytes) -> str:
    """Return the page, which needs no other file and no network.

    Args:
        report: Report of the audit.
        picture: Its figure as a PNG file.
    """
    shown = b64encode(picture).decode()
    return (
        environment().get_template("audit.html").render(report=report, picture=shown, words=WORDS)
    )


def audit_figure(report: AuditReport) -> Figure:
    """Return what attacks up to a price reach: the share of targets that cross the edge, and the
    ranks they move.
    """
    audited = report.audit
    figure = Figure(figsize=(10, 3.6), layout="constrained")
    labels = {"pushed": "share of targets pushed over the edge", "places": "ranks moved, mean"}
    for axes, (name, label) in zip(figure.subplots(1, 2), labels.items(), strict=True):
        for (goal, words), colour, dash in zip(
            WORDS.items(), (ATTACKER, *HONEST[:2]), DASHES, strict=False
        ):
            points = [point for point in audited.curve if point.goal == goal]
            prices, reach = (
                [point.price for point in points],
                [getattr(point, name) for point in points],
            )
            axes.step(
                prices,
                [interval.value for interval in reach],
                where="post",
                color=colour,
                linestyle=dash,
                label=words,
            )
            ends = [interval.low for interval in reach], [interval.high for interval in reach]
            axes.fill_between(prices, *ends, step="post", color=colour, alpha=0.15, linewidth=0)
        axes.set_xscale(
            "symlog",
            linthresh=max(
                1e-9, min((point.price for point in audited.curve if point.price), default=1.0)
            ),
        )
        axes.set_xlabel("price of the attack on one target", color=INK)
        axes.set_ylabel(label, color=INK)
        axes.set_ylim(bottom=0)
        quiet(axes, "both")
    figure.axes[0].legend(frameon=False, labelcolor=INK, fontsize=9, loc="lower right")
    return figure
