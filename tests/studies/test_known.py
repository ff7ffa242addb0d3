"""The choice of known attacks: a cover of the models, the first half of it without treatment."""

from types import SimpleNamespace

import numpy as np

from studies import SUITES
from studies.condition import suite_of
from studies.known import choice


def scores(**attacks):
    """Return scores of attacks by name: whether they treat raters, and the skill that they leave to each model."""
    return [
        SimpleNamespace(
            attack=name, model=f"model {k}", treats=treats, chosen=np.array([[left]]), score=np.array([[left]])
        )
        for name, (treats, *skills) in attacks.items()
        for k, left in enumerate(skills)
    ]


def test_a_choice_covers_the_models_and_begins_with_attacks_that_serve_all_alike():
    found = scores(both=(False, 0.5, 0.5), first=(False, 0.3, 0.9), weak=(False, 0.6, 0.6), treating=(True, 0.0, 0.8))
    assert choice(found, 2) == ["both", "treating"]
    assert choice(found, 4) == ["both", "first", "treating"]  # weak lowers nothing
    assert choice(scores(only=(True, 0.1)), 2) == ["only"]


def test_every_suite_of_the_studies_can_be_read():
    assert all(suite_of(file.stem).models for file in SUITES.glob("*.toml"))
    assert {one[1] for one in suite_of("known-attacks").conditions} >= {one.track for one in suite_of("standard").known}
