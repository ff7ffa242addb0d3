"""Faulty models and attackers, and a run that tests can kill: `python
benchmark_cases.py FILE`."""

import os
import signal
import sys
import time
from pathlib import Path

import numpy as np
from small_suites import tiny

from roletrust_env import Policy
from roletrust_env.benchmarking.pool import LocalPool
from roletrust_env.benchmarking.store import ResultStore
from roletrust_env.trust.models.central.means import Mean


def results(stored):
    """Return the results by key, without the seconds, which differ between runs."""
    return {cell.key: result._replace(seconds=0.0) for cell, result in stored}


class _Faulty(Mean):
    """Mean that misbehaves from the second round on."""

    def update(self, state, ratings):
        self.misbehave()
        return super().update(state, ratings)

    def misbehave(self):
        pass


class Hanging(_Faulty):
    def misbehave(self):
        time.sleep(1000)


class Raising(_Faulty):
    def misbehave(self):
        raise RuntimeError("two\nlines")


class Leaving(_Faulty):
    def misbehave(self):
        sys.exit(3)


class Dying(_Faulty):
    def misbehave(self):
        os.kill(os.getpid(), signal.SIGKILL)


class NotANumber(Mean):
    def provider_trust(self, state):
        return super().provider_trust(state) * np.nan


class TooMuch(Mean):
    def provider_trust(self, state):
        return super().provider_trust(state) + 1


class WildRater(Policy):
    attacks = frozenset({"ratings"})

    def ratings(self, view, memory, random):
        return view.service + 2, memory


class NanRater(WildRater):
    def ratings(self, view, memory, random):
        return view.service * np.nan, memory


class BrokenRater(WildRater):
    def ratings(self, view, memory, random):
        raise ZeroDivisionError("by nothing")


def run(path):
    """Play the cells that are not stored yet, and store them."""
    suite = tiny(methods=["scripts", "search"])
    with ResultStore(path, suite) as store:
        remaining = [cell for cell in suite.cells() if cell.key not in store.finished_keys()]
        for cell, result in LocalPool(2).play(suite, remaining):
            store.add(cell, result)
        return store.all()


if __name__ == "__main__":
    run(Path(sys.argv[1]))
