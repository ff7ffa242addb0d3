"""The package robustrep as a trust model."""

import numpy as np
import pytest

pytest.importorskip("robustrep")

from roletrust_env.testing import check_trust_model
from roletrust_env.trust import Ratings
from studies.robustrep import RobustRep

pytestmark = pytest.mark.slow


@pytest.mark.filterwarnings("error")
def test_it_keeps_to_the_contract_of_trust_models() -> None:
    check_trust_model(RobustRep(window=2), torch=False)


def test_trust_is_the_lower_median_over_raters_of_their_median_ratings() -> None:
    rng = np.random.default_rng(0)
    ratings, mask = rng.uniform(0.1, 1, (4, 5, 3, 2)), rng.random((4, 5, 3, 2)) < 0.7
    mask[:, :, 2, 1] = False  # nobody ever rates this provider
    model = RobustRep(initial=0.3, window=3)
    state = model.start(np.zeros((5, 3, 2)))
    for given, seen in zip(ratings, mask, strict=True):
        state = model.update(state, Ratings(given, seen))
    expected = np.full((3, 2), 0.3)
    for provider, game in np.ndindex(3, 2):
        pairs = [(ratings[1:, rater, provider, game], mask[1:, rater, provider, game]) for rater in range(5)]
        votes = sorted(np.median(given[seen]) for given, seen in pairs if seen.any())
        if votes:
            expected[provider, game] = votes[(len(votes) - 1) // 2]
    np.testing.assert_allclose(model.provider_trust(state), expected)
    assert (model.rater_trust(state) == 1).all()


def test_without_the_package_the_error_says_how_to_install_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("studies.robustrep.find_spec", lambda name: None)
    with pytest.raises(ValueError, match=r"pip install 'roletrust-env\[peers\]'"):
        RobustRep()
