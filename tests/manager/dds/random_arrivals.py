"""Random arrivals of messages, as on a real network."""


def arrivals(random, streams, rounds=12, period=500):
    """Return pairs (stream, stamp) in order of arrival.

    Messages are lost, late, duplicated or out of order, and streams may stop.
    """
    lost, late, doubled = random.choice([0.0, 0.1, 0.4], 3)
    jitter = float(random.choice([0, 5, 100, 400]))
    stops = random.integers(2, 4 * rounds, streams)
    sent = []
    for round in range(rounds):
        for stream in range(streams):
            if random.random() < lost or round >= stops[stream]:
                continue
            stamp = int(round * period + random.uniform(0, jitter))
            for _ in range(1 + (random.random() < doubled)):
                delay = random.exponential(20) + (
                    random.uniform(0, 3 * period) if random.random() < late else 0
                )
                sent.append((stamp + delay, stream, stamp))
    return [(stream, stamp) for _, stream, stamp in sorted(sent)]
