"""The four attack tasks that are registered with Gymnasium."""

from typing import Any, ClassVar

from roletrust_env.envs.attack_env import AttackEnv


class ProviderAttackEnv(AttackEnv):
    """An attack by one compromised provider, which sells bad services while it is trusted.

    ## Description

    `RoleTrust/ProviderAttack-v0`. By default the learner is `sp_2` in `paper-3x3`, and its objective is `exploit`: to
    be trusted while it serves badly. The on-off attack is one solution.

    ## Action Space

    `Box(0, 1, (1,), float32)`: the quality of its next service.

    ## Observation Space

    `Box(0, 1, (4 + 2 S,), float32)` at `knowledge="black_box"`: the provider's, see `RoleTrustParallelEnv`; more
    at the other levels, see `AttackEnv`.

    ## Rewards

    Published ToP at which the service was sold, times 1 - its quality, minus the stealth cost. Without that cost it is
    in [0, 1].

    ## Starting State, Episode End, Information, Arguments

    See `AttackEnv`.

    ## Version History

    - v0: first version.
    """

    defaults: ClassVar[dict[str, Any]] = {
        "scenario": "paper-3x3",
        "compromised": ("sp_2",),
        "objective": "exploit",
    }


class RaterAttackEnv(AttackEnv):
    """An attack by one compromised rater on the trust of the honest providers.

    ## Description

    `RoleTrust/RaterAttack-v0`. By default the learner is `sr_2` in `paper-3x3`, and its objective is `damage`. Without
    a stealth cost the best attack there is to rate every provider 0; with one, the rater's trust has to stay near that
    of the others.

    ## Action Space

    `Box(0, 1, (P,), float32)`: its ratings of the providers.

    ## Observation Space

    `Box(0, 1, (2 + 5 P,), float32)` at `knowledge="black_box"`: the rater's, see `RoleTrustParallelEnv`; more at the
    other levels, see `AttackEnv`.

    ## Rewards

    Mean over the honest providers of 1 - ToP, minus the stealth cost.

    ## Starting State, Episode End, Information, Arguments

    See `AttackEnv`.

    ## Version History

    - v0: first version.
    """

    defaults: ClassVar[dict[str, Any]] = {"scenario": "paper-3x3", "compromised": ("sr_2",), "objective": "damage"}


class DualAttackEnv(AttackEnv):
    """An attack by one compromised agent with both roles, by its services and its ratings.

    ## Description

    `RoleTrust/DualAttack-v0`. By default the learner is `srsp_5` in `peers`, and its objective is `exploit`: it can
    serve badly, and by its ratings move the trust of the others.

    ## Action Space

    `Box(0, 1, (1 + P,), float32)`: the quality of its next service, then its ratings; its rating of itself is ignored.

    ## Observation Space

    `Box(0, 1, (1 + 4 + 2 S + 2 + 5 P,), float32)` at `knowledge="black_box"`: the SR+SP agent's, see
    `RoleTrustParallelEnv`; more at the other levels, see `AttackEnv`.

    ## Rewards

    Published ToP at which the service was sold, times 1 - its quality, minus the stealth cost.

    ## Starting State, Episode End, Information, Arguments

    See `AttackEnv`.

    ## Version History

    - v0: first version.
    """

    defaults: ClassVar[dict[str, Any]] = {"scenario": "peers", "compromised": ("srsp_5",), "objective": "exploit"}


class CollusionAttackEnv(AttackEnv):
    """An attack by compromised raters and providers, which one learner controls together.

    ## Description

    `RoleTrust/CollusionAttack-v0`. By default the learner controls two raters and a provider, `sr_8`, `sr_9` and
    `sp_9`, in `crowd-10x10`, and its objective is `damage`.

    ## Action Space

    `Box(0, 1, (A,), float32)`, one joint action: for each compromised agent in turn its quality, if it provides, then
    its P ratings, if it rates. By default A = 21.

    ## Observation Space

    `Box(0, 1, (K,), float32)` at `knowledge="black_box"`: the observations of the compromised agents in turn, see
    `RoleTrustParallelEnv`; more at the other levels, see `AttackEnv`.

    ## Rewards

    Mean over the honest providers of 1 - ToP, minus the stealth cost.

    ## Starting State, Episode End, Information, Arguments

    See `AttackEnv`.

    ## Version History

    - v0: first version.
    """

    defaults: ClassVar[dict[str, Any]] = {
        "scenario": "crowd-10x10",
        "compromised": ("sr_8", "sr_9", "sp_9"),
        "objective": "damage",
    }


TASKS: dict[str, type[AttackEnv]] = {
    "RoleTrust/ProviderAttack-v0": ProviderAttackEnv,
    "RoleTrust/RaterAttack-v0": RaterAttackEnv,
    "RoleTrust/DualAttack-v0": DualAttackEnv,
    "RoleTrust/CollusionAttack-v0": CollusionAttackEnv,
}
"""The environments of the attack tasks, by the id in Gymnasium."""
