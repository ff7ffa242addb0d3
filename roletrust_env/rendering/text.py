"""Text rendering of a game."""

from __future__ import annotations

import numpy as np

from roletrust_env.rendering.scene import Floats, Scene, Side

_TABLE_LIMIT = 12  # largest number of raters or providers with a row each

_FEW = 4  # number of the best and of the worst agents shown if there are more than the limit

_BAR = 16


def as_text(scene: Scene) -> str:
    """Return tables of the raters with their ratings and of the providers; summaries if there are
    many.
    """
    header = f"{scene.title}  ·  {scene.clock}"
    if scene.perturbation > 0:
        header += f"  ·  perturbation {scene.perturbation:.0%}"
    small = max(scene.ratings.shape) <= _TABLE_LIMIT
    tables = [
        *_table("rater", "ToR", scene.raters, scene if small else None),
        "",
        *_table("provider", "ToP", scene.providers),
    ]
    given = scene.ratings[~np.isnan(scene.ratings)]
    if not small:
        ratings = f"ratings    {given.size} arrived"
        tables += [
            "",
            ratings
            + (f", mean {given.mean():.2f}, lowest {given.min():.2f}" if given.size else ""),
        ]
    rule = "─" * max(len(line) for line in [header, *tables])
    return "\n".join([header, rule, *tables])


def _table(kind: str, trust: str, side: Side, matrix: Scene | None = None) -> list[str]:
    """Return the lines of the table of one side, with the ratings of each rater if a matrix is
    given.
    """
    width = max(8, *map(len, side.names))
    captions = max(5, *map(len, side.captions))
    head = f"{kind:<{width}}   {trust}  {'':<{_BAR}}"
    rows = [
        f"{name:<{width}} {'!' if bad else ' '} {'' if absence else f'{value:.2f}':4} "
        f"{_bar(value, absence)}  {caption}"
        for name, value, bad, absence, caption in zip(*side, strict=True)
    ]
    if matrix is not None:
        columns = [max(5, len(name)) for name in matrix.providers.names]
        titles = (f"{name:>{w}}" for name, w in zip(matrix.providers.names, columns, strict=True))
        head = f"{head}  {'':<{captions}}  {' '.join(titles)}"
        wide = len(rows[0]) - len(side.captions[0]) + captions
        rows = [
            f"{row:<{wide}}  "
            + " ".join(f"{_rating(f):>{w}}" for f, w in zip(given, columns, strict=True))
            for row, given in zip(rows, matrix.ratings, strict=True)
        ]
    return [line.rstrip() for line in (head, *_few(rows, kind, trust, side))]


def _few(rows: list[str], kind: str, trust: str, side: Side) -> list[str]:
    """Return the rows; if there are too many, return means and the best and the worst of the
    present agents.
    """
    if len(rows) <= _TABLE_LIMIT:
        return rows
    present = np.asarray([not absence for absence in side.absences])
    best = [int(k) for k in np.argsort(-side.trust, kind="stable") if present[k]]
    summary = [
        f"{present.sum()} of {len(rows)} {kind}s present, mean {trust} {_mean(side.trust[present])}"
    ]
    if side.attacker.any():
        attackers, honest = present & side.attacker, present & ~side.attacker
        summary.append(
            f"{side.attacker.sum()} attackers, mean {trust} {_mean(side.trust[attackers])}; "
            f"honest agents {_mean(side.trust[honest])}"
        )
    if len(best) <= 2 * _FEW:
        return [*summary, *(rows[k] for k in best)]
    between = f"  ... {len(best) - 2 * _FEW} more"
    return [*summary, *(rows[k] for k in best[:_FEW]), between, *(rows[k] for k in best[-_FEW:])]


def _mean(values: Floats) -> str:
    return f"{values.mean():.2f}" if values.size else "-"


def _rating(rating: float) -> str:
    return "·" if np.isnan(rating) else f"{rating:.2f}"


def _bar(value: float, absence: str) -> str:
    """Return a bar with a resolution of an eighth of a character; it is blank for an absent
    agent.
    """
    if absence:
        return " " * _BAR
    full, rest = divmod(round(value * _BAR * 8), 8)
    bar = "█" * full + (" ▏▎▍▌▋▊▉"[rest] if rest else "")
    return bar + "·" * (_BAR - len(bar))
