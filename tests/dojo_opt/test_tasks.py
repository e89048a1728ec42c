"""Closed-loop tasks: their references, the quadruped in closed loop, the command line, the figures."""

import json

import numpy as np
import pytest

import dojo_opt as dojo
from dojo_opt.__main__ import main
from dojo_opt.plant.monte_carlo import MonteCarlo, MonteCarloRun


@pytest.fixture(scope="module")
def quadruped():
    mpc = dojo.tasks.quadruped_mpc()
    plant = dojo.tasks.plant(mpc, 4e-3, payload=3.0, friction=0.4, pushes=[dojo.Push(0.2, (0.0, 4.0, 0.0))])
    return mpc, dojo.closed_loop(mpc, plant, 1.0)


def test_hopping_reference_is_consistent():
    """Its velocities are the derivatives of its coordinates, it flies freely, and its foot stands in stance."""
    hopping = dojo.tasks.Hopping(dojo.tasks.hopper_mpc().start, (0.3, -0.1), 0.25, 0.2)
    t = np.linspace(0.0, 3.0, 3001)
    x = hopping(t)
    slope = (hopping(t + 1e-6) - hopping(t - 1e-6)) / 2e-6
    away = np.abs(np.mod(t + 1e-3, hopping.period) - 1e-3) > 1e-4
    away &= np.abs(np.mod(t, hopping.period) - hopping.stance) > 1e-4
    np.testing.assert_allclose(x[away][:, 8:11], slope[away][:, :3], atol=1e-6)
    np.testing.assert_allclose(x[away][:, 14], slope[away][:, 7], atol=1e-6)
    sim = dojo.tasks.hopper_mpc().sim
    foot = sim.maximal(x)[:, 1]
    stands = np.mod(t, hopping.period) < hopping.stance
    lap = np.floor(t / hopping.period)
    middle = hopping.velocity * (lap * hopping.period + 0.5 * hopping.stance)[:, None]
    np.testing.assert_allclose(foot[stands, :2], middle[stands], atol=1e-12)
    np.testing.assert_allclose(foot[stands, 2], 0.05, atol=1e-12)
    assert foot[:, 2].max() == pytest.approx(0.05 + 0.25, abs=1e-4)
    turn = sim.difference(hopping(t + 1e-6), hopping(t - 1e-6))[:, 3:6] / 2e-6
    np.testing.assert_allclose(x[away][:, 11:14], turn[away], atol=1e-5)
    leaning = hopping.start.copy()
    leaning[3:5] = np.cos(0.1), np.sin(0.1)
    with pytest.raises(ValueError, match="upright body"):
        dojo.tasks.Hopping(leaning, (0.0, 0.0), 0.25, 0.2)


@pytest.mark.slow
@pytest.mark.parametrize("perturbation", [{}, {"friction": 0.25}], ids=["nothing", "half the friction"])
def test_hopper_keeps_to_all_that_is_tracked(perturbation):
    """With height, which the distance along the ground does not include: to 20 mm."""
    mpc = dojo.tasks.hopper_mpc(velocity=(0.2, 0.0), height=0.25)
    loop = dojo.closed_loop(mpc, dojo.tasks.plant(mpc, **perturbation), 4.0)
    each = loop.by_coordinate()
    assert set(each) == {"body x", "body y", "body z", "body rx", "body ry", "body rz", "leg"}
    assert loop.rms() == pytest.approx(np.sqrt(sum(value**2 for value in each.values())))
    assert loop.rms() <= 0.020, each
    assert loop.x[1000:, 2].max() == pytest.approx(0.8, abs=0.01)


def test_the_reference_of_a_loop_is_where_the_ground_was_learnt_to_be():
    mpc = dojo.tasks.quadruped_mpc()
    loop = dojo.closed_loop(mpc, dojo.tasks.plant(mpc, 4e-3, slope=0.1), 1.5)
    level = mpc.references.state(loop.time)
    assert loop.reference(loop.time)[-1, 2] - level[-1, 2] > 0.01
    assert loop.by_coordinate()["trunk z"] < 0.01


def test_quadruped_trots_under_load_on_slippery_ground_and_pushed(quadruped):
    mpc, loop = quadruped
    assert loop.survived, loop.message
    assert loop.rms((0, 1, 2)) < 0.06
    assert loop.x[-1, 0] - loop.x[0, 0] > 0.15
    heights = loop.contacts.gap  # it steps: every foot has been up and down
    assert np.all(heights.max(axis=0) > 0.02) and np.all(heights.min(axis=0) < 2e-3)
    assert len(mpc.log) == 25
    assert np.abs(loop.u[:, :12]).max() <= 33.5 + 1e-9


def test_plans_count_on_less_friction_than_the_plant_has(quadruped):
    """The model's forces stay inside the narrower cone; the robot and its plant keep the friction of their feet."""
    mpc, _ = quadruped
    plan = mpc.sim.rollout(mpc.policy.x[0], mpc.policy.u).contacts
    assert np.linalg.norm(plan.impulse[..., :2], axis=-1).max() > 0.1
    assert np.all(np.linalg.norm(plan.impulse[..., :2], axis=-1) <= 0.4 * plan.impulse[..., 2] + 1e-6)
    assert {c.friction for c in dojo.tasks.plant(mpc, 4e-3).simulator.mechanism.contacts} == {0.8}
    wide = dojo.tasks.quadruped_mpc(friction=0.8)
    assert {c.friction for c in wide.sim.mechanism.contacts} == {0.8}


def test_quadruped_learns_the_slope_it_walks_up():
    for learn in (True, False):
        mpc = dojo.tasks.quadruped_mpc(learn_ground=learn)
        loop = dojo.closed_loop(mpc, dojo.tasks.plant(mpc, 4e-3, slope=0.1), 1.0)
        assert loop.survived
        feet = mpc._ground.points(loop.x[-1])
        true = np.tan(0.1) * feet[:, 0]  # at x > 0 the ground is higher
        believed = mpc._ground.height
        worst = np.abs(believed - true).max()
        assert worst < 0.015 if learn else worst > 0.015


@pytest.mark.parametrize("knows", [False, True])
def test_quadruped_trots_over_a_bump(knows):
    """Blind, it learns the height from the feet that stand; its trunk follows the ground either way."""
    bump = dojo.Terrain.from_function(
        lambda x, y: 0.04 * np.exp(-(((x - 0.45) / 0.2) ** 2)) + 0.0 * y, np.arange(-1.0, 1.5, 0.05), [0.0]
    )
    mpc = dojo.tasks.quadruped_mpc(terrain=bump if knows else None)
    plant = dojo.tasks.plant(mpc, 4e-3, **({} if knows else {"terrain": bump}))
    loop = dojo.closed_loop(mpc, plant, 1.6)
    assert loop.survived, loop.message
    assert loop.rms((0, 1, 2)) < 0.06
    assert loop.x[-1, 2] - loop.x[0, 2] > 0.01
    assert loop.contacts.gap.min() > -1e-4


def test_command_line_runs_a_task(tmp_path, capsys):
    out, html = tmp_path / "loop.png", tmp_path / "loop.html"
    arguments = ["run", "hopper_mpc", "--seconds", "0.3", "--perturb", "payload=1.0", "--set", "substeps=2"]
    assert main([*arguments, "--plot", str(out), "--html", str(html)]) == 0
    assert "Ran to the end." in capsys.readouterr().out
    assert out.stat().st_size > 10_000 and html.stat().st_size > 100_000
    assert main([*arguments, "--json"]) == 0
    numbers = json.loads(capsys.readouterr().out)
    assert numbers["survived"] and numbers["ticks"] == 6 and len(numbers["x"]) == 301
    assert main(["run", "hopper_mpc", "--seconds", "2", "--perturb", "pushes=3"]) == 2
    assert main(["run", "hopper_mpcs"]) == 2
    fell = ["run", "hopper_mpc", "--seconds", "1.5", "--perturb", "payload=12.0", "--set", "substeps=2"]
    assert main(fell) == 1


def test_figures_show_the_motion(quadruped):
    mpc, loop = quadruped
    figure = dojo.plots.closed_loop(loop)
    axes = figure.axes
    assert len(axes) == 4
    np.testing.assert_array_equal(axes[0].lines[0].get_ydata(), loop.x[:, 2])
    np.testing.assert_array_equal(axes[2].lines[0].get_xdata(), loop.x[:, 0])
    dots = axes[3].lines[0].get_ydata()
    np.testing.assert_array_equal(dots, [t.milliseconds for t in loop.log[1:]])
    medians = [
        line for line in dojo.plots.tick_times(loop.log, period=mpc.period).lines if "period" in line.get_label()
    ]
    assert medians[0].get_ydata()[0] == pytest.approx(40.0)


def test_figure_of_survival_steps_down_at_every_fall():
    def outcome(survived, duration):
        return MonteCarloRun(survived, "", duration, 0.0, np.zeros(1), (), dojo.Perturbation(), 0)

    study = MonteCarlo([outcome(False, 1.0), outcome(True, 4.0), outcome(False, 2.0), outcome(True, 4.0)], 4.0, 0)
    line = dojo.plots.survival({"all": study}).lines[0]
    np.testing.assert_allclose(line.get_xdata(), [0.0, 1.0, 2.0, 4.0])
    np.testing.assert_allclose(line.get_ydata(), [1.0, 0.75, 0.5, 0.5])
    assert len(dojo.plots.study(study).axes) == 2
    with pytest.raises(TypeError, match=r"plots.closed_loop\(result\): expected a ClosedLoop, got a? ?MonteCarlo"):
        dojo.plots.closed_loop(study)
    assert study.interval[0] < 0.5 < study.interval[1]
