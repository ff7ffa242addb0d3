"""Machine code: LLVM compiles the source of a round once, and a file keeps what it made."""

import atexit
import ctypes
import hashlib
import os
import sys
import tempfile
from collections.abc import Callable
from functools import cache
from importlib.metadata import version
from pathlib import Path
from threading import Lock, Timer
from typing import Any

from roletrust_env.compiled.record import UnrecordableError
from roletrust_env.storage.files import replacing

SLOW_S = 2.0
"""Number of seconds of compiling from which a line says so."""

PATIENCE_S = 60.0
"""Number of seconds for which another process may compile the same game; then this one does."""

Function = Callable[[int], None]
"""Function of the address of its arguments, see `roletrust_env.compiled.emit.emit`."""


@cache
def _llvm() -> Any:
    """Return LLVM, ready for this processor."""
    try:
        import llvmlite.binding as llvm
    except ImportError as error:
        raise UnrecordableError(f"{error}: pip install 'roletrust-env[compiled]'") from None
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    return llvm


def _machine() -> Any:
    """Return the processor that code is made for."""
    llvm = _llvm()
    return llvm.Target.from_default_triple().create_target_machine(
        cpu=llvm.get_host_cpu_name(),
        features=llvm.get_host_cpu_features().flatten(),
        opt=2,
        jit=True,
    )


_LOADED: dict[str, Any] = {}
"""Engine that holds the code of each source; code is gone with its engine."""

_LOADING = Lock()


def load(source: str) -> Function:
    """Return the function `run` of a source, compiled now or before. It keeps the lock of Python.

    Args:
        source: Source in the language of LLVM.
    """
    with _LOADING:
        if source not in _LOADED:
            llvm = _llvm()
            engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), _machine())
            engine.add_object_file(llvm.ObjectFileRef.from_data(_object_code(source)))
            engine.finalize_object()
            _LOADED[source] = engine
    kind = ctypes.PYFUNCTYPE(None, ctypes.c_void_p)
    return kind(_LOADED[source].get_function_address("run"))


def _object_code(source: str) -> bytes:
    """Return the object code of a source, from its file or from the compiler."""
    llvm = _llvm()
    facts = (
        source,
        version("roletrust-env"),
        str(llvm.llvm_version_info),
        llvm.get_default_triple(),
        llvm.get_host_cpu_name(),
        llvm.get_host_cpu_features().flatten(),
    )
    name = hashlib.sha256("\0".join(facts).encode()).hexdigest()[:32]
    path = cache_folder() / f"{name}.o"
    if (code := _cached(path)) is not None:
        return code
    from filelock import FileLock  # of the extra that brings LLVM

    try:
        with FileLock(path.with_suffix(".lock"), timeout=PATIENCE_S):
            if (code := _cached(path)) is None:  # else another process has compiled it meanwhile
                code = _compiled(source, path)
                with replacing(path) as temporary:
                    temporary.write_bytes(_signed(code))
            return code
    except OSError:  # the disk is full, or the lock cannot be had
        return _compiled(source, path) if code is None else code


def _compiled(source: str, path: Path) -> bytes:
    """Return the object code of a source; a line says so if that takes long."""
    say = Timer(
        SLOW_S,
        print,
        (f"Compiling a game takes some seconds, once; kept in {path.parent}",),
        {"file": sys.stderr, "flush": True},
    )
    say.daemon = True
    say.start()
    try:
        llvm, machine = _llvm(), _machine()
        module = llvm.parse_assembly(source)
        options = llvm.create_pipeline_tuning_options(speed_level=2)
        options.loop_unrolling = False  # it takes most of the time, and gains nothing
        builder = llvm.create_pass_builder(machine, options)
        builder.getModulePassManager().run(module, builder)
        code: bytes = machine.emit_object(module)
        return code
    finally:
        say.cancel()


def _signed(code: bytes) -> bytes:
    return hashlib.sha256(code).digest() + code


def _cached(path: Path) -> bytes | None:
    """Return the object code in a file; None if there is none that is whole."""
    try:
        content = path.read_bytes() if path.is_file() else b""  # a pipe would be waited for
    except OSError:
        return None
    return content[32:] if content == _signed(content[32:]) else None


def cache_folder() -> Path:
    """Return the user's folder of compiled games; a temporary one if that cannot be written, or if
    others can write to it, since its files are run.
    """
    home = Path(os.environ.get("XDG_CACHE_HOME", ""))
    folder = (home if home.is_absolute() else Path.home() / ".cache") / "roletrust"
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        facts = folder.stat()
    except OSError:
        return _private_folder()
    private = os.name != "posix" or (facts.st_uid == os.getuid() and not facts.st_mode & 0o022)
    return folder if private and os.access(folder, os.W_OK) else _private_folder()


@cache
def _private_folder() -> Path:
    """Return a folder of this process, which goes when the process ends."""
    folder = tempfile.TemporaryDirectory(prefix="roletrust-")
    atexit.register(folder.cleanup)
    return Path(folder.name)
