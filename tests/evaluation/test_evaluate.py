"""One model under one attack, in numbers."""

import pytest

from roletrust_baselines import BadMouthing
from roletrust_env.evaluation import evaluate
from roletrust_env.trust.models.central.mean import Mean


def test_a_spec_a_policy_and_a_name_of_an_agent_mean_the_same() -> None:
    def result(*arguments, seed: int = 0) -> str:
        return repr(evaluate(*arguments, "paper-3x3", games=2, seed=seed))  # NaN is not equal to itself

    by_share = result("mean", "bad-mouthing:level=0")
    assert by_share == result("mean", "sr_2=bad-mouthing:level=0")
    assert by_share == result(Mean(), {"sr_2": BadMouthing(level=0.0)})
    assert by_share == result("mean", {"sr_2": "bad-mouthing:level=0"})
    assert by_share != result("mean", "bad-mouthing:level=0", seed=1)
    assert "auc: undefined" in by_share


def test_an_attack_costs_trust_and_utility_in_a_market() -> None:
    result = evaluate("mean", "bad-mouthing:level=0", "market", games=4, share=0.4)
    assert result.utility.mean < result.clean.mean
    assert result.blind.mean < result.clean.mean <= 1
    assert result.damage.mean > 0.1
    assert "utility: " in repr(result)


def test_a_ring_takes_raters_and_providers() -> None:
    result = evaluate("role-trust", "collusion", "crowd-10x10", games=2, share=0.2)
    assert result.damage.mean > 0.05


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("mean", "bad-mouthin"), "did you mean 'bad-mouthing'"),
        (("meen", "bad-mouthing"), "did you mean 'mean'"),
        (("mean", "sr_9=bad-mouthing"), "there is no 'sr_9'"),
        (("mean", "sr_2=bad-mouthing:lvl=1"), "did you mean 'level'"),
        (("mean", "bad-mouthing", "papr-3x3"), "paper-3x3"),
    ],
)
def test_an_unknown_name_is_one_line_with_a_suggestion(arguments: tuple[str, ...], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        evaluate(*arguments)  # type: ignore[arg-type]


@pytest.mark.parametrize(("name", "value"), [("games", 0), ("share", 1.0)])
def test_a_value_out_of_range_is_refused(name: str, value: float) -> None:
    with pytest.raises(ValueError, match=name):
        evaluate("mean", "bad-mouthing", **{name: value})  # type: ignore[arg-type]
