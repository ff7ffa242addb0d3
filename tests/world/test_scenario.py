"""Scenarios: what is refused and how, files, and changes."""

from inspect import signature
from pathlib import Path
from typing import Any

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given
from refusals import refuses

from roletrust_env import (
    Game,
    Random,
    Scenario,
    load_scenario,
    make_scenario,
    parallel_env,
    scenarios,
)
from roletrust_env.benchmarking.suite import Suite
from roletrust_env.game.make_task import make_task
from roletrust_env.game.summary import summarise
from roletrust_env.world.scenario import Perturbation, read_scenario
from roletrust_env.world.service import Perturbations, strength_in

AGENTS = [{"role": "SR", "count": 2}, {"role": "SP", "count": 2}]


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"lam": 0.49}, ["lam", "0.49", "[0.5, 1)"]),
        ({"lam": 1.0}, ["lam", "1.0", "[0.5, 1)"]),
        ({"lam": float("nan")}, ["lam", "nan", "finite"]),
        ({"lam": "much"}, ["lam", "much", "number"]),
        ({"lam": None}, ["lam", "None", "number"]),
        ({"initial_trust": 1.1}, ["initial_trust", "1.1", "[0, 1]"]),
        ({"max_cycles": 0}, ["max_cycles", "0"]),
        ({"max_cycles": 2.5}, ["max_cycles", "2.5", "integer"]),
        ({"max_cycles": True}, ["max_cycles", "True"]),
        ({"continuation": 0}, ["continuation", "0", "(0, 1]"]),
        ({"continuation": 1.01}, ["continuation", "1.01", "(0, 1]"]),
        ({"period_s": 0}, ["period_s", "0", "[1e-6, 1e6]"]),
        ({"period_s": float("inf")}, ["period_s", "inf", "finite"]),
        ({"values": []}, ["values", "[]", "1"]),
        ({"period_s": "0.5"}, ["period_s", "0.5"]),
        ({"values": [1.0, "2"]}, ["values.1", "2"]),
        ({"max_cycles": 5.0}, ["max_cycles", "5.0"]),
        ({"values": [1.0, -1.0]}, ["values.1", "-1.0", "[1e-6, 1e6]"]),
        ({"service": "smell"}, ["service", "smell", "synthetic", "hog"]),
        ({"frames": "video.mp4"}, ["frames", "hog", "synthetic"]),
        ({"agents": "many"}, ["agents", "many", "list"]),
        ({"agents": [{"role": "XX"}]}, ["agents.0.role", "XX", "SR", "SP", "SR+SP"]),
        ({"agents": [{"count": 2}]}, ["agents.0.role", "missing"]),
        (
            {"agents": [{"role": "SR", "count": 0}, {"role": "SP"}]},
            ["agents.0.count", "0"],
        ),
        (
            {"agents": [{"role": "SR", "noise": -1}, {"role": "SP"}]},
            ["agents.0.noise", "-1", "[0, 1e6]"],
        ),
        (
            {"agents": [{"role": "SR", "turns": ["SP"]}, {"role": "SP"}]},
            ["agents.0", "turns", "SR+SP", "SR"],
        ),
        (
            {"agents": [*AGENTS, {"role": "SR", "joins": 5, "leaves": 5}]},
            ["agents.2", "leaves", "5", "joins, 5"],
        ),
        (
            {"agents": [*AGENTS, {"role": "SR", "join_rate": 0}]},
            ["agents.2", "join_rate", "0"],
        ),
        ({"access": {"radius": 3.0}}, ["access.kind"]),
        (
            {"access": {"kind": "wifi"}},
            ["access", "wifi", "everyone", "in-range", "choice"],
        ),
        ({"access": {"kind": "in-range", "radius": -1}}, ["access", "radius", "-1", "[1e-6, 1e6]"]),
        (
            {"access": {"kind": "choice", "providers": 3}},
            ["access.providers", "3", "2"],
        ),
        ({"ratings": {"lost": 1.1}}, ["ratings.lost", "1.1", "[0, 1]"]),
        ({"ratings": {"late": 0.1, "delay": 0}}, ["ratings.delay", "0"]),
        (
            {"perturbations": [{"start": 4, "stop": 4}]},
            ["perturbations.0", "stop", "4", "start, 4"],
        ),
        ({"admission": {"rounds": 3}}, ["admission.threshold", "missing"]),
        ({"rewards": {"quality_cost": -1}}, ["rewards.quality_cost", "-1", "[0, 1e6]"]),
        ({"lam": 2, "max_cycles": -3}, ["lam", "2", "max_cycles", "-3"]),
    ],
    ids=str,
)
def test_a_wrong_field_is_named_with_its_value_and_what_is_allowed(
    fields: dict[str, Any], words: list[str]
) -> None:
    with refuses(ValueError, *words):
        read_scenario({"agents": AGENTS} | fields, "my file")
    with refuses(ValueError, "paper-3x3"):
        parallel_env(**{"agents": AGENTS} | fields)


@pytest.mark.parametrize(
    ("fields", "unknown", "allowed"),
    [
        ({"lamb": 0.7}, "lamb", "lam"),
        ({"ratings": {"lots": 0.1}}, "lots", "lost"),
        ({"agents": [{"role": "SR", "number": 3}, {"role": "SP"}]}, "number", "count"),
        ({"access": {"kind": "in-range", "range": 3.0}}, "range", "radius"),
    ],
    ids=str,
)
def test_an_unknown_field_is_answered_with_the_known_ones(
    fields: dict[str, Any], unknown: str, allowed: str
) -> None:
    with refuses(ValueError, unknown, allowed) as error:
        read_scenario({"agents": AGENTS} | fields, "my file")
    assert allowed in str(error.value).partition(unknown)[2]


PRESET = ("--set FIELD=VALUE", "make_scenario(NAME).change(FIELD=VALUE)")
GROUPS = ("agents", "role", "count")


@pytest.mark.parametrize(
    ("name", "hints"),
    [
        ("preset", PRESET),
        ("base", PRESET),
        ("extends", PRESET),
        ("settings", ("--suite FILE",)),
        ("trust_model", ("--model", "trust_model=")),
        ("seed", ("--seed",)),
        ("Rounds", ("max_cycles",)),
        ("lambda", ("lam",)),
        ("max-cycle", ("max_cycles",)),
        ("n_raters", GROUPS),
        ("num_providers", GROUPS),
        ("noise", ("noise", "agents")),
        ("abilty", ("ability", "agents")),
        ("loss", ("lost", "ratings")),
        ("radius", ("radius", "access")),
        (
            "agents.max_cycles",
            ("max_cycles",),
        ),
        ("agents.number", ("count",)),
        ("agents.abilty", ("ability",)),
        ("agents.lost", ("lost", "ratings")),
        ("agents.preset", PRESET),
        ("ratings.loss", ("lost",)),
    ],
)
def test_a_name_from_elsewhere_is_answered_with_what_to_write(
    name: str, hints: tuple[str, ...]
) -> None:
    table, _, last = name.rpartition(".")
    agents = [AGENTS[0], AGENTS[1] | {last: 1}] if table == "agents" else AGENTS
    fields = {} if table == "agents" else {table: {last: 1}} if table else {last: 1}
    with refuses(ValueError, last, *hints):
        read_scenario({"agents": agents} | fields, "my file")


def test_what_stands_beside_a_scenario_or_in_a_suite_has_a_hint() -> None:
    beside = {*signature(make_task).parameters, *signature(parallel_env).parameters} - {"changes"}
    suites = set(Suite.model_fields)
    unknown = (beside | suites) - {*Scenario.model_fields}
    assert len(unknown) > 25
    assert unknown - {*Scenario.field_hints} == set()


@pytest.mark.parametrize(
    "agents",
    [
        [],
        [{"role": "SR", "count": 5}],
        [{"role": "SP", "count": 5}],
        [{"role": "SR+SP"}],
        [{"role": "SR+SP", "count": 3, "turns": ["SR"]}],
        [{"role": "SR+SP", "count": 3, "turns": ["SP"]}, {"role": "SP"}],
        [{"role": "SR+SP", "count": 3, "turns": ["SR", "SP"]}],
    ],
    ids=str,
)
def test_roles_that_leave_nobody_to_rate_are_refused(agents: list[dict[str, Any]]) -> None:
    with refuses(ValueError, "agents"):
        read_scenario({"agents": agents}, "my file")


@pytest.mark.parametrize(
    "agents",
    [
        [{"role": "SR"}, {"role": "SP"}],
        [{"role": "SR+SP", "count": 2}],
        [{"role": "SR+SP"}, {"role": "SP"}],
        [{"role": "SR"}, {"role": "SR+SP"}],
        [{"role": "SR+SP", "turns": ["SR", "SP"]}, {"role": "SR+SP", "turns": ["SP", "SR"]}],
        [{"role": "SR+SP", "count": 2, "turns": ["SR", "SR+SP"]}],
    ],
    ids=str,
)
def test_the_smallest_scenarios_are_taken(agents: list[dict[str, Any]]) -> None:
    env = parallel_env(Scenario(agents=agents, max_cycles=3))
    env.reset(seed=0)
    rated = False
    while env.agents:
        env.step({agent: env.action_space(agent).sample() for agent in env.agents})
        rated = rated or env._state.rated.any()
    assert rated


# --- files
# ------------------------------------------------------------------------------------------

TOML = """
description = "From a file"
max_cycles = 7
values = [1, 5]
admission = {threshold = 0.2}

[[agents]]
role = "SR"
count = 2

[[agents]]
role = "SP"
leave_rate = 0.1

[access]
kind = "choice"
temperature = 0.5
"""
YAML = """
description: From a file
max_cycles: 7
values: [1, 5]
admission: {threshold: 0.2}
agents:
  - {role: SR, count: 2}
  - {role: SP, leave_rate: 0.1}
access: {kind: choice, temperature: 0.5}
"""


@pytest.mark.parametrize(
    ("name", "text"), [("mine.toml", TOML), ("mine.yaml", YAML), ("mine.yml", YAML)]
)
def test_files(tmp_path: Path, name: str, text: str) -> None:
    path = tmp_path / name
    path.write_text(text)
    expected = Scenario(
        name="mine",
        description="From a file",
        agents=[{"role": "SR", "count": 2}, {"role": "SP", "leave_rate": 0.1}],
        max_cycles=7,
        values=(1, 5),
        admission={"threshold": 0.2},
        access={"kind": "choice", "temperature": 0.5},
    )
    assert (
        load_scenario(path)
        == load_scenario(str(path))
        == make_scenario(path)
        == make_scenario(str(path))
        == expected
    )
    assert parallel_env(path, max_cycles=3).game.scenario == expected.change(max_cycles=3)


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("a.toml", b"max_cycles = = 3", ["line", "1"]),
        ("a.toml", b"max_cycles = 3\nmax_cycles = 4", ["overwrite"]),
        ("a.toml", b"\x00\xff\xfe\x89PNG", ["utf-8"]),
        ("a.yaml", b"agents: [", ["line", "1"]),
        ("a.yaml", b"\x89PNG\xff", ["utf-8"]),
        (
            "a.yaml",
            b"max_cycles: !!python/object/apply:os.system ['true']",
            ["python"],
        ),
        ("a.yaml", b"- a\n- b", ["fields"]),
        ("a.yaml", b"just words", ["fields"]),
        ("a.yaml", b"", ["fields"]),
        ("a.yaml", b"1: 2", ["1"]),
        (
            "a.yaml",
            b'name: "\\uD800"\nagents: []\n',
            ["ud800"],
        ),
        (
            "a.yaml",
            b'tags: ["\\uD800"]\nagents: []\n',
            ["ud800"],
        ),
        ("a.toml", b"", ["agents", "missing"]),
        ("a.toml", b"lam = 3", ["lam", "3", "[0.5, 1)", "agents", "missing"]),
        ("a.json", b"{}", [".toml", ".yaml", ".yml"]),
        ("missing.toml", None, []),
        ("", None, []),
    ],
)
def test_broken_files(tmp_path: Path, name: str, content: bytes | None, words: list[str]) -> None:
    path = tmp_path / name
    if content is not None:
        path.write_bytes(content)
    with refuses(ValueError, path.name, *words, str(path)):
        load_scenario(path)


def test_a_folder_is_no_file(tmp_path: Path) -> None:
    (tmp_path / "a.toml").mkdir()
    with refuses(ValueError, "a.toml"):
        make_scenario(tmp_path / "a.toml")


# --- changes
# ----------------------------------------------------------------------------------------


def test_a_scenario_is_frozen() -> None:
    scenario = make_scenario("peers")
    with refuses(ValueError, "lam", 0.9):
        scenario.lam = 0.9
    with refuses(ValueError, "count", 9):
        scenario.agents[0].count = 9
    assert hash(scenario) == hash(make_scenario("peers"))


def test_changes() -> None:
    paper = make_scenario("paper-3x3")
    quiet = paper.change(noise=0.0, lam=0.7)
    assert {group.noise for group in quiet.agents} == {0.0}
    assert quiet.lam == 0.7
    assert paper.lam == 0.5
    assert {group.noise for group in paper.agents if group.role == "SR"} == {0.005}
    assert paper.change() == paper


def test_noise_reaches_agents_that_are_changed_with_it() -> None:
    changed = make_scenario("paper-3x3").change(agents=AGENTS, noise=0.3)
    assert [group.noise for group in changed.agents] == [0.3, 0.3]
    with refuses(ValueError, "noise", "-1"):
        make_scenario("paper-3x3").change(noise=-1)


@pytest.mark.parametrize("name", scenarios())
def test_presets_survive_a_round_trip(name: str) -> None:
    scenario = make_scenario(name)
    assert Scenario.model_validate_json(scenario.model_dump_json()) == scenario
    assert read_scenario(scenario.model_dump(), "itself") == scenario


# --- anything at all
# --------------------------------------------------------------------------------

junk = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(-3, 9),
    st.floats(),
    st.text(max_size=4),
    st.just([]),
    st.just({}),
)
names = st.sampled_from(
    ["role", "count", "turns", "joins", "noise", "kind", "radius", "start", "stop", "x"]
)
inner = st.dictionaries(names, junk | st.sampled_from(["SR", "SP", "SR+SP", "choice"]), max_size=4)
agents = st.lists(inner | st.sampled_from([*AGENTS, {"role": "SR+SP", "count": 2}]), max_size=3)
fields = st.dictionaries(
    st.sampled_from([*Scenario.model_fields, "oops"]),
    junk | inner | st.lists(inner, max_size=2),
    max_size=4,
)


@given(fields, agents)
def test_a_scenario_of_anything_is_refused_clearly_or_plays(
    fields: dict[str, Any], agents: list[Any]
) -> None:
    message = "junk: "
    try:
        scenario = read_scenario({"agents": agents} | fields, "junk")
    except ValueError as refusal:
        message = str(refusal)
    else:
        plays(scenario)
    assert message.startswith("junk: ")


def plays(scenario: Scenario) -> None:
    if scenario.service == "synthetic":
        game, random = Game(scenario.change(max_cycles=1)), Random(np.random.default_rng(0))
        state = game.start(game.draw(random, start=True))
        assert np.all(np.isfinite(summarise(game, state)))


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"service": "hog", "frames": -1}, ("frames", "-1")),
        ({"service": "hog", "frames": ""}, ("frames",)),
        ({"agents": [{"role": "SR", "count": 10**9}, {"role": "SP"}]}, ("count", "1000000000")),
        (
            {"agents": [{"role": "SR", "leaves": 3}, {"role": "SP", "joins": 5}]},
            ("agents",),
        ),
    ],
)
def test_more_that_cannot_be_played_is_refused(changes, words):
    with refuses(ValueError, *words):
        make_scenario("paper-3x3").change(**changes)


def test_a_file_nested_too_deeply_is_refused(tmp_path):
    path = tmp_path / "deep.toml"
    path.write_text("a = " + "[" * 5000 + "]" * 5000)
    with refuses(ValueError, "deep.toml"):
        load_scenario(path)


def test_the_strongest_of_overlapping_perturbations_counts_and_none_outside() -> None:
    both = [
        Perturbation(start=1, stop=4, strength=0.75),
        Perturbation(start=2, stop=3, strength=0.5),
    ]
    assert [strength_in(both, round) for round in range(5)] == [0, 0.75, 0.75, 0.75, 0]
    scenario = make_scenario("paper-3x3").change(perturbations=both, max_cycles=5)
    strengths = Perturbations(scenario, np.zeros(())).strength(np.arange(5))
    assert strengths.tolist() == [0, 0.75, 0.75, 0.75, 0]
