"""Who is who."""

import numpy as np
import pytest
import torch
from refusals import refuses

from roletrust_env.world import AgentGroup, Scenario
from roletrust_env.world.roster import Roster, role_in_name


def roster(*roles: str, **group: object) -> Roster:
    return Roster.of(
        Scenario(agents=[{"role": role, **(group if role == "SR+SP" else {})} for role in roles])
    )


MIXED = ("SR+SP", "SP", "SR", "SP", "SR+SP", "SR", "SR")


def test_names_and_axes() -> None:
    who = roster(*MIXED)
    assert who.names == ("sr_0", "sr_1", "sr_2", "sp_0", "sp_1", "srsp_0", "srsp_1")
    assert who.rater_names == ("sr_0", "sr_1", "sr_2", "srsp_0", "srsp_1")
    assert who.provider_names == ("sp_0", "sp_1", "srsp_0", "srsp_1")
    assert (who.n_agents, who.n_raters, who.n_providers, who.n_both) == (7, 5, 4, 2)


@pytest.mark.parametrize("asarray", [np.asarray, torch.asarray], ids=["numpy", "torch"])
@pytest.mark.parametrize(
    "roles", [MIXED, ("SR", "SP"), ("SR+SP", "SR+SP"), ("SR+SP", "SP"), ("SR+SP", "SR")]
)
def test_every_axis_is_a_slice_of_another(roles: tuple[str, ...], asarray) -> None:
    who = roster(*roles)
    agents = asarray(np.arange(who.n_agents))
    assert [who.names[n] for n in who.raters(agents)] == list(who.rater_names)
    assert [who.names[n] for n in who.providers(agents)] == list(who.provider_names)
    both = who.both(who.raters(agents))
    assert [who.names[n] for n in both] == [name for name in who.names if name.startswith("srsp")]
    assert np.array_equal(both, who.both(who.providers(agents)))
    n_sr, n_sp = who.n_raters - who.n_both, who.n_providers - who.n_both
    parts = who.raters(agents)[:n_sr], who.providers(agents)[:n_sp], both
    assert np.array_equal(np.concatenate(parts), agents)


def test_nobody_is_a_stranger_to_itself() -> None:
    who = roster(*MIXED)
    own = [
        (i, j) for i, j in np.argwhere(~who.not_self) if who.rater_names[i] == who.provider_names[j]
    ]
    assert len(own) == (~who.not_self).sum() == 2


def test_groups_keep_their_order() -> None:
    scenario = Scenario(
        agents=[
            {"role": "SP"},
            {"role": "SR", "count": 2, "noise": 0.1},
            {"role": "SR", "noise": 0.2},
        ]
    )
    assert [group.noise for group in Roster.of(scenario).groups] == [0.1, 0.1, 0.2, 0.0]


def test_turns() -> None:
    rating, providing = roster(
        "SR", "SP", "SR+SP", turns=("SR", "SP", "SR+SP"), turn_length=2
    ).role_schedule(8)
    assert rating[:, 0].all()
    assert providing[:, 0].all()
    assert rating[:, 1].tolist() == [True, True, False, False, True, True, True, True]
    assert providing[:, 1].tolist() == [False, False, True, True, True, True, False, False]
    rating, providing = roster("SR", "SP", "SR+SP").role_schedule(3)
    assert rating.shape == (3, 2)
    assert providing.shape == (3, 2)
    assert rating.all()
    assert providing.all()


def test_the_role_of_an_agent_is_that_of_its_group() -> None:
    groups = (
        AgentGroup(role="SR+SP", count=2),
        AgentGroup(role="SP", reserve=1),
        AgentGroup(role="SR", count=2),
    )
    who = Roster.of(Scenario(agents=groups))
    assert who.roles == {
        **dict.fromkeys(("sr_0", "sr_1"), "SR"),
        **dict.fromkeys(("sp_0", "sp_1"), "SP"),
        **dict.fromkeys(("srsp_0", "srsp_1"), "SR+SP"),
    }
    assert [who.role(name) for name in who.names] == [role_in_name(name) for name in who.names]
    with refuses(ValueError, "sp_2", "sr_0"):
        who.role("sp_2")
    with refuses(ValueError, "judge_0", "sr_0", "srsp_0"):
        role_in_name("judge_0")
