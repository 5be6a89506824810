"""Frames of a headset whose head is turned and elsewhere, made with the rotations of SciPy; what eyes see."""

import numpy as np
from scipy.spatial.transform import Rotation

from evenlight.hardware.presentation.headset_views import EyeFov, EyePose, HeadsetFrame, Pose
from evenlight.stimuli.scenes.engine.camera import EyeView

# As headsets have them: an eye sees farther away from the nose, and farther down than up.
FOVS = EyeFov(-0.9, 0.7, 0.75, -0.85), EyeFov(-0.7, 0.9, 0.75, -0.85)
# About x right, y up and z backwards: positive turns are up, to the left, and towards the left shoulder.
POSES = {
    "30 to the left": Rotation.from_euler("y", 30, degrees=True),
    "20 up": Rotation.from_euler("x", 20, degrees=True),
    "15 to the left shoulder": Rotation.from_euler("z", 15, degrees=True),
}


def frame_of(turn=None, place=(0.0, 0.0, 0.0), eye_distance=0.063, fovs=FOVS) -> HeadsetFrame:
    """Return a frame with the head somewhere [m], turned."""
    turn = Rotation.identity() if turn is None else turn
    quaternion = tuple(turn.as_quat().tolist())
    eyes = [np.array(place) + turn.apply([side * eye_distance / 2, 0, 0]) for side in (-1, 1)]
    left, right = (
        EyePose(Pose(tuple(eye.tolist()), quaternion), fov) for eye, fov in zip(eyes, fovs, strict=True)
    )
    return HeadsetFrame(0.0, 1 / 90, (left, right), Pose(place, quaternion), visible=True, tracked=True)


def since(pose: Pose, origin: Pose) -> tuple[np.ndarray, Rotation]:
    """Return where a pose is, and how it is turned, as seen from another one's place and heading."""
    right, _, back = Rotation.from_quat(origin.orientation).apply([0.0, 0.0, -1.0])
    heading = Rotation.from_euler("y", np.arctan2(-right, -back))
    place = heading.inv().apply(np.subtract(pose.position, origin.position))
    return place, heading.inv() * Rotation.from_quat(pose.orientation)


def projected(view: EyeView, points, size: tuple[int, int]) -> np.ndarray:
    """Return where an eye sees points of a scene, (n, 2): pixels to the right and down; nan behind it."""
    left, right, down, up = view.edges
    across, above, ahead = (np.subtract(points, view.position) @ view.axes().T).T
    ahead = np.where(ahead > 0, ahead, np.nan)
    x, y = (across / ahead - left) / (right - left), (up - above / ahead) / (up - down)
    return np.stack([x * size[0], y * size[1]], axis=1)
