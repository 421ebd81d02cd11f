"""Seconds per step of Newmark's average acceleration with SciPy: splu and CSR products.

Reads lines "kind size steps" (chain, grid or skew-grid, the grids being size × size), answers each with a line
"seconds of the factorisation, seconds per step".
"""

import sys
import time

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu


def stiffness(kind, size):
    """K of 2000 N/m on the diagonal of a chain, 3800 N/m of a grid, -900 N/m to each neighbour, 90 more or less
    upwards and downwards of a skew one."""
    across = 90.0 if kind == "skew-grid" else 0.0
    side = sparse.diags([-900.0 + across, -900.0 - across], [-1, 1], shape=(size, size))
    if kind == "chain":
        return side + 2000.0 * sparse.identity(size)
    one = sparse.identity(size)
    return sparse.kron(side, one) + sparse.kron(one, side) + 3800.0 * sparse.identity(size * size)


def run(kind, size, steps, dt=1e-3):
    k = stiffness(kind, size).tocsr()
    c = 1e-4 * k
    n = k.shape[0]
    begin = time.perf_counter()
    factors = splu((sparse.identity(n) + 0.5 * dt * c + 0.25 * dt * dt * k).tocsc())
    factored = time.perf_counter() - begin
    force = np.sin(np.arange(steps))
    best = np.inf
    for _ in range(3):
        x, v, a, f = (np.zeros(n) for _ in range(4))
        kept = np.empty((steps, 2))
        begin = time.perf_counter()
        for i in range(steps):
            f[0] = force[i]
            x += dt * v + 0.25 * dt * dt * a
            v += 0.5 * dt * a
            a = factors.solve(f - c @ v - k @ x)
            x += 0.25 * dt * dt * a
            v += 0.5 * dt * a
            kept[i] = x[0], x[-1]
        best = min(best, (time.perf_counter() - begin) / steps)
    return factored, best


for line in sys.stdin:
    kind, size, steps = line.split()
    print(*run(kind, int(size), int(steps)), flush=True)
