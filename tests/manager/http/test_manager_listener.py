"""The agents of a trust manager on the page of a live team."""

import time

from refusals import refuses

from roletrust_manager.http.client import TrustClient
from roletrust_manager.http.manager_listener import ManagerListener
from roletrust_manager.page.dashboard import Dashboard


def rounds(listener, number):
    """Wait for a number of rounds."""
    end = time.monotonic() + 60
    while len(listener.rounds) < number:
        assert time.monotonic() < end
        time.sleep(0.01)
    return list(listener.rounds)


def test_the_page_shows_rounds_as_they_end(ann, url, clock, tmp_path):
    listener = ManagerListener(url)
    dashboard = Dashboard(listener, listener.period_s)
    with TrustClient(url, "bob", tmp_path / "keys") as bob:
        assert "No round yet" in dashboard.parts().state
        ann.rate("bob", 4.6)
        bob.rate("ann", 2)
        clock.late += 600
        ann.rate("bob", 4.6)
        (first,) = rounds(listener, 1)
        assert first[0] == 1
        assert first.missing == ()
        assert first.top == {name: ann.ask(name).provider.trust for name in ("ann", "bob")}
        assert first.tor == {name: ann.ask(name).rater.trust for name in ("ann", "bob")}
        with refuses(ValueError, "ann", "zoe"):
            ann.rate("zoe", 1)
        clock.late += 600
        ann.about()
    assert rounds(listener, 2)[1].missing == ("bob",)
    listener._publish(2, 0.0)  # as when it is connected again
    assert len(listener.rounds) == 2
    dashboard._parts_at = 0.0
    parts = dashboard.parts()
    assert "missing: bob" in parts.state
    assert "<td>unknown provider</td><td>1</td><td>manager</td>" in parts.refused
    assert ">ann</th>" in parts.raters
    assert "silent since" in dashboard._make_parts(time.monotonic() + 2 * listener.period_s).state
    dashboard.close()
