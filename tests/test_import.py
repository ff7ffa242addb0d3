"""Importing the library is quick and brings no heavy package along."""

import importlib
import subprocess
import sys

import pytest
from refusals import refuses


def imported(statement: str) -> set[str]:
    code = f"import sys; {statement}; print(*{{name.partition('.')[0] for name in sys.modules}})"
    return set(
        subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, check=True
        ).stdout.split()
    )


LIVE = {"cyclonedds", "rosbags", "cryptography"}


@pytest.mark.parametrize(
    ("statement", "needed"),
    [
        ("import roletrust_env", set()),
        (
            "import roletrust_env; e = roletrust_env.parallel_env(); e.reset(); "
            "e.step({agent: e.action_space(agent).low for agent in e.agents})",
            set(),
        ),
        ("import roletrust_agents, roletrust_baselines", set()),
        (
            "import roletrust_manager.robots.manager, roletrust_experiments.commands.robots.nodes",
            {"rich", "typer", *LIVE},
        ),
    ],
    ids=["import", "play", "players", "robots manager"],
)
def test_no_heavy_package_is_imported(statement: str, needed: set[str]) -> None:
    heavy = {
        "torch",
        "cv2",
        "stable_baselines3",
        "matplotlib",
        "ray",
        "imageio",
        "yaml",
        "pygame",
        "rich",
        "typer",
    }
    heavy |= {"bokeh", "pandas", "scipy", "ruamel", *LIVE}
    modules = imported(statement)
    assert "numpy" in modules
    assert heavy & modules == needed


def test_the_library_imports_what_is_used() -> None:
    code = "import sys; import roletrust_env; print(*sys.modules)"
    names = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    ).stdout.split()
    assert not {"pydantic", "scipy", "pandas"} & set(names)
    assert {name for name in names if name.startswith("roletrust")} == {
        "roletrust_env",
        "roletrust_env.envs",
        "roletrust_env.envs.spec",
    }
    assert len(names) < 450  # of NumPy, Gymnasium and PettingZoo


@pytest.mark.parametrize("option", ["--help", "--version"])
def test_the_command_line_imports_a_command_when_it_is_called(option: str) -> None:
    code = f"""import sys; from roletrust_experiments import main; sys.argv = ["roletrust", "{option}"]
try: main()
except SystemExit: print(*sys.modules)"""  # noqa: E501
    shown = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    ).stdout
    modules = shown.splitlines()[-1].split()
    assert not {"roletrust_env", "numpy", "pydantic", "gymnasium", "pettingzoo"} & set(modules)
    assert sum(name.startswith("roletrust") for name in modules) < 8  # no command
    assert len(modules) < 450


@pytest.mark.parametrize(("arguments", "status"), [(["list"], 0), (["train", "RaterAttack"], 2)])
def test_without_the_extra_train_a_line_says_what_is_needed(
    arguments: list[str], status: int
) -> None:
    code = f"""import sys; sys.modules["safetensors"] = None; sys.argv = ["roletrust", *{arguments}]
from roletrust_experiments import main; main()"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == status
    assert "safetensors: pip install 'roletrust-env[train]'" in " ".join(
        (done.stdout + done.stderr).split()
    )


def test_dir_shows_the_public_names_and_no_others() -> None:
    import roletrust_env

    assert sorted(dir(roletrust_env)) == sorted([*roletrust_env.__all__, "__version__"])
    assert {"TrustModel", "History", "AttackTask", "WindowedAttack", "metrics"} <= set(
        dir(roletrust_env)
    )
    assert all(hasattr(roletrust_env, name) for name in dir(roletrust_env))


def test_a_package_of_the_command_line_that_is_missing_is_named_in_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    import roletrust_experiments
    from roletrust_experiments import cli

    def run(missing: str) -> None:
        raise ModuleNotFoundError(f"No module named {missing!r}", name=missing)

    for missing in (
        "matplotlib.figure",
        "jinja2",
        "yaml",
    ):  # commands import them when they are called
        monkeypatch.setattr(cli, "main", lambda missing=missing: run(missing))
        with refuses(SystemExit, "2"):
            roletrust_experiments.main()
        assert (
            capsys.readouterr().err
            == f"roletrust needs {missing}: pip install 'roletrust-env[cli]'\n"
        )
    monkeypatch.setattr(cli, "main", lambda: run("elsewhere"))
    with pytest.raises(ModuleNotFoundError):
        roletrust_experiments.main()


def test_help_needs_the_command_line_alone() -> None:
    others = (
        "torch",
        "stable_baselines3",
        "sb3_contrib",
        "safetensors",
        "scipy",
        "cma",
        "pyarrow",
        "pandas",
        "cv2",
    )
    code = f"""import sys, typer
for name in {(*others, "cyclonedds", "rosbags", "cryptography", "bokeh", "imageio", "ray")}: sys.modules[name] = None
from roletrust_experiments.cli import app
for name, command in typer.main.get_command(app).commands.items(): command.loaded; print(name)"""  # noqa: E501
    shown = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert shown.returncode == 0, shown.stderr
    assert len(shown.stdout.split()) == 13


def test_without_extras_public_names_are_those_that_can_be_imported() -> None:
    code = """
import inspect, pydoc, sys
for package in ("stable_baselines3", "jax", "filelock"): sys.modules[package] = None
import roletrust_env
from roletrust_env import *
inspect.getmembers(roletrust_env); pydoc.render_doc(roletrust_env)
for name in ("AttackVecEnv", "RoleVecEnv", "AttackJaxEnv", "RoleTrustJaxEnv", "benchmark"):
    assert not hasattr(roletrust_env, name) and name not in dir(roletrust_env)
    for statement in ("roletrust_env." + name, "from roletrust_env import " + name):
        try: exec(statement)
        except Exception as error: print(type(error).__name__, error)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.count("DependencyNotInstalled") == 10
    assert (
        "AttackVecEnv needs stable_baselines3, which is not installed: pip install "
        "'roletrust-env[train]'" in done.stdout
    )


@pytest.mark.parametrize("former", ["live.wire.keys", "service.client"])
def test_the_former_places_of_the_manager_name_the_new_one(former):
    with pytest.raises(ImportError, match="roletrust_manager"):
        importlib.import_module(f"roletrust_env.{former}")
