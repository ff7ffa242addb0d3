"""Raters that act together, on a synthetic log."""

from pathlib import Path

import numpy as np
import pytest

from roletrust_env.logs import suspects
from roletrust_env.logs.log import Log, read
from roletrust_env.logs.suspects import alike, find_suspects
from roletrust_env.trust import make_trust_model

MODEL = make_trust_model("leave-one-out")
SIZE, RING, SHOPS = 3000, 6, range(3, 15, 2)


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Log:
    """Ratings from 1 to 5 of 300 shops by 200 people, and best ones of six bad shops by a ring."""
    random = np.random.default_rng(0)
    people, shops = random.integers(0, 200, SIZE), random.integers(0, 300, SIZE)
    stars = np.clip(np.rint(1 + 4 * shops / 300 + random.normal(0, 1, SIZE)), 1, 5).astype(int)
    rows = [f"p{one},s{shop},{star}" for one, shop, star in zip(people, shops, stars, strict=True)]
    for n in range(RING):
        rows[2000 + n * 50 : 2000 + n * 50] = [f"ring{n},s{shop},5" for shop in SHOPS]
    path: Path = tmp_path_factory.mktemp("log") / "log.csv"
    path.write_text("rater,ratee,rating\n" + "\n".join(rows))
    return read(path, scale=(1, 5))


def test_a_ring_is_found_far_from_others(log: Log) -> None:
    advanced = []
    found = find_suspects(log, shuffles=3, advance=lambda *done: advanced.append(done))
    assert found[1:] == (3, 0.0, 0.0)
    assert advanced == [(1, 3), (2, 3), (3, 3)]
    [group] = found.groups
    assert [log.rater_names[place] for place in group.raters] == [f"ring{n}" for n in range(RING)]
    assert {log.ratee_names[place] for place in group.ratees} == {f"s{shop}" for shop in SHOPS}
    assert group.p == 0.25
    distances = []
    for ratee in group.ratees:
        theirs = np.isin(log.raters, group.raters)
        of_ratee = log.ratees == ratee
        distances.append(1 - log.values[of_ratee & ~theirs].mean())
    assert group.apart == pytest.approx(np.mean(distances))
    assert find_suspects(log, shuffles=3, seed=1).groups[0].apart == group.apart


def without(log: Log, raters: np.ndarray) -> Log:
    """The log without the ratings of some raters."""
    stay = ~np.isin(log.raters, raters)
    return log._replace(raters=log.raters[stay], ratees=log.ratees[stay], values=log.values[stay])


def test_there_is_no_group_without_the_ring_or_with_too_small_a_ring(log: Log) -> None:
    ring = np.array([n for n, name in enumerate(log.rater_names) if name.startswith("ring")])
    assert alike(without(log, ring)) == []
    assert [len(raters) for raters, _ in alike(without(log, ring[4:]))] == [4]
    assert alike(without(log, ring[3:])) == []


def test_a_rating_of_one_member_alone_is_not_common(log: Log) -> None:
    [(raters, ratees)] = alike(log)
    other = np.setdiff1d(log.ratees, ratees)[0]
    more = log._replace(
        raters=np.append(log.raters, raters[0]),
        ratees=np.append(log.ratees, other),
        values=np.append(log.values, 0.0),
    )
    [(_, after)] = alike(more)
    assert after.tolist() == ratees.tolist()


def test_a_club_that_rates_as_others_do_has_a_large_p(log: Log) -> None:
    """Each of its ratings is the mean of the others' ratings."""
    ring = np.array([n for n, name in enumerate(log.rater_names) if name.startswith("ring")])
    values = log.values.copy()
    for ratee in np.unique(log.ratees[np.isin(log.raters, ring)]):
        of_ratee = log.ratees == ratee
        of_ring = of_ratee & np.isin(log.raters, ring)
        values[of_ring] = log.values[of_ratee & ~of_ring].mean()
    [group] = find_suspects(log._replace(values=values), shuffles=9).groups
    assert set(ring) <= set(group.raters)
    assert group.apart < 0.05
    assert group.p == 1


def test_groups_in_shuffled_logs_are_counted(log: Log, monkeypatch: pytest.MonkeyPatch) -> None:
    """Here every second shuffled log has two groups."""
    logs = []

    def two_groups(one: Log) -> list[tuple[np.ndarray, np.ndarray]]:
        logs.append(one)
        return [(np.arange(4), np.arange(2))] * (len(logs) % 2 * 2)

    monkeypatch.setattr(suspects, "alike", two_groups)
    found = find_suspects(log, shuffles=4)
    assert (found.false_positive_rate, found.false_groups) == (0.5, 1.0)
    for shuffled in logs[1:]:
        assert np.array_equal(np.bincount(shuffled.ratees), np.bincount(log.ratees))
        assert (shuffled.ratees != log.ratees).mean() > 0.9
