"""Newcomers: how many join in a period, and how many without keys."""

import pytest
from manager_cases import PERIOD, TEAM, feed, manager, random_ratings, rating_message

from roletrust_env.live.validation import MANAGER, MAX_STRANGERS, Admission, Envelope, RatingMessage, RefusalReason


class Keys:
    """A keyring in which a signature is the name of its signer."""

    def __init__(self, *names):
        self.names = names

    def __contains__(self, name):
        return name in self.names

    def verifies(self, name, signed, signature):
        return signature == name.encode()


def test_members_always_take_part_and_strangers_up_to_a_limit():
    admission = Admission(["sr_0"], PERIOD)
    joined = [name for k in range(100) if admission.admits(name := f"x{k}", k * PERIOD)]
    assert joined == [f"x{k}" for k in range(MAX_STRANGERS)]
    assert admission.admits("sr_0", 0)
    assert admission.admits("x0", 0)
    assert "x0" in admission
    assert "x99" not in admission


def test_those_with_a_key_join_ten_a_period():
    admission = Admission([], PERIOD, {f"x{k}" for k in range(100)})
    joined = [sum(admission.admits(f"x{k}", now * PERIOD) for k in range(100)) for now in range(1, 12)]
    assert joined == [10, 20, 30, 40, 50, 60, 70, 80, 90, 100, 100]
    assert not admission.admits("other", 100 * PERIOD)


def test_a_flood_of_fresh_names_costs_the_others_no_round(tmp_path):
    """A thousand fresh names a minute without keys, at two rounds a second."""
    rounds, names = 40, 1000 * 40 // 120
    ratings, mask = random_ratings(rounds, lost=0.0)
    keeper, published = manager(tmp_path / "journal"), []
    for r in range(rounds):
        published += feed(keeper, ratings[r : r + 1], mask[r : r + 1], first=r + 1)
        for k in range(names // rounds):
            fresh = rating_message(f"x{r}_{k}", r + 1, {"sp_0": 0.0})
            published += keeper.receive(fresh, PERIOD * (r + 1) + 450_000_000)
    assert sum(set(TEAM.raters) <= entry.ratings.keys() for entry in published) == rounds
    assert len(published[-1].team.raters) <= len(TEAM.raters) + MAX_STRANGERS
    assert keeper.validator.refusals["", RefusalReason.CROWDED] == names // rounds * rounds - MAX_STRANGERS
    keeper.close()
    again = manager(tmp_path / "journal")
    assert again.receive(rating_message("fresh", rounds + 1, {"sp_0": 0.0}), PERIOD * (rounds + 1)) == []
    strangers = len(published[-1].team.raters) - len(TEAM.raters)
    assert (again.validator.refusals["", RefusalReason.CROWDED] == 1) is (strangers == MAX_STRANGERS)


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("sr_0", None),
        ("sr_9", None),
        ("sp_0", RefusalReason.UNKNOWN),
        (MANAGER, RefusalReason.UNKNOWN),
        ("sr_8", RefusalReason.UNKNOWN),
    ],
)
def test_a_key_is_for_a_role_of_the_scenario(name, reason, tmp_path):
    """A camera of the scenario may not rate, and a rater of the scenario may not serve; a newcomer has either role."""
    keeper = manager(tmp_path / "journal", keyring=Keys("sr_0", "sr_9", "sp_0", MANAGER))
    message = RatingMessage(Envelope(name, PERIOD, b"", name.encode()), ["sp_1"], [0.5])
    keeper.receive(message, PERIOD)
    assert list(keeper.validator.refusals) == ([] if reason is None else [("", reason)])


def test_a_provider_without_a_key_cannot_join_a_team_with_keys(tmp_path):
    keeper = manager(tmp_path / "journal", keyring=Keys("sr_0", "sr_1", "sp_9"))
    for name in ("sp_8", "sp_9", "sr_1"):
        keeper.add_provider(name, 0)
    keeper.receive(
        RatingMessage(Envelope("sr_0", PERIOD, b"", b"sr_0"), ["sp_8", "sp_9", "sr_1"], [0.0, 0.5, 1.0]), PERIOD
    )
    assert keeper.validator.refusals == {("sr_0", RefusalReason.UNKNOWN_PROVIDER): 2}
