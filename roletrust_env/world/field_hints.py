"""What to write in place of a name that is no field of a scenario or of its tables, although a user
may expect it.
"""

from collections.abc import Mapping, Sequence

from roletrust_env.world.group import FrozenModel

_FIELDS = {
    "lam": "lambda lambda_ smoothing",
    "max_cycles": "rounds cycles steps length horizon duration episode_length time_limit",
    "continuation": "gamma discount discount_factor",
    "period_s": "period dt interval every",
    "initial_trust": "initial prior",
    "playback": "loop repeat",
    "frames": "video images camera cameras pictures",
    "perturbations": "disturbances disturbance events",
    "access": "topology mobility graph meetings",
    "name": "title",
    "service": "detector perception",
}
"""Fields of a scenario, and names by which they may be known."""

_PART_FIELDS = {
    "agents": {
        "role": "type kind",
        "count": "number n size amount",
        "ability": "quality skill competence",
        "noise": "sigma std error",
        "joins": "arrives enters start",
        "leaves": "departs exits stop end",
    },
    "access": {"kind": "type rule", "radius": "range distance", "providers": "count number k"},
    "ratings": {
        "deadline": "window expiry",
        "open": "claims unverified",
        "lost": "loss drop dropped",
        "late": "delayed",
        "delay": "lag",
    },
    "perturbations": {
        "start": "begin first from",
        "stop": "end last until to",
        "strength": "level intensity",
    },
    "admission": {"threshold": "level limit", "rounds": "patience"},
    "rewards": {"quality_cost": "cost"},
}
"""The same for the tables of a scenario."""

_GROUPS = "raters providers groups robots team roles consumers population sr sp"
_PRESETS = "preset presets base extends inherit inherits parent template scenario set"
_SUITES = (
    "worlds settings models own solo attacks usual methods replayed search reports "
    "selection_games version limit_s"
)
_BESIDE = {
    "--model, or trust_model=... in Python": "model trust_model",
    "--attack, or a JointPolicy in Python": "attack attacker attackers liars policies others",
    "--set of `roletrust train`, or compromised=... in Python": (
        "compromised objective goal stealth stealth_weight stealth_tolerance knowledge accomplice "
        "accomplices"
    ),
    "--learner, or observation=... in Python": "learner observation",
    "--seed": "seed seeds random_seed",
    "--games": "games episodes num_envs",
    "--steps": "budget timesteps",
    "--out": "out output folder",
    "--video, or render_mode=... in Python": "render render_mode",
    "like=... in Python": "like dtype device",
    "engine=... in Python": "engine compiled backend",
    "--set of `roletrust robots`": "speed",
}
"""What stands beside a scenario, by option or argument, and names by which it may be known."""


def give_hints(
    scenario: type[FrozenModel], parts: Mapping[str, Sequence[type[FrozenModel]]]
) -> None:
    """Let a scenario and its tables say what to write in place of names that are no fields of
    theirs.
    """
    elsewhere = dict[str, str]()
    for field, models in parts.items():
        names = _names(_PART_FIELDS[field]) | {
            name: name for model in models for name in model.model_fields
        }
        elsewhere |= {
            known: f"did you mean {name!r} in {field!r}?" for known, name in names.items()
        }
    own = elsewhere | _known_as(_FIELDS)
    groups = [
        f"{prefix}{name}" for prefix in ("", "n_", "num_") for name in (*_GROUPS.split(), "agents")
    ]
    own |= dict.fromkeys(
        groups, "did you mean 'agents'? Each of its groups has a 'role' and a 'count'."
    )
    for where, names_beside in _BESIDE.items():
        own |= dict.fromkeys(
            names_beside.split(), f"it is no part of a scenario, but stands beside it: {where}."
        )
    own |= dict.fromkeys(
        _SUITES.split(), "it is of a suite, which `roletrust benchmark --suite FILE` plays."
    )
    own |= dict.fromkeys(
        _PRESETS.split(),
        "a scenario is whole, and 'preset' and 'set' are of the worlds in a suite. To change a "
        "preset, write "
        "--set FIELD=VALUE behind its name, or make_scenario(NAME).change(FIELD=VALUE) in Python.",
    )
    _set(scenario, own)
    above = {
        name: f"did you mean {name!r} of the scenario itself, above its tables?"
        for name in scenario.model_fields
    }
    for field, models in parts.items():
        for model in models:
            _set(model, own | elsewhere | above | _known_as(_PART_FIELDS[field]))


def _set(model: type[FrozenModel], hints: Mapping[str, str]) -> None:
    model.field_hints = {
        name: hint for name, hint in hints.items() if name not in model.model_fields
    }


def _known_as(fields: Mapping[str, str]) -> dict[str, str]:
    return {known: f"did you mean {field!r}?" for known, field in _names(fields).items()}


def _names(fields: Mapping[str, str]) -> dict[str, str]:
    """Return the field for each name by which one may be known."""
    return {known: field for field, names in fields.items() for known in names.split()}
