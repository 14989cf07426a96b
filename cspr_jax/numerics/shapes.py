"""Types of arrays with shapes, `Float[Array, "n 3"]`, for readers and type checkers, not checked at run time."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from jaxtyping import Bool, Complex, Float, Int, Num, Shaped
else:
    Bool = Complex = Float = Int = Num = Shaped = Any

__all__ = ["Bool", "Complex", "Float", "Int", "Num", "Shaped"]
