"""Entries of attacks: the worst attacks of a run as known attacks, which others can play."""

import re
from collections.abc import Iterator, Sequence

import numpy as np

from roletrust_env.benchmarking.cells import Cell, model_names
from roletrust_env.benchmarking.known_attacks import KnownAttack, KnownAttacks, joined
from roletrust_env.benchmarking.run_cell import find_attack
from roletrust_env.benchmarking.schema import FORBIDDEN
from roletrust_env.benchmarking.store import StoredCell
from roletrust_env.benchmarking.suite import Suite
from roletrust_env.benchmarking.worst_case import attack_scores, least_mean, worst_cases
from roletrust_env.errors import suggest
from roletrust_env.evaluation.attackers import Scripted
from roletrust_env.evaluation.records import record_of


def make_entries(
    suite: Suite, stored: Sequence[StoredCell], models: Sequence[str] = (), finder: str = ""
) -> tuple[KnownAttacks, list[str]]:
    """Return the worst attack on each trust model in each condition, and the attacks that cannot be recorded.

    An attack that is the worst one on several trust models is listed once in a condition, with the name of the first.

    Args:
        suite: Suite of the run.
        stored: Cells of the run with their results.
        models: Names of trust models. Empty means all of the run.
        finder: Who found the attacks.

    Raises:
        ValueError: The run has no such model, or none of its worst attacks can be recorded.
    """
    known = model_names(suite)
    if unknown := [name for name in models if name not in known]:
        raise ValueError(f"the run has no trust model {unknown[0]!r}{suggest(unknown[0], known)}")
    entries, lost = [], []
    for place, name in _worst(suite, stored, models or known):
        entry = _entry(suite, stored, place, name, finder)
        if entry is None:
            lost.append(f"{name} in {place.key}")
        else:
            entries.append(entry)
    if not entries:
        what = f", such as {lost[0]}" if lost else ""
        raise ValueError(f"the run has no attack that can be recorded{what}; scripts of packages and coalitions can")
    return KnownAttacks(attacks=joined(entries)), lost


def _worst(suite: Suite, stored: Sequence[StoredCell], models: Sequence[str]) -> Iterator[tuple[Cell, str]]:
    """Yield the cell and the name of the worst attack on each model in each condition; of several seeds the worst."""
    seeds = sorted({cell.seed for cell, result in stored if result.rows})
    for (model, condition), case in worst_cases(attack_scores(suite, stored)).items():
        if model in models and suite.tracks[condition.track].roles:
            means = [least_mean(one.chosen[k]) for k, one in enumerate(case.choices)]
            k = int(np.argmin(means))
            yield Cell(model, *condition, case.choices[k].method, seeds[k]), case.choices[k].attack


def _entry(suite: Suite, stored: Sequence[StoredCell], place: Cell, attack: str, finder: str) -> KnownAttack | None:
    """Return an attack of a cell as a known attack, or None if it cannot be recorded."""
    if place.method == "known":
        return next(one for one in suite.known if (one.name, one.condition) == (attack, place[1:4]))
    record = _record(suite, stored, place, attack)
    if not record:
        return None
    title = re.sub(FORBIDDEN, "-", f"{attack} against {place.model}")[:300]
    return KnownAttack(
        name=title, scenario=place.scenario, track=place.track, share=place.share, finder=finder, record=record
    )


def _record(suite: Suite, stored: Sequence[StoredCell], place: Cell, attack: str) -> str:
    """Return the record of an attack in a cell. A script at its defaults is made again, since it has none."""
    rows = next(one.result.rows for one in stored if one.cell == place)
    record = next(row.record for row in rows if row.attack == attack)
    if record or place.method != "scripted":
        return record
    found = find_attack(suite, place, attack)
    return record_of(Scripted(found.batch.scripts(found.row)))
