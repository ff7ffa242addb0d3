"""One model under one attack, in numbers."""

from typing import Any

from refusals import refuses

from roletrust_baselines import BadMouthing
from roletrust_env import make_scenario
from roletrust_env.evaluation import evaluate
from roletrust_env.evaluation.search import Budget
from roletrust_env.trust.models.central.means import Mean

SHORT = make_scenario("paper-3x3").change(max_cycles=30)


def test_a_spec_a_policy_and_a_name_of_an_agent_mean_the_same() -> None:
    def result(*arguments, seed: int = 0) -> str:
        return repr(evaluate(*arguments, SHORT, games=2, seed=seed))  # NaN is not equal to itself

    by_share = result("mean", "bad-mouthing:level=0")
    assert by_share == result("mean", "sr_2=bad-mouthing:level=0")
    assert by_share == result(Mean(), {"sr_2": BadMouthing(level=0.0)})
    assert by_share == result("mean", {"sr_2": "bad-mouthing:level=0"})
    assert by_share == repr(
        evaluate("mean", "bad-mouthing:level=0", SHORT, games=2, share=0.01)
    )  # one at least
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


def refused(words: tuple[object, ...], *arguments: Any, **options: Any) -> None:
    with refuses(ValueError, *words):
        evaluate(*arguments, **options)


def test_an_unknown_name_is_one_line_with_a_suggestion() -> None:
    refused(("bad-mouthin", "bad-mouthing"), "mean", "bad-mouthin")
    refused(("meen", "mean"), "meen", "bad-mouthing")
    refused(("compromised", "sr_9"), "mean", "sr_9=bad-mouthing")
    refused(("bad-mouthing", "lvl", "level"), "mean", "sr_2=bad-mouthing:lvl=1")
    refused(("papr-3x3", "paper-3x3"), "mean", "bad-mouthing", "papr-3x3")


def test_no_attack_is_left_out_in_silence() -> None:
    for attack, words in (
        (
            {"sr_2": BadMouthing, "sr_1": BadMouthing()},
            ("sr_2", "Policy"),
        ),
        ({"sr_1": None}, ("sr_1", "None")),
        ({"sr_*": "bad-mouthing", "sr_2": BadMouthing()}, ("sr_2",)),
        (BadMouthing(), ("{'sr_2': BadMouthing()}",)),
        ([BadMouthing()], ("{'sr_2': BadMouthing()}",)),
    ):
        refused(words, "mean", attack, games=2)


def test_numbers_that_make_no_sense_are_refused() -> None:
    for name, values in (("games", (0, 2.5, "3")), ("seed", (-1, None)), ("share", (1.0, "x"))):
        for value in values:
            refused((name, repr(value)), "mean", "bad-mouthing", **{name: value})
    for rounds in (-5, "x", None, 2.5):
        with refuses(ValueError, "budget"):
            Budget(rounds)  # type: ignore[arg-type]
