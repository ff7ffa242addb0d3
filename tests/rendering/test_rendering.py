"""Renderings: what they show, that they only read, and that they work with and without matplotlib
and a display."""

import copy
import sys
import warnings

import numpy as np
import pytest
from gymnasium.error import DependencyNotInstalled
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from pettingzoo.test.render_test import render_test
from refusals import refuses

from roletrust_baselines import BadMouthing, OnOff
from roletrust_env import Player, Policy, Scenario, env, parallel_env, scenarios
from roletrust_env.rendering.drawing import Canvas, Picture
from roletrust_env.rendering.renderer import Renderer
from roletrust_env.rendering.scene import make_scene
from roletrust_env.rendering.text import as_text
from roletrust_env.world.group import AgentGroup

PRESETS = [name for name in scenarios() if "hog" not in name and name != "city"]
LIARS = {"sr_2": BadMouthing(level=0.5)}


def play(name, rounds, policies=None, mode="rgb_array", seed=3, **changes):
    """An environment after some rounds."""
    policies = policies or {}
    game = parallel_env(name, render_mode=mode, **changes)
    observations, _ = game.reset(seed=seed, options={"attackers": tuple(policies)})
    players = {
        a: Player(policies.get(a, Policy()), a, game.layout, seed=1) for a in game.possible_agents
    }
    for _ in range(rounds):
        observations, *_ = game.step({a: players[a](observations[a]) for a in game.agents})
    return game


def scene_of(game):
    return make_scene(game.game, game._state, game.attackers)


@pytest.mark.parametrize("name", ["paper-3x3", "open-system"])
@pytest.mark.filterwarnings("ignore:render_mode 'human' shows nothing")
def test_pettingzoo_render_test(name):
    render_test(lambda render_mode=None: env(name, render_mode=render_mode))


@pytest.mark.parametrize("name", PRESETS)
def test_picture_changes_with_the_game_and_its_size_does_not(name):
    game = play(name, 0)
    before = game.render()
    assert before.dtype == np.uint8
    assert before.shape == (720, 1280, 3)
    game.step({a: np.full(game.action_space(a).shape, 0.5, np.float32) for a in game.agents})
    after = game.render()
    assert after.shape == before.shape
    assert (after != before).any()


def test_a_frame_is_the_callers_own_and_the_same_state_gives_the_same_frame():
    game = play("paper-3x3", 2)
    first = game.render()
    kept = first.copy()
    first[:] = 0
    np.testing.assert_array_equal(game.render(), kept)


def test_a_frame_does_not_depend_on_the_frames_before_it():
    often = play("robots-that-move", 0)
    once = play("robots-that-move", 0)
    for _ in range(5):
        for game in (often, once):
            game.step(
                {a: np.full(game.action_space(a).shape, 0.7, np.float32) for a in game.agents}
            )
        frame = often.render()
    np.testing.assert_array_equal(frame, once.render())


@pytest.mark.parametrize("name", ["peers", "crowd-100x100"])
def test_a_frame_is_the_whole_picture_though_only_what_moves_is_drawn_anew(name):
    game = play(name, 12, {parallel_env(name).possible_agents[2]: BadMouthing()})
    whole = FigureCanvasAgg(Figure((12.8, 7.2), 100))
    scene = scene_of(game)
    picture = Picture(whole.figure, game.game.scenario, scene)
    picture.update(scene, game._spectator.curves)
    whole.draw()
    difference = np.abs(np.asarray(whole.buffer_rgba())[..., :3].astype(int) - game.render())
    assert (difference.max(-1) > 60).mean() < 1e-3  # grid lines and spines may lie above or below


def vermilion(frame):
    return int((frame == (0xD5, 0x5E, 0x00)).all(-1).sum())


@pytest.mark.parametrize("name", ["paper-3x3", "crowd-100x100"])
def test_attackers_are_marked(name):
    game = play(name, 2)
    honest = game.render()
    game.reset(seed=3, options={"attackers": ("sr_2",)})
    marked = game.render()
    assert vermilion(honest) == 0
    assert vermilion(marked) > 30
    game.reset(seed=3)
    assert vermilion(game.render()) == 0


def test_absent_agents_look_different():
    game = play("open-system", 45, {"sp_1": OnOff()})
    scene = scene_of(game)
    assert set(scene.raters.absences + scene.providers.absences) == {
        "",
        "waiting",
        "left",
        "cut off",
    }
    everyone = scene._replace(
        raters=scene.raters._replace(absences=("",) * len(scene.raters.absences))
    )
    canvas = Canvas(game.game.scenario)
    canvas.draw(scene, game._spectator.curves)
    shown = canvas.frame()
    canvas.draw(everyone, game._spectator.curves)
    assert (canvas.frame() != shown).any()


def test_perturbation_is_shown_while_it_lasts():
    strength = []
    for rounds in (36, 37, 40, 41):
        scene = scene_of(play("paper-3x3", rounds))
        strength.append(scene.perturbation)
        assert ("perturbation 100%" in as_text(scene)) == (scene.perturbation == 1)
    assert strength == [0, 1, 1, 0]


def test_rendering_only_reads():
    def tree(game):
        leaves = [
            game._state.ratings,
            game._state.trust,
            game._spectator.curves,
            vars(game._random),
        ]
        return repr([game._state, leaves, game.agents])

    for mode in ("rgb_array", "ansi"):
        with np.printoptions(threshold=sys.maxsize, precision=17):
            game = play("open-system", 20, mode=mode)
            before = tree(game)
            game.render()
            assert tree(game) == before


def test_text_of_a_small_game():
    text = play("paper-3x3", 20, LIARS, "ansi", noise=0.0).render()
    lines = text.splitlines()
    assert "paper-3x3" in lines[0]
    assert "round 20 of 240" in lines[0]
    assert "10.0 s" in lines[0]
    honest, liar = (
        next(line for line in lines if line.startswith(name)) for name in ("sr_0", "sr_2")
    )
    assert honest.split()[1] == "0.59"
    assert honest.endswith("1.00  1.00  1.00")
    assert liar.split()[1:3] == ["!", "0.42"]
    assert "attacker" in liar
    assert liar.endswith("0.50  0.50  0.50")
    provider = next(line for line in lines[3:] if line.startswith("sp_1"))
    assert "0.44" in provider
    assert "quality 1.00" in provider
    assert text.count("attacker") == 1


def test_text_of_absent_agents_and_missing_ratings():
    scene = scene_of(play("open-system", 60, {"sp_1": OnOff()}, "ansi"))
    text = as_text(scene)
    assert "attacker · cut off" in text
    for name, absence in zip(scene.raters.names, scene.raters.absences, strict=True):
        line = next(line for line in text.splitlines() if line.startswith(f"{name} "))
        assert absence in line
        assert ("█" in line) == (not absence)


def test_text_of_a_large_game_is_a_summary():
    text = play("crowd-100x100", 5, LIARS, "ansi").render()
    lines = text.splitlines()
    assert len(lines) < 40
    assert max(map(len, lines)) < 100
    assert "100 of 100 raters present" in text
    assert "1 attackers" in text
    assert any(
        line.startswith("sr_2 ") and "!" in line for line in lines
    )  # it is the least trusted
    assert "10000 arrived" in text


def test_agents_with_both_roles_are_on_both_sides():
    scene = scene_of(play("robots-that-move", 5))
    assert scene.raters.names[-2:] == scene.providers.names[-2:] == ("srsp_0", "srsp_1")
    assert all("ToA" in note for note in scene.raters.captions[-2:])


@pytest.mark.parametrize(("raters", "providers"), [(1, 1), (1, 30), (21, 2)])
def test_odd_sizes(raters, providers):
    agents = (AgentGroup(role="SR", count=raters), AgentGroup(role="SP", count=providers))
    game = play(Scenario(agents=agents), 3, {"sr_0": BadMouthing()})
    assert vermilion(game.render()) > 30
    assert "sr_0" in as_text(scene_of(game))


def test_headless_window_warns_once_and_shows_nothing():
    def watch():
        game.reset(seed=1)
        for _ in range(3):
            game.step({a: game.action_space(a).sample() for a in game.agents})
            assert game.render() is None

    game = parallel_env("paper-3x3", render_mode="human")
    with pytest.warns(UserWarning, match="human") as caught:
        watch()
    assert len(caught) == 1
    game.close()
    game.close()


def test_a_renderer_that_has_drawn_can_be_copied():
    game = play("paper-3x3", 2)
    frame = game.render()
    renderer = Renderer(game.game, "rgb_array")
    renderer.render(game._state, game._spectator.curves, ())
    twin = copy.copy(renderer)
    np.testing.assert_array_equal(twin.render(game._state, game._spectator.curves, ()), frame)


@pytest.fixture
def no_matplotlib(monkeypatch):
    for module in [m for m in sys.modules if m.partition(".")[0] == "matplotlib"]:
        monkeypatch.delitem(sys.modules, module)
    monkeypatch.delitem(sys.modules, "roletrust_env.rendering.drawing", raising=False)
    monkeypatch.delattr("roletrust_env.rendering.drawing", raising=False)
    monkeypatch.setitem(sys.modules, "matplotlib", None)


@pytest.mark.parametrize("mode", ["human", "rgb_array"])
@pytest.mark.usefixtures("no_matplotlib")
def test_without_matplotlib_the_error_names_the_remedy(mode):
    game = parallel_env("paper-3x3", render_mode=mode)
    with refuses(DependencyNotInstalled, "matplotlib", "roletrust-env[cli]"):
        game.reset(seed=1) if mode == "human" else [game.reset(seed=1), game.render()]


@pytest.mark.usefixtures("no_matplotlib")
def test_text_needs_no_matplotlib():
    assert "sr_0" in play("paper-3x3", 1, mode="ansi").render()


def test_pictures_leave_matplotlibs_settings_alone():
    import matplotlib
    from matplotlib import _pylab_helpers

    matplotlib.get_backend()  # which is found when first asked for
    before = matplotlib.rcParams.copy()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        play("paper-3x3", 1).render()
    assert matplotlib.rcParams == before
    assert not _pylab_helpers.Gcf.figs
