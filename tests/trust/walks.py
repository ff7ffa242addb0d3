"""Random walks over agents, loop by loop, for the models that pass trust on."""

Vector = list[float]
Matrix = list[Vector]


def numbers(peers: Matrix) -> tuple[list[int], list[int], int]:
    """The number of the agent of each rater and of each provider, and how many agents there are."""
    raters = list(range(len(peers)))
    providers, fresh = [], len(raters)
    for j in range(len(peers[0])):
        same = [i for i in raters if peers[i][j]]
        providers.append(same[0] if same else fresh)
        fresh += not same
    return raters, providers, fresh


def links(scores: Matrix, peers: Matrix) -> Matrix:
    """Who is connected with whom, agent by agent, without what an agent thinks of itself."""
    raters, providers, n = numbers(peers)
    found = [[0.0] * n for _ in range(n)]
    for i, rater in enumerate(raters):
        for j, provider in enumerate(providers):
            if rater != provider:
                found[rater][provider] = scores[i][j]
    return found


def walk(weights: Matrix, start: Vector, a: float) -> Vector:
    """The power iteration, until nothing moves."""
    n = len(start)
    rows = [[w / sum(row) for w in row] if sum(row) else [1 / n] * n for row in weights]
    v, moved = start, 1.0
    while moved > 1e-14:
        after = [
            (1 - a) * sum(v[i] * rows[i][j] for i in range(n)) + a * start[j] for j in range(n)
        ]
        v, moved = after, max(abs(new - old) for new, old in zip(after, v, strict=True))
    return v


def published(v: Vector, peers: Matrix) -> tuple[Vector, Vector]:
    """The shares of the largest, of the raters and of the providers."""
    raters, providers, _ = numbers(peers)
    return [v[k] / max(v) for k in raters], [v[k] / max(v) for k in providers]
