"""A tape in C plays what it plays in Python, to the bit; shared objects are kept between
processes."""

import ctypes
import math
import os
import subprocess
import sys
import time
from unittest.mock import Mock

import numpy as np
import pytest

from roletrust_env.game.traced import compiler
from roletrust_env.game.traced.c_code import c_body, prelude
from roletrust_env.game.traced.compiler import SharedObject
from roletrust_env.game.traced.symbols import _CASTS, _TEMPLATES
from roletrust_env.game.traced.tape import Symbol, Tape, Untraceable

needs_compiler = pytest.mark.skipif(compiler.compiler() is None, reason="there is no C compiler")
NUMBERS = [0.0, -0.0, 0.1, -2.5, 1e-300, 1e17, math.inf, -math.inf, math.nan, math.pi]
NO_C = {"floor_divide", "remainder"}


def every_operation(tape, x, y, place, flag):
    """Write every operation that a rule may use, and some in a row."""
    below = tape.write("({} < {})", [x, y], "b")
    for name, template in _TEMPLATES.items():
        pair = [flag, below] if name.startswith("logical") else [x, y]
        if name == "sqrt":
            pair = [tape.write("abs({})", [x], "f"), y]
        if name not in NO_C:
            kind = getattr(np, name)(
                *[np.array(0.5 if pair[0].kind == "f" else True)] * getattr(np, name).nin
            ).dtype.kind
            yield tape.write(template, pair[: getattr(np, name).nin], kind)
    for kinds, template in _CASTS.items():
        if kinds not in ("fi", "ui"):  # of an infinite number there is none; words are for kernels
            yield tape.write(template, [{"f": x, "i": place, "b": flag}[kinds[0]]], kinds[1])
    for name in ("maximum", "minimum"):  # of 0.0 and -0.0, too
        yield tape.write(_TEMPLATES[name], [x, tape.write("(-{})", [x], "f")], "f")
    yield tape.write("({1} if {0} else {2})", [flag, x, -0.0], "f")
    yield tape.write(f"{tape.named('table', (0.5, -0.0, math.inf))}[{{}}]", [place], "f")
    yield tape.write("({} + {})", [tape.write("({} * {})", [x, 0.1], "f"), place], "f")


def c_round(tape, inputs, outputs, real="double"):
    """Return the round in C as a function of a list of numbers, which returns an array."""
    types = {"f": "real", "i": "whole", "b": "flag"}
    places = {symbol: f"({types[symbol.kind]})in[{k}]" for k, symbol in enumerate(inputs)}
    lines, tables = c_body(
        tape, places, [(f"out[{k}]", one) for k, one in enumerate(outputs)], real
    )
    source = "\n".join(
        [prelude(real), *tables, "void play(const double *in, double *out) {", *lines, "}"]
    )
    library = SharedObject(source).load()
    assert library is not None, source

    def play(numbers):
        given, found = np.array(numbers, float), np.empty(len(outputs))
        library.play(*(ctypes.c_void_p(one.ctypes.data) for one in (given, found)))
        return found

    return play


@needs_compiler
def test_a_round_in_c_is_that_in_python_to_the_bit(tmp_path, monkeypatch):
    monkeypatch.setattr(compiler, "_folder", lambda: tmp_path)
    tape = Tape(1000)
    inputs = [Symbol("f", "x"), Symbol("f", "y"), Symbol("i", "place"), Symbol("b", "flag")]
    outputs = list(every_operation(tape, *inputs))
    in_python = tape.written({"numbers": inputs}, [outputs]).play
    in_c = c_round(tape, inputs, outputs)
    for x in NUMBERS:
        for y in (0.25, -3.0, 1e-310, math.inf, math.nan):
            for place, flag in ((0, True), (2, False), (-1, True)):
                if math.isinf(x):  # Python refuses the sine
                    continue
                (expected,) = in_python((x, y, place, flag))
                found = in_c((x, y, place, flag))
                wrong = np.flatnonzero(
                    found.view(np.int64) != np.array(expected, float).view(np.int64)
                )
                assert all(math.isnan(found[k]) and math.isnan(expected[k]) for k in wrong), (
                    x,
                    y,
                    wrong,
                )


@needs_compiler
def test_what_calls_numpy_has_no_c():
    tape, x = Tape(10), Symbol("f", "x")
    (result,) = tape.call(np.sort, "sort", [[x]], "f")
    with pytest.raises(Untraceable, match="calls NumPy"):
        c_body(tape, {x: "in[0]"}, [("out[0]", result)], "double")
    with pytest.raises(Untraceable, match="C has no"):
        c_body(tape, {x: "in[0]"}, [("out[0]", tape.write("({} // {})", [x, 2.0], "f"))], "double")


@needs_compiler
def test_shared_objects_are_kept_between_processes(tmp_path):
    code = (
        "from roletrust_env.game.traced.compiler import SharedObject; one = SharedObject('int "
        "f(void) {return 3;}');"
        "print(one._process is None, one.load().f(), one._path.parent)"
    )
    environment = {"PATH": "/usr/bin:/bin", "XDG_CACHE_HOME": str(tmp_path)}
    said = [
        subprocess.run(
            [sys.executable, "-c", code], env=environment, capture_output=True, text=True
        ).stdout.split()
        for _ in range(2)
    ]
    assert [one[:2] for one in said] == [["False", "3"], ["True", "3"]], said
    assert len(list((tmp_path / "roletrust").iterdir())) == 1
    assert SharedObject("no C at all").load() is None


def test_what_nobody_used_for_months_is_deleted(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    folder = compiler._folder.__wrapped__()
    for name, days in (("old.so", 61), ("new.so", 59)):
        (folder / name).touch()
        os.utime(folder / name, (time.time() - days * 24 * 3600,) * 2)
    (folder / "folder").mkdir()
    os.utime(folder / "folder", (0, 0))
    (folder / "gone.so").symlink_to("nowhere")
    assert compiler._folder.__wrapped__() == folder
    (folder / "folder").rmdir()
    (folder / "gone.so").unlink()
    assert [file.name for file in folder.iterdir()] == ["new.so"]


@needs_compiler
def test_a_shared_object_that_was_cut_off_is_compiled_again(tmp_path, monkeypatch):
    monkeypatch.setattr(compiler, "_folder", lambda: tmp_path)
    source = "int f(void) {return 4;}"
    first = SharedObject(source)
    path = first._path
    assert first.load().f() == 4
    for content in (
        b"",
        b"\x7fELF" + bytes(99),
    ):  # to load a longer part of it would end the process
        path.unlink(missing_ok=True)  # this process may have loaded it
        path.write_bytes(content)
        again = SharedObject(source)
        assert again._process is not None
        assert again.load().f() == 4
    assert SharedObject(source)._process is None


def test_a_strange_environment_of_the_process_does_no_harm(tmp_path, monkeypatch):
    known, folder = compiler.compiler.__wrapped__, compiler._folder.__wrapped__
    for value, expected in ((" ", ("cc", None)), ('cc "', (None,)), ("no-such-compiler", (None,))):
        monkeypatch.setenv("CC", value)
        assert known() in expected, value
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setattr(compiler.Path, "home", Mock(side_effect=RuntimeError("no home directory")))
    own = folder()
    assert own.is_dir()
    (tmp_path / "file").touch()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    assert folder() != own
