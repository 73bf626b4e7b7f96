"""Random processes of inertial sensors, drawn in a stream.

The same numbers come out however the stream is cut into chunks.
"""

from __future__ import annotations

import hashlib

import numpy as np
from numba import njit


def random_stream(seed: int, *labels: str) -> np.random.Generator:
    """An independent generator for one purpose, named by labels.

    Adding a purpose changes no other's numbers.
    """
    digest = hashlib.sha256("\0".join(labels).encode()).digest()
    key = tuple(int.from_bytes(digest[i : i + 4], "little") for i in range(0, 16, 4))
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=key))


@njit(cache=True)
def first_order(b0: float, b1: float, a1: float, x: np.ndarray, state: np.ndarray) -> np.ndarray:
    """A first-order filter of each column: y[n] = b0 x[n] + b1 x[n - 1] - a1 y[n - 1].

    In direct form II transposed (Oppenheim & Schafer, Discrete-Time Signal Processing, section
    6.3).

    Args:
        b0: Weight of the present input.
        b1: Weight of the input before.
        a1: Weight of the output before, the first coefficient of the denominator being 1.
        x: Input, shape (n, k).
        state: What the filter remembers, shape (1, k); it is left as of the last row.

    Returns:
        Shape (n, k).
    """
    y = np.empty_like(x)
    for row in range(x.shape[0]):
        for column in range(x.shape[1]):
            # transposed direct form II (as scipy.signal.lfilter): the state holds b1 x - a1 y
            y[row, column] = state[0, column] + b0 * x[row, column]
            state[0, column] = x[row, column] * b1 - y[row, column] * a1
    return y


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
        if not self.active or n == 0:
            return np.zeros((n, self.columns))
        noise = self.step * self.rng.standard_normal((n, self.columns))
        return first_order(1.0, 0.0, -self.decay, noise, self.state)


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
        return first_order(1.0, 0.0, -1.0, noise, self.state)
