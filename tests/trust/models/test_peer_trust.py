"""PeerTrust against its formula, loop by loop, and a case worked by hand."""

from math import sqrt

import pytest
from judged import History, Trusts, by_history, mean, play
from model_cases import assert_matches, read

from roletrust_env.trust import make_trust_model


def slow(history: History, initial: float) -> Trusts:
    raters, providers = range(len(history[0])), range(len(history[0][0]))
    trust = [[initial for _ in providers] for _ in raters]
    found = []
    for now in range(1, len(history) + 1):
        past = [
            [[at[i][j] for at in history[:now] if at[i][j] is not None] for j in providers]
            for i in raters
        ]

        def similarity(v: int, w: int, past: list = past) -> float | None:
            both = [j for j in providers if past[v][j] and past[w][j]]
            if not both:
                return None
            return 1 - sqrt(
                mean([(mean(past[v][j], 0) - mean(past[w][j], 0)) ** 2 for j in both], 0)
            )

        for w in raters:
            for j in providers:
                above = below = 0.0
                for v in raters:
                    weight = 1.0 if v == w else similarity(v, w) or 0.0
                    for x in past[v][j]:
                        above, below = above + weight * x, below + weight
                trust[w][j] = above / below if below else trust[w][j]
        credence = [
            [initial if similarity(k, i) is None else similarity(k, i) for k in raters]
            for i in raters
        ]
        tor = [mean([credence[i][k] for i in raters if i != k], 1.0) for k in raters]
        found.append((tor, [mean([trust[i][j] for i in raters], 0) for j in providers]))
    return found


@pytest.mark.parametrize("initial", [0.5, 0.2])
def test_it_is_the_formula(initial: float) -> None:
    assert_matches(
        make_trust_model("peer-trust", initial=initial), by_history(slow, initial=initial)
    )


def test_two_honest_and_a_liar_by_hand() -> None:
    """Both honest rate 1 and 1, the liar 0 and 1: Sim(liar) = 1 - sqrt(1/2) = 0.2929.

    An honest judge has T[0] = (1 + 1 + 0) / (2 + 0.2929) = 0.8723, the liar 2 * 0.2929 / (1 + 2 *
    0.2929) = 0.3694.
    """
    model = make_trust_model("peer-trust")
    tor, top = read(model, play(model, [[1, 1], [1, 1], [0, 1]]))
    alike = 1 - sqrt(1 / 2)
    assert tor == pytest.approx([(1 + alike) / 2, (1 + alike) / 2, alike])
    assert top == pytest.approx([(2 * 0.8723 + 0.3694) / 3, 1], abs=1e-4)
