"""What makes the trust in an agent, on a synthetic log."""

import numpy as np
import pytest
from refusals import refuses

from roletrust_env.logs.evidence import Role
from roletrust_env.logs.explain import explain, find_agent
from roletrust_env.logs.log import Log, read
from roletrust_env.logs.stream import TrustStream
from roletrust_env.trust import make_trust_model

MODEL = make_trust_model("leave-one-out")
SIZE = 3000


@pytest.fixture(scope="module")
def log() -> Log:
    """Ratings from 1 to 5 of 300 shops by 200 people, and best ones of six shops by a ring."""
    random = np.random.default_rng(0)
    people, shops = random.integers(0, 200, SIZE), random.integers(0, 300, SIZE)
    stars = np.clip(np.rint(1 + 4 * shops / 300 + random.normal(0, 1, SIZE)), 1, 5)
    rows = [
        (f"p{one}", f"s{shop}", star) for one, shop, star in zip(people, shops, stars, strict=True)
    ]
    rows[2000:2000] = [(f"ring{n}", f"s{shop}", 5.0) for n in range(6) for shop in range(3, 15, 2)]
    columns = dict(zip(("rater", "ratee", "rating"), zip(*rows, strict=True), strict=True))
    return read(columns, scale=(1, 5))


def test_an_explanation_is_what_the_log_without_the_ratings_says(log: Log) -> None:
    """As a stream has it in which these ratings never came."""
    numbers = np.arange(len(log.values)) // 1000
    roles: tuple[Role, Role] = ("ratee", "rater")
    for role, name in zip(roles, ("s3", "ring2"), strict=True):
        agent = find_agent(log, f" {name} ")[role]
        found = explain(MODEL, log, numbers, role, agent, most=4)
        mine, others = (log.ratees, log.raters) if role == "ratee" else (log.raters, log.ratees)
        assert (found.name, found.role, found.n_ratings, len(found.reasons)) == (
            name,
            role,
            (mine == agent).sum(),
            4,
        )
        whole = TrustStream(
            MODEL, agents=(np.arange(log.shape[0]), np.arange(log.shape[1])), every=1
        )
        whole.update(log.raters, log.ratees, log.values, numbers)
        whole.finish()
        trusts, other = whole.provider_trust(), whole.rater_trust()
        trusts, other = (trusts, other) if role == "ratee" else (other, trusts)
        assert found.rank == 1 + sum(trusts[one] > found.trust for one in set(mine.tolist()))
        means = {
            one: log.values[(mine == agent) & (others == one)].mean()
            for one in set(others[mine == agent])
        }
        near = {
            one: abs(mean - (found.trust if role == "ratee" else other[one]))
            for one, mean in means.items()
        }
        ordered = sorted(near, key=lambda one: near[one] * (other[one] if role == "ratee" else 1))
        taken = ordered[-4:] if role == "ratee" else [*ordered[:2], *ordered[-2:]]
        names = list(log.rater_names if role == "ratee" else log.ratee_names)
        assert {reason.other for reason in found.reasons} == {names[at] for at in taken}
        changes = [abs(reason.without - found.trust) for reason in found.reasons]
        assert changes == sorted(changes, reverse=True)
        reason = found.reasons[0]
        these = (mine == agent) & (others == names.index(reason.other))
        rest = (log.ratees == log.ratees[these][0]) & ~these
        assert (reason.ratings.tolist(), reason.others) == (
            log.values[these].tolist(),
            log.values[rest].mean(),
        )
        stream = TrustStream(
            MODEL, agents=(np.arange(log.shape[0]), np.arange(log.shape[1])), every=1
        )
        stream.update(log.raters[~these], log.ratees[~these], log.values[~these], numbers[~these])
        stream.finish()
        assert (stream.provider_trust() if role == "ratee" else stream.rater_trust())[
            agent
        ] == reason.without


def test_an_agent_has_the_roles_in_which_it_has_ratings_and_near_names_are_said(
    log: Log,
) -> None:
    both = log._replace(rater_names=["s33", *list(log.rater_names)[1:]])
    assert find_agent(both, "s33") == {"ratee": list(log.ratee_names).index("s33"), "rater": 0}
    with refuses(ValueError, "S33x", "s33"):
        find_agent(log, "S33x")
