"""Programs as jax lowers them (StableHLO, as bytes), and their call within a function that jax compiles.

`jax.export` does the same for programs that are to last for years and for other devices. These are read by the same
jaxlib alone, which saves one more conversion, a package that `jax.export` needs, and SciPy's linear algebra, which it
imports for calls of LAPACK: a program that calls anything but its own operations is not written.
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

# Calls of other code may hold addresses of one process, or need what this process has not loaded.
_CALLS = b"custom_call"


class LoweredProgram(NamedTuple):
    """A function of arrays as a program.

    Fields:
        name: of the function.
        code: the program.
        results: shape and dtype of each result.
    """

    name: str
    code: bytes
    results: tuple[tuple[tuple[int, ...], str], ...]


def lowered(function: Callable, leaves: Sequence[Any]) -> LoweredProgram | None:
    """Trace and lower a function."""
    # The module has all of the arguments, used or not.
    traced = jax.jit(function, keep_unused=True).trace(*leaves)
    results = traced.jaxpr.out_avals
    if traced.jaxpr.effects or any(result.weak_type for result in results):
        return None
    module = traced.lower().compiler_ir("stablehlo")
    # Lines of Python would be a half of the compiled code, and of the time for reading it.
    PassManager.parse("builtin.module(strip-debuginfo)", module.context).run(module.operation)
    code = mlir.module_to_bytecode(module)
    written = tuple((tuple(result.shape), np.dtype(result.dtype).str) for result in results)
    return None if _CALLS in code else LoweredProgram(function.__name__, code, written)


def call(program: LoweredProgram, *leaves: Any) -> list:
    """Results of a program, inside of a function that jax compiles."""
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
