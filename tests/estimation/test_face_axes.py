"""Axes of a sensor that was laid on its faces and turned by hand: maps put in are found."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from testbench.consistency.angular_rate import names_of
from testbench.estimation.alignment.face_axes import face_axes
from testbench.exceptions import InputError

RATE = 50
FACES = {
    "+z": Rotation.identity(),
    "+x": Rotation.from_euler("y", 90, degrees=True).inv(),
    "-z": Rotation.from_euler("x", 180, degrees=True),
    "+y": Rotation.from_euler("x", 90, degrees=True),
    "-x": Rotation.from_euler("y", 90, degrees=True),
    "-y": Rotation.from_euler("x", -90, degrees=True),
}


def laid_down(faces, acc_map, gyr_map, seed=0):
    """Rates and forces of a part that lies 3 s on each face, with maps, noise and a bias."""
    rng = np.random.default_rng(seed)
    keys = [FACES[name] for name in faces]
    # up in the part is the named axis: R_world_from_part turns it to z
    times, turns = [], []
    for i, own in enumerate(keys):
        times += [5.0 * i, 5.0 * i + 3.0]
        turns += [own, own]
    t = np.arange(round((5.0 * len(keys) - 2.0) * RATE)) / RATE
    q = Slerp(times, Rotation.concatenate(turns))(np.minimum(t, times[-1]))
    up = q.inv().apply([0, 0, 9.80665])
    rate = np.vstack([np.zeros((1, 3)), (q[:-1].inv() * q[1:]).as_rotvec() * RATE])
    gyr = rate @ np.linalg.inv(gyr_map).T + np.radians(0.5) + rng.normal(0, 1e-3, rate.shape)
    acc = up @ np.linalg.inv(acc_map).T + rng.normal(0, 0.02, up.shape)
    return gyr, acc


SWAPPED = np.array([[0, 1, 0], [-1, 0, 0], [0, 0, 1.0]])
MIRRORED = np.diag([1, 1, -1.0])


@pytest.mark.parametrize("acc_map", [np.eye(3), SWAPPED, MIRRORED])
@pytest.mark.parametrize("gyr_map", [np.eye(3), SWAPPED, MIRRORED])
def test_maps_are_found(acc_map, gyr_map):
    faces = ["+z", "+x", "-z", "+y", "-x", "-y"]
    gyr, acc = laid_down(faces, acc_map, gyr_map)
    found = face_axes(gyr, acc, 1 / RATE, faces)
    assert found.acc == names_of(acc_map)
    assert found.gyr == names_of(gyr_map)
    assert found.gain == pytest.approx(1, abs=0.01)
    assert found.crooked_deg < 1 and found.missed_deg < 3 < found.next_missed_deg
    assert len(found.rests_s) == len(faces)


def test_what_was_not_shown_is_not_told():
    gyr, acc = laid_down(["+z", "-z", "+z"], np.eye(3), np.eye(3))
    found = face_axes(gyr, acc, 1 / RATE, ["+z", "-z", "+z"])
    assert found.acc is None and found.gyr is None


def test_faces_that_do_not_fit_the_rests_are_refused():
    gyr, acc = laid_down(["+z", "+x", "+y"], np.eye(3), np.eye(3))
    with pytest.raises(InputError, match="names 2 rests, and 3 of 1 s"):
        face_axes(gyr, acc, 1 / RATE, ["+z", "+x"])
    with pytest.raises(InputError, match="up is no face"):
        face_axes(gyr, acc, 1 / RATE, ["up", "+x", "+y"])
