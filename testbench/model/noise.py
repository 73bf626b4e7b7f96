"""Random processes of inertial sensors, drawn in a stream.

The same numbers come out however the stream is cut into chunks.
"""

from __future__ import annotations

import hashlib

import numpy as np
from scipy.signal import lfilter


def random_stream(seed: int, *labels: str) -> np.random.Generator:
    """An independent generator for one purpose, named by labels.

    Adding a purpose changes no other's numbers.
    """
    digest = hashlib.sha256("\0".join(labels).encode()).digest()
    key = tuple(int.from_bytes(digest[i : i + 4], "little") for i in range(0, 16, 4))
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=key))


class GaussMarkov:
    """First-order Gauss-Markov process, stationary from the start (Maybeck 1979, section 4.11).

    Args:
        sd: Standard deviation, in any unit.
        time_constant: Of the correlation [s].
        interval: Between samples [s].
        columns: Independent copies.
        rng: Source of randomness.
    """

    def __init__(
        self,
        sd: float,
        time_constant: float,
        interval: float,
        columns: int,
        rng: np.random.Generator,
    ):
        self.decay = float(np.exp(-interval / time_constant))
        self.step = sd * np.sqrt(1 - self.decay**2)
        self.rng, self.columns, self.active = rng, columns, sd > 0
        self.state = self.decay * sd * rng.standard_normal((1, columns))

    def draw(self, n: int) -> np.ndarray:
        """The next n values, shape (n, columns)."""
        if not self.active or n == 0:  # lfilter forgets its state over an empty input
            return np.zeros((n, self.columns))
        noise = self.step * self.rng.standard_normal((n, self.columns))
        values, self.state = lfilter([1.0], [1.0, -self.decay], noise, axis=0, zi=self.state)
        return np.asarray(values)


class RandomWalk:
    """Sum of white noise; its standard deviation grows with the square root of time.

    Args:
        density: Standard deviation after one second, in any unit.
        interval: Between samples [s].
        columns: Independent copies.
        rng: Source of randomness.
    """

    def __init__(self, density: float, interval: float, columns: int, rng: np.random.Generator):
        self.step, self.columns, self.rng = density * np.sqrt(interval), columns, rng
        self.state = np.zeros((1, columns))

    def draw(self, n: int) -> np.ndarray:
        """The next n values, shape (n, columns)."""
        if self.step == 0 or n == 0:
            return np.zeros((n, self.columns))
        noise = self.step * self.rng.standard_normal((n, self.columns))
        values, self.state = lfilter([1.0], [1.0, -1.0], noise, axis=0, zi=self.state)
        return np.asarray(values)
