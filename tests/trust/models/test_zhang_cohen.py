"""The personalised model of Zhang and Cohen against its formula, loop by loop, and a case worked by
hand."""

from math import log

import pytest
from judged import (
    History,
    Trusts,
    assert_matches_with_experience,
    by_history,
    mean,
    play,
)
from model_cases import assert_matches, read

from roletrust_env.trust import make_trust_model


def slow(
    history: History,
    lam: float,
    initial: float,
    tolerance: float,
    confidence: float,
    error: float,
    received: History | None = None,
) -> Trusts:
    """Judges know the services that they received, which are their ratings unless given."""
    received = history if received is None else received
    raters, providers = range(len(history[0])), range(len(history[0][0]))
    enough = -log((1 - confidence) / 2) / (2 * error**2)
    trust = [[initial for _ in providers] for _ in raters]
    found = []
    for now, current in enumerate(history, 1):
        public = []
        for k in raters:
            every = near = 0
            for at in history[:now]:
                for j in providers:
                    beside = [at[i][j] for i in raters if i != k and at[i][j] is not None]
                    if at[k][j] is not None and beside:
                        every, near = (
                            every + 1,
                            near + (abs(at[k][j] - mean(beside, 0)) <= tolerance),
                        )
            public.append((near + 1) / (every + 2))

        def credence(i: int, k: int, now: int = now, public: list[float] = public) -> float:
            pairs = [
                (own[i][j], at[k][j])
                for at, own in zip(history[:now], received, strict=False)
                for j in providers
                if own[i][j] is not None and at[k][j] is not None
            ]
            agreeing = sum(min(f, g) + min(1 - f, 1 - g) for f, g in pairs)
            w = min(1.0, len(pairs) / enough)
            return w * (agreeing + 1) / (len(pairs) + 2) + (1 - w) * public[k]

        for i in raters:
            known = [*current[:i], received[now - 1][i], *current[i + 1 :]]
            for j in providers:
                said = [
                    (1.0 if k == i else credence(i, k), known[k][j])
                    for k in raters
                    if known[k][j] is not None
                ]
                if said:
                    opinion = sum(c * f for c, f in said) / sum(c for c, _ in said)
                    trust[i][j] = lam * opinion + (1 - lam) * trust[i][j]
        tor = [mean([credence(i, k) for i in raters if i != k], 1.0) for k in raters]
        found.append((tor, [mean([trust[i][j] for i in raters], 0) for j in providers]))
    return found


@pytest.mark.parametrize(
    "parameters",
    [
        {"lam": 0.5, "initial": 0.5, "tolerance": 0.1, "confidence": 0.8, "error": 0.25},
        {"lam": 0.8, "initial": 0.3, "tolerance": 0.25, "confidence": 0.5, "error": 0.4},
    ],
)
def test_it_is_the_formula(parameters: dict[str, float]) -> None:
    model = make_trust_model("zhang-cohen", **parameters)
    assert_matches(model, by_history(slow, **parameters))
    assert_matches_with_experience(model, slow, **parameters)


def test_n_min_is_that_of_the_paper() -> None:
    assert make_trust_model("zhang-cohen").enough == pytest.approx(18.42, abs=0.005)


def test_one_round_with_a_liar_by_hand() -> None:
    """Three rate one provider 1, 1 and 0, so that N = 1 of each pair and w = 1 / 18.42 = 0.0543.

    Nobody is within 0.1 of the mean of the two others, so public = 1/3 for all. Private is 2/3
    among the honest and 1/3 with the liar. C(honest, honest) = 0.0543 * 2/3 + 0.9457 * 1/3 =
    0.3514, and every other is 1/3. An honest judge hears (1 + 0.3514) / (1 + 0.3514 + 1/3) =
    0.8021, the liar (2/3) / (1 + 2/3) = 0.4.
    """
    model = make_trust_model("zhang-cohen", lam=0.5)
    tor, top = read(model, play(model, [[1], [1], [0]]))
    assert tor == pytest.approx([(0.3514 + 1 / 3) / 2, (0.3514 + 1 / 3) / 2, 1 / 3], abs=1e-4)
    assert top == pytest.approx([0.5 * (2 * 0.8021 + 0.4) / 3 + 0.25], abs=1e-4)


def test_at_the_edge_of_the_tolerance_a_rating_is_consistent() -> None:
    model = make_trust_model("zhang-cohen", tolerance=0.0)
    tor, _ = read(model, play(model, [[1], [1]]))
    assert tor == pytest.approx([2 / 3, 2 / 3])  # private and public alike: (1 + 1) / (1 + 2)
