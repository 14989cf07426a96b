"""Programs as jax lowers them (StableHLO, as bytes), and calls of them within functions that jax compiles.

`jax.export` does the same for programs that must last for years and run on other devices. These programs are read only
by the same jaxlib, which saves one more conversion, a package that `jax.export` needs, and SciPy's linear algebra,
which it imports for calls of LAPACK. Programs that call foreign code are not written.
"""

import functools
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import jax
import numpy as np
from jax.extend.core import Primitive
from jax.extend.mlir.dialects import func
from jax.extend.mlir.passmanager import PassManager
from jax.interpreters import mlir

# Calls of foreign code may contain addresses of a process, or need libraries that this process has not loaded.
_CALLS = b"custom_call"


class LoweredProgram(NamedTuple):
    """A function of arrays as a program.

    Fields:
        name: name of the function.
        code: bytes of the program.
        results: shape and dtype of each result.
    """

    name: str
    code: bytes
    results: tuple[tuple[tuple[int, ...], str], ...]


def lowered(function: Callable, leaves: Sequence[Any]) -> LoweredProgram | None:
    """Trace and lower a function."""
    # Keep unused arguments, so that calls can pass all of them.
    traced = jax.jit(function, keep_unused=True).trace(*leaves)
    results = traced.jaxpr.out_avals
    if traced.jaxpr.effects or any(result.weak_type for result in results):
        return None
    module = traced.lower().compiler_ir("stablehlo")
    # Without this, line numbers of Python would be half of the compiled code, and of the time for reading it.
    PassManager.parse("builtin.module(strip-debuginfo)", module.context).run(module.operation)
    code = mlir.module_to_bytecode(module)
    written = tuple((tuple(result.shape), np.dtype(result.dtype).str) for result in results)
    return None if _CALLS in code else LoweredProgram(function.__name__, code, written)


def call(program: LoweredProgram, *leaves: Any) -> list:
    """Call a program inside of a function that jax compiles."""
    return _primitive().bind(*leaves, program=program)


@functools.cache
def _primitive() -> Primitive:
    primitive = Primitive("lowered_program")
    primitive.multiple_results = True

    @primitive.def_abstract_eval
    def shapes(*leaves: Any, program: LoweredProgram) -> list:
        del leaves
        return [jax.core.ShapedArray(shape, np.dtype(dtype)) for shape, dtype in program.results]

    def operations(context: Any, *values: Any, program: LoweredProgram) -> Any:
        full = context.module_context
        try:
            module = mlir.ir.Module.parse(program.code, context=full.context)
            name = mlir.merge_mlir_modules(full.module, program.name, module, dst_symtab=full.symbol_table)
        except mlir.ir.MLIRError as error:
            raise ValueError("the program cannot be parsed") from error
        types = [mlir.aval_to_ir_type(full, result) for result in context.avals_out]
        return func.CallOp(types, mlir.ir.FlatSymbolRefAttr.get(name), values).results

    mlir.register_lowering(primitive, operations)
    return primitive
