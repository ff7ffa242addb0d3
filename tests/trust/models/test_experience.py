"""What judges of personal models know: their own services, and the delivered ratings of others."""

import numpy as np
import pytest
from judged import DELIVERED, RECEIVED, judge_trust
from model_cases import named

from roletrust_env.trust import Traits, trust_models

PERSONAL = [name for name in trust_models() if Traits.of(named(name)).family == "personal"]


def seen_by(judge: int) -> list[tuple[np.ndarray, np.ndarray]]:
    """The ratings that a judge knows: its own services, and what others delivered."""
    rounds = []
    for delivered, received in zip(DELIVERED, RECEIVED, strict=True):
        parts = [np.copy(part) for part in delivered]
        for part, own in zip(parts, received, strict=True):
            part[judge] = own[judge]
        rounds.append((parts[0], parts[1]))
    return rounds


PUBLIC = "blended", "clustering", "zhang-cohen"


@pytest.mark.parametrize("name", [n for n in PERSONAL if n not in PUBLIC])
def test_a_judge_remembers_its_services_and_hears_what_others_delivered(name: str) -> None:
    """The others also have something public: the published trust of a central model, clusters and
    consistency of all delivered ratings."""
    model = named(name)
    trust = judge_trust(model, DELIVERED, RECEIVED)
    for judge in range(len(trust)):
        alone = judge_trust(model, seen_by(judge))[judge]
        np.testing.assert_allclose(trust[judge], alone, rtol=0, atol=1e-12)


@pytest.mark.parametrize("name", PERSONAL)
def test_what_others_perceived_but_did_not_deliver_changes_nothing(name: str) -> None:
    model = named(name)
    other = [(1 - values, mask) for values, mask in RECEIVED]
    for part, kept in zip(other, RECEIVED, strict=True):
        part[0][0] = kept[0][0]
    before, after = (judge_trust(model, DELIVERED, received) for received in (RECEIVED, other))
    assert np.array_equal(before[0], after[0])
    assert not np.array_equal(before[1], after[1])
