"""Entries of attacks: the worst attacks of a run as known attacks, which others can play."""

from collections.abc import Iterator, Sequence

import numpy as np

from roletrust_env.benchmark.cells import Cell, model_names
from roletrust_env.benchmark.known_attacks import KnownAttack, KnownAttacks
from roletrust_env.benchmark.run_cell import find_attack
from roletrust_env.benchmark.store import StoredCell
from roletrust_env.benchmark.suite import Suite
from roletrust_env.benchmark.worst_case import attack_scores, least_mean, worst_cases
from roletrust_env.errors import suggest
from roletrust_env.evaluation.attackers import Scripted
from roletrust_env.evaluation.records import record_of


def make_entries(
    suite: Suite, stored: Sequence[StoredCell], models: Sequence[str] = (), finder: str = ""
) -> tuple[KnownAttacks, list[str]]:
    """Return the worst attack on each trust model in each condition, and the attacks that cannot be recorded.

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
        record = _record(suite, stored, place, name)
        if not record:
            lost.append(f"{name} in {place.key}")
            continue
        title = f"{name} against {place.model}"
        entries.append(
            KnownAttack(
                name=title, scenario=place.scenario, track=place.track, share=place.share, finder=finder, record=record
            )
        )
    if not entries:
        raise ValueError("the run has no attack that can be recorded; it must attack, and by scripts or coalitions")
    return KnownAttacks(attacks=tuple(entries)), lost


def _worst(suite: Suite, stored: Sequence[StoredCell], models: Sequence[str]) -> Iterator[tuple[Cell, str]]:
    """Yield the cell and the name of the worst attack on each model in each condition; of several seeds the worst."""
    cases = worst_cases(attack_scores(stored, suite.score))
    for (model, condition), case in cases.items():
        if model not in models or not suite.tracks[condition.track].roles:
            continue
        seeds = [one.cell for one in stored if one.cell[:5] == (model, *condition, case.rung) and one.result.rows]
        yield min(seeds, key=lambda cell: _score(suite, stored, cell, case.attack)), case.attack


def _score(suite: Suite, stored: Sequence[StoredCell], place: Cell, attack: str) -> float:
    """Return the mean score of an attack in a cell, in the games for choosing."""
    scores = attack_scores([one for one in stored if one.cell == place], suite.score)
    return min((least_mean(one.chosen) for one in scores if one.attack == attack), default=np.inf)


def _record(suite: Suite, stored: Sequence[StoredCell], place: Cell, attack: str) -> str:
    """Return the record of an attack in a cell. A script at its defaults is made again, since it has none."""
    rows = next(one.result.rows for one in stored if one.cell == place)
    record = next(row.record for row in rows if row.attack == attack)
    if record or place.rung != "scripted":
        return record
    found = find_attack(suite, place, attack)
    return record_of(Scripted(found.batch.scripts(found.row)))
