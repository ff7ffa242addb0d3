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
        "import agents, baselines",
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
    assert not others & imported("import experiments.cli")


def test_import_takes_less_than_half_a_second() -> None:
    """The quickest of three, in processor time: the clock would count what else the machine was doing."""
    code = "from time import process_time as now; start = now(); import roletrust_env; print(now() - start)"
    runs = [subprocess.run([sys.executable, "-c", code], capture_output=True, check=True) for _ in range(3)]
    assert min(float(run.stdout) for run in runs) < 0.5
