"""The page of `roletrust audit`: a figure and a table, complete in one file."""

import math
from base64 import b64encode

from matplotlib.figure import Figure

from roletrust_env.logs.audit import AuditReport
from roletrust_env.logs.audit_ranking import Goal
from roletrust_experiments.plots.style import ATTACKER, DASHES, HONEST, INK, quiet
from roletrust_experiments.report.page import environment

WORDS: dict[Goal, str] = {"sink": "out of top", "lift": "into top", "enter": "newcomer in"}
"""Goals of attacks in words."""


def amount(price: float) -> str:
    """Return a price in four digits; "none" if it is infinite, "-" if it is unknown."""
    return "-" if math.isnan(price) else "none" if math.isinf(price) else f"{price:,.4g}"


def audit_page(report: AuditReport, picture: bytes) -> str:
    """Return the page, which needs no other file and no network.

    Args:
        report: Report of the audit.
        picture: Its figure as a PNG file.
    """
    page = environment().get_template("audit.html")
    shown = b64encode(picture).decode()
    return page.render(report=report, picture=shown, words=WORDS, amount=amount)


def audit_figure(report: AuditReport) -> Figure:
    """Return the share of targets that attacks up to a price push over the edge of the top."""
    figure = Figure(figsize=(7, 3.6), layout="constrained")
    axes = figure.subplots()
    prices = [point.price for point in report.curve]
    last = 2 * max(prices, default=1.0)
    for (goal, words), colour, dash in zip(
        WORDS.items(), (ATTACKER, *HONEST[:2]), DASHES, strict=False
    ):
        points = [point for point in report.curve if point.goal == goal]
        if not points:
            continue
        at = [0.0, *(point.price for point in points), last]
        ends = [(0.0, 0.0, 0.0), *(point.pushed for point in points), points[-1].pushed]
        value, low, high = zip(*ends, strict=True)
        axes.step(at, value, where="post", color=colour, linestyle=dash, label=words)
        axes.fill_between(at, low, high, step="post", color=colour, alpha=0.15, linewidth=0)
    axes.set_xscale("symlog", linthresh=min(filter(None, prices), default=1.0))
    labels = {"xlabel": "price of the attack on one target", "ylabel": "share of targets"}
    axes.set(**labels, ylim=(0, 1.05))
    quiet(axes, "both")
    axes.legend(frameon=False, labelcolor=INK, fontsize=9, loc="lower right")
    return figure
