"""The optional compiled engine: it records the rules of a game once, and LLVM compiles them.

A round is recorded with the arrays of `record`, which are a further array library: the same
functions run on them as on NumPy, torch and JAX. `schedule` decides which operations share a loop,
`emit` writes the loops in the language of LLVM, and `library` compiles them and keeps the code in
the user's cache.

A trust model or a policy of your own is recorded like those of this package. It needs no
registration. It must

- use operators, methods, and the functions of `roletrust_env.arrays.namespace(array)`, not those of
  a fixed library;
- not branch on values, such as `if ratings.values.max() > 0.5`; write `xp.where` instead;
- not write to arrays in place, and not keep anything in itself;
- draw random numbers from the `random` that it gets.

`UnrecordableError` names what cannot be recorded, at construction. Attributes become constants, so
a model and a policy must not change afterwards.
"""

from roletrust_env.compiled import namespace as namespace
from roletrust_env.compiled.engine import CompiledBatch, CompiledGame, Program
from roletrust_env.compiled.record import UnrecordableError

__all__ = ["CompiledBatch", "CompiledGame", "Program", "UnrecordableError"]
