"""The orientation of a rigid cluster of three or more markers, frame by frame.

The rotation that brings the cluster's reference shape nearest to the markers of a frame, in least
squares, is that of a singular value decomposition (Kabsch, Acta Cryst. A32, 1976; Arun, Huang and
Blostein, IEEE PAMI 9, 1987). The reference shape is the median of the markers in the cluster's own
frame, over all frames, and starts from the frame in which most of them are seen.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from testbench.model import rotation

LEAST_MARKERS = 3
PASSES = 4
"""The shape is found so many times from the frames that it was fitted to."""
SHAPE_FRAMES = 4000
"""The shape is found from at most so many frames, evenly spread."""
LEAST_WIDTH = 0.05
"""Seen markers whose width across their longest extent is less than this part of it count as on
one line: their orientation about it is not known.
"""
WORST, SLACK_M = 5.0, 1e-3
"""A frame is lost if its residual is larger than so many times the median, and than this [m]."""
MOST_DEFORMED = 0.15
"""A cluster whose median residual is larger than this part of its size is not rigid."""


@dataclass(frozen=True)
class ClusterFit:
    """Orientations of a cluster.

    Attributes:
        q_world_from_cluster: Shape (n, 4), NaN where lost.
        residual_m: RMS distance of a frame's markers from the shape, shape (n,) [m]; NaN where
            fewer than three were seen.
        size_m: RMS distance of the shape's markers from their middle [m].
        few: Frames with fewer than three markers.
        in_line: Frames whose seen markers are on one line.
        deformed: Frames whose residual is too large.
        noise_m: Standard deviation of a marker about where the shape has it, along each axis [m].
        sd_rad: What that makes of the orientation: standard uncertainty about the axis about which
            the markers tell least, RMS over the frames [rad].
    """

    q_world_from_cluster: np.ndarray
    residual_m: np.ndarray
    size_m: float
    few: int
    in_line: int
    deformed: int
    noise_m: float
    sd_rad: float

    @property
    def residual_rms_m(self) -> float:
        """Over the frames that are known [m]."""
        known = np.isfinite(self.q_world_from_cluster[:, 0])
        return float(np.sqrt(np.mean(self.residual_m[known] ** 2))) if known.any() else np.nan

    @property
    def rigid(self) -> bool:
        """Whether the markers keep their distances."""
        seen = self.residual_m[np.isfinite(self.residual_m)]
        return not len(seen) or float(np.median(seen)) <= MOST_DEFORMED * self.size_m


def fit_cluster(markers: np.ndarray) -> ClusterFit | None:
    """Orientation of a cluster in every frame.

    Args:
        markers: In the world, shape (n, k, 3) [m]; NaN where a marker was not seen.

    Returns:
        The fit; None if no frame has three markers that are not on one line.
    """
    seen = np.isfinite(markers).all(axis=2)
    enough = seen.sum(axis=1) >= LEAST_MARKERS
    if not enough.any():
        return None
    shape = _shape(markers, seen, enough)
    known = seen & np.isfinite(shape).all(axis=1)
    enough = known.sum(axis=1) >= LEAST_MARKERS
    q = np.full((len(markers), 4), np.nan)
    residual = np.full(len(markers), np.nan)
    wide = _wide(shape, known) & enough
    if not wide.any():
        return None
    matrices, residual[enough], _ = _fit(markers[enough], shape, known[enough])
    q[enough] = rotation.from_matrix(matrices)
    limit = max(WORST * float(np.median(residual[wide])), SLACK_M)
    deformed = wide & (residual > limit)
    q[~wide | deformed] = np.nan
    centred = shape - np.nanmean(shape, axis=0)
    size = float(np.sqrt(np.nanmean(np.sum(centred**2, axis=1))))
    used = wide & ~deformed
    noise = _noise(known[used], residual[used])
    return ClusterFit(
        q,
        residual,
        size,
        int((~enough).sum()),
        int((enough & ~wide).sum()),
        int(deformed.sum()),
        noise,
        noise * _turn_of_noise(shape, known[used]),
    )


def _noise(known: np.ndarray, residual: np.ndarray) -> float:
    """Standard deviation of a marker along each axis [m].

    Of the 3 k coordinates of k markers a frame's pose takes six.

    Args:
        known: Markers of each frame that were used, shape (n, k).
        residual: RMS distance of them from the shape, shape (n,) [m].
    """
    count = known.sum(axis=1)
    left = float(np.sum(3 * count - 6))
    return float(np.sqrt(np.sum(count * residual**2) / left)) if left > 0 else float("nan")


def _turn_of_noise(shape: np.ndarray, known: np.ndarray) -> float:
    """Standard uncertainty of an orientation for one metre of noise [rad/m].

    Noise of markers that is alike along all axes turns a cluster by the covariance J^-1, with J the
    inertia of its markers about their middle (each of unit mass): the normal matrix of the fit,
    linearised for small turns.

    Args:
        shape: Shape (k, 3) [m].
        known: Markers of each frame that were used, shape (n, k).

    Returns:
        About the worst axis.
    """
    masks, counts = np.unique(known, axis=0, return_counts=True)
    total = np.zeros((3, 3))
    for mask, count in zip(masks, counts, strict=True):
        own = shape[mask] - shape[mask].mean(axis=0)
        inertia = np.sum(own**2) * np.eye(3) - own.T @ own
        total += count * np.linalg.inv(inertia)
    if not len(masks):
        return float("nan")
    return float(np.sqrt(np.linalg.eigvalsh(total / counts.sum())[-1]))


def _shape(markers: np.ndarray, seen: np.ndarray, enough: np.ndarray) -> np.ndarray:
    """The markers in the cluster's own frame, shape (k, 3) [m]; NaN of one that never fits."""
    rows = np.flatnonzero(enough)
    rows = rows[:: max(len(rows) // SHAPE_FRAMES, 1)]
    part, seen = markers[rows], seen[rows]
    shape = part[_typical(part, seen)].copy()
    for _ in range(PASSES):
        known = seen & np.isfinite(shape).all(axis=1)
        usable = (known.sum(axis=1) >= LEAST_MARKERS) & _wide(shape, known)
        if not usable.any():
            break
        matrices, residual, middles = _fit(part[usable], shape, known[usable])
        good = residual <= max(WORST * float(np.median(residual)), SLACK_M)
        offset = part[usable][good] - middles[0][good][:, None]
        own = np.einsum("nij,nki->nkj", matrices[good], offset) + middles[1][good][:, None]
        found = np.isfinite(own).all(axis=2).any(axis=0)
        shape = np.full_like(shape, np.nan)
        shape[found] = np.nanmedian(own[:, found], axis=0)
    return shape


def _typical(part: np.ndarray, seen: np.ndarray) -> int:
    """The frame to begin with: most markers seen, their distances nearest to the median ones."""
    distances = np.linalg.norm(part[:, :, None] - part[:, None], axis=3)
    both = seen[:, :, None] & seen[:, None]
    usual = np.zeros(distances.shape[1:])
    pairs = both.any(axis=0)
    usual[pairs] = np.nanmedian(np.where(both, distances, np.nan)[:, pairs], axis=0)
    off = np.where(both, np.abs(distances - usual), 0.0).sum(axis=(1, 2))
    count = seen.sum(axis=1)
    best = np.flatnonzero(count == count.max())
    return int(best[np.argmin(off[best])])


def _wide(shape: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Whether the known markers of each frame span a plane, shape (n,), bool."""
    masks, which = np.unique(known, axis=0, return_inverse=True)
    result = np.zeros(len(masks), dtype=bool)
    for i, mask in enumerate(masks):
        if mask.sum() >= LEAST_MARKERS:
            own = shape[mask]
            spread = np.linalg.svd(own - own.mean(axis=0), compute_uv=False)
            result[i] = spread[0] > 0 and spread[1] >= LEAST_WIDTH * spread[0]
    return np.asarray(result[which.reshape(-1)])


def _fit(
    markers: np.ndarray, shape: np.ndarray, known: np.ndarray
) -> tuple[np.ndarray, np.ndarray, tuple[np.ndarray, np.ndarray]]:
    """Rotations of the shape to each frame, RMS residuals, and the middles in world and shape.

    Args:
        markers: Shape (n, k, 3) [m].
        shape: Shape (k, 3) [m].
        known: Which to use, shape (n, k), at least three a frame.

    Returns:
        R_world_from_cluster, shape (n, 3, 3); residuals, shape (n,) [m]; middles, shapes (n, 3).
    """
    weights = known.astype(float)
    count = weights.sum(axis=1, keepdims=True)
    world = np.where(known[..., None], markers, 0.0)
    own = np.where(known[..., None], shape[None], 0.0)
    middles = world.sum(axis=1) / count, own.sum(axis=1) / count
    world = (world - middles[0][:, None]) * weights[..., None]
    own = (own - middles[1][:, None]) * weights[..., None]
    matrices = rotation.nearest_rotation(np.einsum("nki,nkj->nij", world, own))
    off = world - np.einsum("nij,nkj->nki", matrices, own)
    return matrices, np.sqrt(np.sum(off**2, axis=(1, 2)) / count[:, 0]), middles
