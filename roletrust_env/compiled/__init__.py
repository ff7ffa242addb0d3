"""The optional compiled engine: it records the rules of a game once, and LLVM compiles them."""

from roletrust_env.compiled import namespace as namespace
from roletrust_env.compiled.engine import CompiledBatch, CompiledGame, Program
from roletrust_env.compiled.record import UnrecordableError

__all__ = ["CompiledBatch", "CompiledGame", "Program", "UnrecordableError"]
