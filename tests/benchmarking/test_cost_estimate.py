"""Estimated cost of a run, also in scenarios without an agent of the name sr_0."""

import pytest
from small_suites import small

from roletrust_env.benchmarking import cost
from roletrust_env.benchmarking.cells import play_cell
from roletrust_env.benchmarking.cost import estimate_cost


def test_the_time_is_that_of_attacks_side_by_side(monkeypatch) -> None:
    """One attack alone takes some times longer for each game; a run plays its attacks in
    batches."""
    suite, batches = small(models=["mean"], methods=["scripted"], games=2), []

    def played(task, attacker, batch, *random):
        batches.append(batch)
        clock[0] += 1 + 0.5 * batch[0]
        return ()

    clock = [0.0]
    monkeypatch.setattr(cost, "judged_rollout", played)
    monkeypatch.setattr(cost, "process_time", lambda: clock[0])
    cell = next(cell for cell in suite.cells() if cell.method == "scripted")
    seconds = cost.estimate_seconds(suite, [cell])[cell.key]
    assert set(batches) == {(1, 2), (8, 2)}
    assert seconds == pytest.approx(5 / 8 / 4 / 2 * sum(cost.round_counts(suite, cell)))


@pytest.mark.parametrize(
    "tracks", [{"honest": {}}, {"honest": {}, "raters": {"roles": ["SR"], "shares": [0.3]}}]
)
def test_the_estimate_is_an_upper_bound_of_the_rounds(tracks: dict) -> None:
    scenario = {"preset": "peers" if len(tracks) == 1 else "paper-3x3", "set": {"max_cycles": 5}}
    suite = small(
        models=["mean"], scenarios={"world": scenario}, tracks=tracks, methods=["scripted"], games=2
    )
    (cost,) = estimate_cost(suite, suite.cells()).values()
    played = sum(play_cell(suite, cell).env_steps for cell in suite.cells())
    assert cost.env_steps >= played > 0
