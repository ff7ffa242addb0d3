"""One model under one attack, in numbers."""

from typing import Any

import pytest

from roletrust_baselines import BadMouthing
from roletrust_env.evaluation import evaluate
from roletrust_env.evaluation.search import Budget
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


@pytest.mark.parametrize(
    ("attack", "words"),
    [
        ({"sr_2": BadMouthing, "sr_1": BadMouthing()}, "attack of 'sr_2' is <class .*; it must be a Policy"),
        ({"sr_1": None}, "attack of 'sr_1' is None"),
        ({"sr_*": "bad-mouthing", "sr_2": BadMouthing()}, "attack gives agent 'sr_2' two attacks"),
        (BadMouthing(), r"name the agents of a policy, such as \{'sr_2': BadMouthing\(\)\}"),
        ([BadMouthing()], "name the agents of a policy"),
    ],
)
def test_no_attack_is_left_out_in_silence(attack: Any, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        evaluate("mean", attack, games=2)


@pytest.mark.parametrize("odd", [{"games": 2.5}, {"games": "3"}, {"seed": -1}, {"seed": None}, {"share": "x"}])
def test_numbers_that_make_no_sense_are_refused(odd: dict[str, Any]) -> None:
    (name,) = odd
    with pytest.raises(ValueError, match=f"{name} is .*; it must"):
        evaluate("mean", "bad-mouthing", **odd)


@pytest.mark.parametrize("rounds", [-5, "x", None, 2.5])
def test_a_budget_is_a_number_of_rounds(rounds: Any) -> None:
    with pytest.raises(ValueError, match="the budget is"):
        Budget(rounds)
