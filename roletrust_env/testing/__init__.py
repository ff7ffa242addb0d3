"""Checks of trust models and attacks, for the tests of plug-ins.

`check_trust_model` and `check_attack` raise an error of one line that says what to change:

    from roletrust_env.testing import check_attack, check_trust_model

    def test_my_model():
        check_trust_model(MyModel())

    def test_my_attack():
        check_attack(MyAttack())
"""

from roletrust_env.testing.attacks import check_attack
from roletrust_env.testing.trust_models import check_trust_model

__all__ = ["check_attack", "check_trust_model"]
