"""Single steps that were hard: each was missed by some form of the interior point and is solved by the reference."""

import numpy as np
import pytest
from naive import rotation as rot

import dojo_opt as dojo
from support.benchmark import loaded
from support.scenes import ball, block, gaps

# cells of benchmarks/robustness.py at seed 0: mechanism, friction, time step, kappa, number of the state
CELLS = (
    ("block", 0.5, 0.02, 1e-8, 4),
    ("block", 0.5, 0.05, 1e-8, 97),
    ("block", 1.0, 0.05, 1e-8, 112),
    ("block", 2.0, 0.02, 1e-8, 145),
    ("block", 2.0, 0.05, 1e-4, 135),
    ("block", 2.0, 0.05, 1e-8, 85),
    ("hopper", 0.5, 0.05, 1e-8, 36),
    ("hopper", 1.0, 0.05, 1e-8, 11),
    ("hopper", 2.0, 0.05, 1e-4, 20),
    ("hopper", 2.0, 0.05, 1e-8, 134),
    ("quadruped", 0.0, 0.05, 1e-8, 90),
    ("quadruped", 1.0, 0.02, 1e-4, 109),
    ("quadruped", 2.0, 0.02, 1e-4, 130),
    ("quadruped", 2.0, 0.05, 1e-4, 45),
    ("quadruped", 2.0, 0.05, 1e-4, 113),
    ("quadruped12", 0.5, 0.05, 1e-8, 68),
    ("quadruped12", 1.0, 0.05, 1e-4, 151),
    ("quadruped12", 2.0, 0.01, 1e-4, 73),
    ("quadruped12", 2.0, 0.01, 1e-8, 73),
    ("quadruped12", 2.0, 0.02, 1e-4, 79),
    ("quadruped12", 2.0, 0.02, 1e-8, 79),
    ("quadruped12", 2.0, 0.05, 1e-4, 68),
)


def thrown(sim, start):
    """The neutral state with the random velocity of a fall of benchmarks/falls.py."""
    x = sim.neutral()
    x[sim.nq :] += np.random.default_rng(start).normal(size=sim.nv)
    return x


@pytest.fixture(scope="module")
def robustness():
    yield from loaded("robustness")


@pytest.mark.sweep(3)
@pytest.mark.parametrize("cell", CELLS, ids=str)
def test_extreme_state(robustness, cell):
    name, friction, h, kappa, number = cell
    sim = dojo.Simulator(robustness.MECHANISMS[name](friction), time_step=h, kappa=kappa)
    rng = np.random.default_rng([0, list(robustness.MECHANISMS).index(name), round(1e4 * h)])
    states = [robustness.random_state(sim, rng) for _ in range(number + 1)]
    result = sim.step(states[-1], np.zeros(sim.nu))
    assert result.status == 0, (result.status, result.residual, result.violation)


@pytest.mark.parametrize("kappa", [1e-4, 1e-8])
@pytest.mark.parametrize("number", [67, 155])
def test_extreme_state_with_solutions_that_gain_energy(robustness, number, kappa):
    """They were accepted with 2 to 5 times the energy before the step; the motion loses some, in finer steps."""
    sim = dojo.Simulator(robustness.MECHANISMS["quadruped"](0.0), time_step=0.05, kappa=kappa)
    rng = np.random.default_rng([0, list(robustness.MECHANISMS).index("quadruped"), 500])
    x = [robustness.random_state(sim, rng) for _ in range(number + 1)][-1]
    assert sim.replace(divide=False).step(x, np.zeros(sim.nu)).status == dojo.Status.ENERGY_GAIN
    assert sim.energy(sim.step(x, np.zeros(sim.nu), throw=True).x) < sim.energy(x)
    finer = sim.replace(time_step=0.05 / 32)
    start = finer.state_from_velocity(x[: sim.nq], sim.velocity(x))
    motion = finer.rollout(start, np.zeros((32, sim.nu)), throw=True)
    assert finer.energy(motion.x[-1]) < finer.energy(start)


@pytest.mark.parametrize("kappa", [1e-4, 1e-6, 1e-8, 1e-9])
def test_ball_that_slides_and_rolls(kappa):
    """One contact, a light rotation, a short time step: the friction impulse changes with the slip within microns."""
    sim = dojo.Simulator(ball(radius=0.1), time_step=1e-3, kappa=kappa)
    turn = [0.9999995822338908, -0.00040878650762314687, 0.0008175730152462937, 0.0]
    twist = [0.9780642091129923, 0.4890321045564965, -7.6e-8, -0.2741973860875901, 0.5483947721751802, 0.0]
    assert sim.step(np.r_[0.0, 0.0, 0.10000010194137329, turn, twist], np.zeros(6)).status == 0


@pytest.mark.parametrize("kappa", [1e-4, 1e-6, 1e-8])
@pytest.mark.parametrize("time_step", [1e-3, 2e-3, 5e-3, 1e-2, 2e-2, 5e-2])
def test_tumbling_block_for_a_second(time_step, kappa):
    """Every step of a block that is thrown and comes to rest."""
    sim = dojo.Simulator(block(), time_step=time_step, kappa=kappa, tolerance=1e-9)
    q = np.r_[0.0, 0.0, 1.0, rot.exp(np.array([0.4, -0.3, 0.8]))]
    trajectory = sim.rollout(np.r_[q, 2.0, 1.0, -1.0, 3.0, -2.0, 1.0], np.zeros((round(1.0 / time_step), 0)))
    assert trajectory.status == 0, trajectory.message
    assert gaps(sim, trajectory.x[-1]).min() > -1e-8


@pytest.mark.parametrize("kappa", [3e-3, 1e-3, 1e-4, 1e-6])
def test_foot_between_sticking_and_sliding(kappa):
    """A knot of a planned trot, one foot at the edge of its cone: Newton's method went to and fro between two slips."""
    sim = dojo.problems.trot(speed=0.41, damping=0.3).sim.replace(kappa=kappa)
    pose = [0.107, -0.003, 0.295, *rot.exp(np.array([0.004, 0.002, -0.002]))]
    legs = [0.023, 0.796, -1.665, 0.017, 0.889, -1.8, 0.013, 1.215, -1.729, 0.02, 1.067, -1.546]
    rates = [0.024, 1.49, -0.141, -0.076, -5.331, -1.648, 0.018, -2.311, -5.096, 0.04, 0.868, 0.81]
    torques = [-1.0, -3.47, 6.03, -0.17, -3.72, 1.29, 0.43, -3.84, -0.69, -0.17, 7.09, 10.59]
    result = sim.step(np.array([*pose, *legs, 0.421, -0.013, 0.009, 0.01, 0.028, 0.007, *rates]), np.array(torques))
    assert result.status == 0, result.status
    assert result.iterations <= 100


@pytest.mark.parametrize("kappa", [None, 1e-10])
def test_a_walker_lands_at_a_stop_of_its_knee(kappa):
    """The second-order term of the predictor cancelled the product of a joint limit: Newton's steps were zero."""
    sim = dojo.Simulator(dojo.models.walker(), time_step=0.02, kappa=kappa)
    sim.rollout(thrown(sim, 1), np.zeros((50, sim.nu)), throw=True)


@pytest.mark.parametrize("time_step, pitches", [(0.005, (0.1, 0.12, 0.2)), (0.01, (0.11, 0.14)), (0.02, (0.16, 0.21))])
def test_legs_that_jam_between_a_joint_limit_and_the_ground(time_step, pitches):
    sim = dojo.Simulator(dojo.models.walker(), time_step=time_step)
    for pitch in pitches:
        x = sim.neutral()
        x[2] += pitch
        sim.rollout(x, np.zeros((round(0.7 / time_step), sim.nu)), throw=True)


@pytest.mark.parametrize("name, start, knot", [("walker", 5, 1), ("twister", 5, 50)])
def test_friction_that_follows_the_impulses_from_a_large_kappa(name, start, knot):
    """Falls that ended where the friction of all but the first attempts was led down step by step."""
    sim = dojo.Simulator(getattr(dojo.models, name)(), time_step=0.02, kappa=1e-10 if name == "walker" else 1e-6)
    sim.rollout(thrown(sim, start), np.zeros((knot, sim.nu)), throw=True)


@pytest.mark.parametrize("kappa", [None, 1e-6, 1e-10])
@pytest.mark.parametrize("start, ends", [(2, dojo.Status.ENERGY_GAIN), (3, dojo.Status.SOLVED)])
def test_joints_give_no_energy(start, ends, kappa):
    """Atlas falls on its feet with 2 kJ. In one step, joints and friction wound one another up to 70 kJ and more.

    The third start has another solution too. The second has none with 10 ms, but has one with half of it.
    """
    sim = dojo.Simulator(dojo.models.atlas(), time_step=0.01, kappa=kappa)
    fall = sim.replace(divide=False).rollout(thrown(sim, start), np.zeros((100, sim.nu)))
    assert fall.status == ends, fall.message
    assert np.diff(sim.energy(fall.x)).max() < 1.0  # [J]
    whole = sim.rollout(thrown(sim, start), np.zeros((100, sim.nu)), throw=True)
    assert np.diff(sim.energy(whole.x)).max() < 1.0
    half = sim.replace(time_step=0.005)
    then = half.rollout(fall.x[-1], np.zeros((2, sim.nu)), throw=True)
    assert half.energy(then.x[-1]) < half.energy(fall.x[-1]) + 1.0
