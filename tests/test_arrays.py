"""What NumPy and torch do not share."""

import subprocess
import sys

import pytest

PAGES = """
import resource
import numpy as np
import roletrust_env.arrays

def fetched():
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt

one = np.ones(25_000)
for run in range(20):
    before, parts = fetched(), [k * one for k in range(8)]
    del parts
print(fetched() - before)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="other systems keep memory in other ways")
def test_the_memory_of_freed_arrays_is_used_again() -> None:
    done = subprocess.run([sys.executable, "-c", PAGES], capture_output=True, text=True, check=True)
    assert int(done.stdout) < 50  # pages of 4 KiB; eight arrays have 390
