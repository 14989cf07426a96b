"""Shapes in signatures: the check that the soak makes of all calls sees a wrong one."""

import numpy as np
import pytest
from support.shapes import checked


def product(matrix, vector):
    return matrix @ vector if matrix.shape[1] == vector.shape[0] else vector


product.__annotations__ = {
    "matrix": "Float[np.ndarray, 'n m']",
    "vector": 'Float[np.ndarray, "m"] | None',
    "return": "Float[np.ndarray, 'n']",
}


def test_right_shapes_pass():
    assert checked(product)(np.ones((2, 3)), np.ones(3)).tolist() == [3.0, 3.0]


@pytest.mark.parametrize(
    ("matrix", "vector", "name"),
    [
        (np.ones(2), np.ones(2), "matrix"),
        (np.ones((2, 3)), np.ones(2), "vector"),
        (np.ones((2, 3), int), np.ones(3), "matrix"),
    ],
)
def test_a_wrong_shape_or_type_is_seen(matrix, vector, name):
    with pytest.raises(AssertionError, match=f"product: {name} is "):
        checked(product)(matrix, vector)


def test_a_wrong_result_is_seen():
    def lost(vector):
        return vector[:-1]

    lost.__annotations__ = {"vector": "Float[Array, 'n']", "return": "Float[Array, 'n']"}
    with pytest.raises(AssertionError, match="return is "):
        checked(lost)(np.ones(3))
