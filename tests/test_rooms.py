"""The rooms of the house: who imports whom, as `pyproject.toml` has it and as the documentation
draws it."""

import re
import subprocess
import sys
from collections import Counter
from functools import cache
from pathlib import Path

import grimp
import gymnasium
import numpy as np

from roletrust_env import (
    AttackVecEnv,
    Game,
    RoleVecEnv,
    make_scenario,
    make_task,
    parallel_env,
)
from roletrust_env import env as aec_env
from roletrust_env.trust.models.central.role_trust import RoleTrust

HOUSE = Path(__file__).parent.parent
FOLDERS = {  # by the name of the package
    "roletrust_env": HOUSE / "roletrust_env",
    "roletrust_agents": HOUSE / "agents" / "roletrust_agents",
    "roletrust_baselines": HOUSE / "baselines" / "roletrust_baselines",
    "roletrust_experiments": HOUSE / "experiments" / "roletrust_experiments",
    "roletrust_manager": HOUSE / "experiments" / "roletrust_manager",
    "studies": HOUSE / "experiments" / "studies",
}
PAGE = (HOUSE / "docs/how/structure.md").read_text(encoding="utf-8")
LONGEST = 600


@cache
def arrows() -> dict[str, set[str]]:
    """Which room imports from which other; what a folder's `__init__` hands on is nobody's
    import."""
    graph = grimp.build_graph(*FOLDERS)
    found: dict[str, set[str]] = {}
    for importer in graph.modules:
        for imported in graph.find_modules_directly_imported_by(importer):
            above, below = room(importer), room(imported)
            if not {importer, imported} & FOLDERS.keys() and above != below:
                found.setdefault(above, set()).add(below)
    return found


def room(module: str) -> str:
    """The room of a module: a folder, a file beside folders, or the small files of the library,
    which are one.

    The rooms of the other packages are called after the folder at the top, such as
    `agents/learned`; studies are one.
    """
    package, *below = module.split(".")[:2]
    if package == "studies":
        return package
    name = "/".join(
        [package if package == "roletrust_env" else package.removeprefix("roletrust_"), *below]
    )
    if FOLDERS[package].joinpath(*below).is_dir():
        return name
    return package if package == "roletrust_env" else f"{name}.py"


def reduced(arrows: dict[str, set[str]]) -> set[tuple[str, str]]:
    """The arrows that no longer way around replaces."""

    def reach(start: str) -> set[str]:
        direct = arrows.get(start, set())
        return direct.union(*map(reach, direct))

    return {
        (a, b)
        for a, below in arrows.items()
        for b in below
        if not any(b in reach(c) for c in below - {b})
    }


def drawn() -> set[tuple[str, str]]:
    """The arrows of the picture."""
    picture = re.search(r"```mermaid\n(.*?)```", PAGE, flags=re.DOTALL)
    assert picture is not None
    return set(re.findall(r"^ *([\w/.]+) --> ([\w/.]+)$", picture[1], flags=re.MULTILINE))


def test_imports_go_down_only_and_in_no_circle():
    found = subprocess.run(
        [
            sys.executable,
            "-c",
            "from importlinter.cli import lint_imports; raise SystemExit(lint_imports())",
        ],
        cwd=HOUSE,
        capture_output=True,
        text=True,
    )
    assert found.returncode == 0, found.stdout


def test_the_picture_of_the_rooms_is_that_of_the_imports():
    assert drawn() == reduced(arrows())


def test_the_tree_names_every_room():
    tree = re.search(r"```text\n(.*?)```", PAGE, flags=re.DOTALL)
    assert tree is not None
    for name in sorted(set(arrows()) | {below for found in arrows().values() for below in found}):
        assert name.rpartition("/")[2].removesuffix(".py") in tree[1]


def test_every_file_is_read_in_one_sitting():
    for folder in (*FOLDERS.values(), HOUSE / "tests"):
        lengths = {path: len(path.read_text().splitlines()) for path in folder.rglob("*.py")}
        assert lengths
        assert {path.name: n for path, n in lengths.items() if n > LONGEST} == {}


def test_the_walk_of_a_round_names_the_files_that_a_round_runs():
    env = parallel_env("paper-3x3")
    env.reset(seed=0)
    actions = {agent: env.action_space(agent).sample() for agent in env.agents}
    for _ in range(2):
        env.step(actions)
    folder, files = HOUSE / "roletrust_env", set[str]()

    def note(frame, event, argument):
        file = Path(frame.f_code.co_filename)
        if event == "call" and file.is_relative_to(folder) and file.parent != folder:
            files.add(str(file.relative_to(folder)))

    sys.setprofile(note)
    env.step(actions)
    sys.setprofile(None)
    walk = PAGE.partition("## The walk of a round")[2].partition("\n## ")[0]
    assert set(re.findall(r"`(\w+/[\w/]+\.py)`", walk)) == files
    assert len(files) <= 10


def test_every_round_is_one_call_of_the_rules_and_of_the_model(monkeypatch):
    calls = Counter()

    def counted(cls, name):
        method = getattr(cls, name)

        def call(self, *arguments):
            calls[name] += 1
            return method(self, *arguments)

        monkeypatch.setattr(cls, name, call)

    counted(Game, "step")
    counted(RoleTrust, "update")
    task = make_task("paper-3x3", ("sp_2",), objective="exploit")
    envs = {
        "parallel": parallel_env("paper-3x3"),
        "task": gymnasium.make("RoleTrust/ProviderAttack-v0"),
        "vector": gymnasium.make_vec("RoleTrust/ProviderAttack-v0", num_envs=5),
        "sb3": AttackVecEnv(task, 5),
        "roles": RoleVecEnv(Game(make_scenario("paper-3x3")), "sr", 5),
    }
    turns = aec_env("paper-3x3")
    turns.reset(seed=0)
    for name, env in envs.items():
        env.reset()
        calls.clear()
        for _ in range(100):
            if name == "parallel":
                env.step({agent: env.action_space(agent).sample() for agent in env.agents})
            elif name in ("sb3", "roles"):
                env.step(np.stack([env.action_space.sample() for _ in range(env.num_envs)]))
            else:
                env.step(env.action_space.sample())
        assert calls == {"step": 100, "update": 100}, name
    calls.clear()
    for _ in range(100 * len(turns.possible_agents)):
        turns.step(turns.action_space(turns.agent_selection).sample())
    assert calls == {"step": 100, "update": 100}
