"""Algorithms 1 to 3 for one game, loop by loop: slow, plain, and with nothing taken from the
library.

The mean of a provider's ratings is exact (a fraction), because the square root in Algorithm 1 would
turn its last rounding error, 1e-16, into 1e-8 wherever a rater agrees with the mean.
"""

from collections.abc import Sequence
from fractions import Fraction
from math import pi, sin, sqrt

Vector = Sequence[float]
Matrix = Sequence[Vector]


def sinc(x: float) -> float:
    return sin(pi * x) / (pi * x) if x else 1.0


def rater_trust(ratings: Matrix, mask: Matrix, previous: Vector, lam: float) -> list[float]:
    raters, providers = range(len(ratings)), range(len(ratings[0]))
    averages = []
    for j in providers:
        notes = [Fraction(ratings[i][j]) for i in raters if mask[i][j]]
        averages.append(sum(notes) / len(notes) if notes else None)
    trust = list(previous)
    for i in raters:
        deviations = []
        for j in providers:
            if mask[i][j]:
                deviations.append(sqrt(abs(Fraction(ratings[i][j]) - averages[j])))
        if deviations:
            quality = 1 - sum(deviations) / len(deviations)
            trust[i] = lam * quality + (1 - lam) * previous[i]
    return trust


def provider_trust(
    ratings: Matrix,
    mask: Matrix,
    tor: Vector,
    previous: Vector,
    last: Matrix,
    elapsed: Matrix,
    lam: float,
) -> list[float]:
    raters, providers = range(len(ratings)), range(len(ratings[0]))
    trust = list(previous)
    for j in providers:
        qualities = []
        for i in raters:
            if mask[i][j]:
                delta = abs(ratings[i][j] - last[i][j]) if elapsed[i][j] else 0.0
                rho = sinc(1 - ratings[i][j]) * sinc(delta) ** elapsed[i][j]
                qualities.append(rho * tor[i] * ratings[i][j])
        if qualities:
            quality = sum(qualities) / len(qualities)
            trust[j] = lam * quality + (1 - lam) * previous[j]
    return trust


def agent_trust(
    tor: Vector, top: Vector, rated: Vector, provided: Vector, initial: float
) -> list[float]:
    trust = []
    for k in range(len(tor)):
        services = rated[k] + provided[k]
        if services:
            alpha = rated[k] / services
            trust.append(alpha * tor[k] + (1 - alpha) * top[k])
        else:
            trust.append(initial)
    return trust
