"""The scripts of the questions about the worst one."""

import pytest

from roletrust_env import attackers
from studies.questions import breaking, roles
from studies.questions.answers import Effort

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("question", [breaking, roles])
def test_attacks_that_came_after_the_answers_are_not_played(question):
    suite = question._suite(Effort(48, 0, quick=False))
    treating = {"personal-milking", "personal-milking-ring", "personal-sybil-ring", "quiet-discrimination", "rotation"}
    assert set(attackers()) - set(suite.attacks) == {"swap-ends", "learned"} | treating
