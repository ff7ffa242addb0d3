"""The choice of known attacks: a cover of the models, the first half of it without treatment."""

from types import SimpleNamespace

import numpy as np
from csv_files import csv_rows

from studies import SUITES
from studies.condition import suite_of
from studies.known import choice
from studies.study import DOCS


def scores(**attacks):
    """Return scores of attacks by name: whether they treat raters, and the skill that they leave to
    each model."""
    return [
        SimpleNamespace(
            attack=name,
            model=f"model {k}",
            treats=treats,
            chosen=np.array([[left]]),
            score=np.array([[left]]),
        )
        for name, (treats, *skills) in attacks.items()
        for k, left in enumerate(skills)
    ]


def test_a_choice_covers_the_models_and_begins_with_attacks_that_serve_all_alike():
    found = scores(
        both=(False, 0.5, 0.5),
        first=(False, 0.3, 0.9),
        weak=(False, 0.6, 0.6),
        treating=(True, 0.0, 0.8),
    )
    assert choice(found, 2) == ["both", "treating"]
    assert choice(found, 4) == ["both", "first", "treating"]  # weak lowers nothing
    assert choice(scores(only=(True, 0.1)), 2) == ["only"]


def test_every_suite_of_the_studies_can_be_read():
    assert all(suite_of(file.stem).models for file in SUITES.glob("*.toml"))
    assert {one[1] for one in suite_of("known-attacks").conditions} >= {
        one.track for one in suite_of("standard").known
    }


def worst_cases(name):
    """Return the score and half of its interval by model and condition, from a table of worst
    cases."""
    rows = [row for row in csv_rows(DOCS / "leaderboards" / name) if float(row["share"])]
    found = {}
    for row in rows:
        at = found.setdefault(row["model"], {})
        at[row["scenario"], row["track"]] = float(row["score"]), float(row["score_half_95"])
    return found


def test_the_page_says_what_attacks_by_hand_take_from_each_model():
    published, by_hand = worst_cases("standard/worst_cases.csv"), worst_cases("by-hand.csv")
    lines = []
    for model, found in by_hand.items():
        before = published[model]
        lost = {at: score - found.get(at, (score,))[0] for at, (score, _) in before.items()}
        after = [score - max(lost[at], 0) for at, (score, _) in before.items()]
        means = (
            f"{np.mean(scores):.3f}" for scores in ([score for score, _ in before.values()], after)
        )
        lower, beyond = (
            sum(x > 0 for x in lost.values()),
            sum(lost[at] > half for at, (_, half) in before.items()),
        )
        most = max(lost, key=lost.get)
        at = (
            f"{', '.join(most)}: {before[most][0]:.3f} to {found[most][0]:.3f}"
            if lost[most] > 0
            else "none"
        )
        lines.append(f"| `{model}` | {' | '.join(means)} | {lower} | {beyond} | {at} |")
    page = (DOCS / "robustness.md").read_text(encoding="utf-8")
    assert "\n".join(lines) in page
