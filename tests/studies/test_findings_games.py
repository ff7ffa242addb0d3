"""The scripts of the questions about the worst one."""

import pytest
from rich.progress import Progress

from roletrust_env import attackers
from studies.findings import breaking, roles
from studies.findings.games import Effort

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("question", [breaking, roles])
def test_attacks_that_came_after_the_answers_are_not_played(question):
    suite = question._suite(Effort(48, 0, quick=False, progress=Progress()))
    assert set(attackers()) - set(suite.attacks) == {"swap-ends", "learned"}
