"""Finite rotations and the even functions of their angle against closed forms."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from flapgym.structure import rotation

ANGLES = [0.0, 1e-9, 1e-4, 0.02, 0.5, 1.7, 2.9]


@pytest.mark.parametrize("angle", ANGLES)
def test_rotation_matrix_and_vector_agree_with_scipy(angle: float) -> None:
    vector = angle * np.array([0.48, -0.6, 0.64])
    matrix = rotation.rotation_matrix(vector)
    np.testing.assert_allclose(matrix, Rotation.from_rotvec(vector).as_matrix(), atol=1e-15)
    np.testing.assert_allclose(rotation.rotation_vector(matrix), vector, atol=5e-15)


@pytest.mark.parametrize("angle", ANGLES[2:])
def test_series_meet_their_closed_forms(angle: float) -> None:
    squared = np.array(angle**2)
    stretch = 0.5 * angle / np.sin(0.5 * angle)
    assert rotation.even(rotation.STRETCH, squared) == pytest.approx(stretch, rel=1e-14)
    shear = np.tan(0.25 * angle) / (2.0 * angle)
    assert rotation.even(rotation.SHEAR, squared) == pytest.approx(shear, rel=1e-14)
    if angle > 0.4:  # below, the closed form loses digits
        deviator = (1.0 - stretch) / angle**2
        assert rotation.even(rotation.DEVIATOR, squared) == pytest.approx(deviator, rel=1e-13)
