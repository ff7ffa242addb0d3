"""Compiled code is kept in a file, and made once."""

import builtins
import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

import pytest

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


def test_missing_llvm_is_an_error_that_names_the_extra(monkeypatch):
    real = builtins.__import__

    def missing(name, *args, **kwargs):
        if name.startswith("llvmlite"):
            raise ImportError(name)
        return real(name, *args, **kwargs)

    library._llvm.cache_clear()
    monkeypatch.setattr(builtins, "__import__", missing)
    with pytest.raises(UnrecordableError, match="train"):
        library.load("a source that is not known yet")
    monkeypatch.undo()
    library._llvm.cache_clear()


def test_library_does_not_import_llvm():
    code = "import roletrust_env, sys; assert not {'llvmlite', 'numba'} & set(sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True)
