"""Importing the library is quick and brings no heavy package along."""

import subprocess
import sys

import pytest


def imported(statement: str) -> set[str]:
    code = f"import sys; {statement}; print(*{{name.partition('.')[0] for name in sys.modules}})"
    return set(subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split())


@pytest.mark.parametrize(
    "statement",
    [
        "import roletrust_env",
        "import roletrust_env; e = roletrust_env.parallel_env(); e.reset(); "
        "e.step({agent: e.action_space(agent).low for agent in e.agents})",
        "import roletrust_agents, roletrust_baselines",
    ],
    ids=["import", "play", "players"],
)
def test_no_heavy_package_is_imported(statement: str) -> None:
    heavy = {"torch", "cv2", "stable_baselines3", "matplotlib", "ray", "imageio", "yaml", "pygame", "rich", "typer"}
    heavy |= {"cyclonedds", "rosbags", "cryptography"}
    modules = imported(statement)
    assert "numpy" in modules
    assert not heavy & modules


def test_the_command_line_starts_with_its_own_extra() -> None:
    others = {"torch", "cv2", "scipy", "cma", "safetensors", "stable_baselines3", "sb3_contrib", "mpe2", "vmas"}
    others |= {"cyclonedds", "rosbags", "cryptography"}
    assert not others & imported("import roletrust_experiments.cli")


def test_import_takes_little_beside_what_it_imports() -> None:
    """In processor time of one process, the least of five: no clock, which a slow or busy machine would stretch."""
    code = (
        "from time import process_time as now; start = now(); "
        "import numpy, array_api_compat, pydantic, gymnasium, pettingzoo; theirs = now(); "
        "import roletrust_env; print(theirs - start, now() - theirs)"
    )
    runs = [subprocess.run([sys.executable, "-c", code], capture_output=True, check=True) for _ in range(5)]
    theirs, ours = (min(times) for times in zip(*(map(float, run.stdout.split()) for run in runs), strict=True))
    assert ours < 2 * theirs  # it is 1.2 times as much


def test_dir_shows_the_public_names_and_no_others() -> None:
    import roletrust_env

    assert sorted(dir(roletrust_env)) == sorted([*roletrust_env.__all__, "__version__"])
    assert {"TrustModel", "History", "AttackTask", "WindowedAttack", "metrics"} <= set(dir(roletrust_env))
    assert all(hasattr(roletrust_env, name) for name in dir(roletrust_env))
