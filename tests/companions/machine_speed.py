"""How fast this machine is at the moment, beside the one that the figures of the documents are from."""

import time

import numpy as np

# The processor time of what `slowness` does there, on an AMD EPYC without other work: median of 20 [s].
THERE = 0.145


def slowness() -> float:
    """How many times as long as there small linear algebra takes here and now.

    Processor time grows too where processes share a core's caches.
    """
    symmetric = np.array([[2.0, 1.0], [1.0, 3.0]])
    begun = time.process_time()
    for _ in range(20_000):
        np.linalg.inv(symmetric)
        np.linalg.slogdet(symmetric)
    return (time.process_time() - begun) / THERE
