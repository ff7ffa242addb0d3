"""Compiled code is kept in a file, and made once."""

import builtins
import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from threading import Barrier

import numpy as np
import pytest

import roletrust_env
from roletrust_env.compiled import library
from roletrust_env.compiled.record import UnrecordableError

PROGRAM = """
import sys
sys.path.insert(0, {tests!r})
from recorded_rounds import record
from roletrust_env.compiled import library
made = []
compiled = library._compiled
library._compiled = lambda source, path: (made.append(path), compiled(source, path))[1]
record("paper-3x3", "mean").function()
print(len(made))
"""


def compilations(folder):
    """Return how often a new process compiles a game."""
    code = PROGRAM.format(tests=os.path.dirname(__file__))
    environment = {**os.environ, "XDG_CACHE_HOME": str(folder)}
    done = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True
    )
    return int(done.stdout)


def test_second_process_compiles_nothing(tmp_path):
    assert [compilations(tmp_path), compilations(tmp_path)] == [1, 0]


def test_processes_that_start_together_compile_once(tmp_path):
    with ThreadPoolExecutor(4) as pool:
        assert sum(pool.map(lambda _: compilations(tmp_path), range(4))) == 1


def test_broken_file_is_compiled_again(tmp_path):
    compilations(tmp_path)
    (file,) = (tmp_path / "roletrust").glob("*.o")
    file.write_bytes(file.read_bytes()[:-1])
    assert compilations(tmp_path) == 1


def test_cache_that_cannot_be_written_is_replaced(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    assert library.cache_folder().is_dir()


@pytest.mark.skipif(os.name != "posix", reason="permissions of POSIX")
def test_cache_that_others_can_write_is_not_run(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert library.cache_folder() == tmp_path / "roletrust"
    (tmp_path / "roletrust").chmod(0o722)
    assert tmp_path not in library.cache_folder().parents


def test_relative_cache_home_is_ignored(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_CACHE_HOME", "here")
    assert library.cache_folder().is_absolute()
    assert not (tmp_path / "here").exists()


@pytest.mark.parametrize("suffix", [".o", ".lock"])
@pytest.mark.parametrize("obstacle", [os.mkdir, os.mkfifo, lambda path: os.symlink("none", path)])
def test_obstacle_in_the_cache_costs_a_compilation(suffix, obstacle, tmp_path):
    compilations(tmp_path)
    (file,) = (tmp_path / "roletrust").glob("*.o")
    place = file.with_suffix(suffix)
    file.unlink()
    place.unlink(missing_ok=True)
    obstacle(place)
    assert compilations(tmp_path) == 1


def test_threads_that_start_together_play_the_same_rounds(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    together = Barrier(4)

    def play(_):
        together.wait()
        env = roletrust_env.parallel_env("paper-3x3", engine="compiled", lam=0.613)
        env.reset(seed=0)
        total = 0.0
        while env.agents:
            actions = {a: np.full(env.action_space(a).shape, 0.5) for a in env.agents}
            total += sum(env.step(actions)[1].values())
        return total

    with ThreadPoolExecutor(4) as pool:
        assert len(set(pool.map(play, range(4)))) == 1


def test_missing_llvm_is_an_error_that_names_the_extra(monkeypatch):
    real = builtins.__import__

    def missing(name, *args, **kwargs):
        if name.startswith("llvmlite"):
            raise ImportError(name)
        return real(name, *args, **kwargs)

    library._llvm.cache_clear()
    monkeypatch.setattr(builtins, "__import__", missing)
    with pytest.raises(UnrecordableError, match="compiled"):
        library.load("a source that is not known yet")
    monkeypatch.undo()
    library._llvm.cache_clear()


def test_library_does_not_import_llvm():
    code = "import roletrust_env, sys; assert not {'llvmlite', 'numba'} & set(sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True)
