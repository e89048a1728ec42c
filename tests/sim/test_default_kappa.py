"""The kappa of a simulator that is given none: 1e-9 m/s * m |g| h of the lightest part."""

import pickle
from dataclasses import replace

import numpy as np
import pytest

import dojo_opt as dojo
from sim.simulator.settings import free_parts


def test_it_follows_weight_and_time_step() -> None:
    mech = dojo.models.block(mass=2.0)
    for h in (1e-3, 0.02):
        assert dojo.Simulator(mech, time_step=h).kappa == pytest.approx(1e-9 * 2.0 * 9.81 * h, rel=1e-12)
    moon = dojo.Simulator(replace(mech, gravity=(0.0, 0.0, -1.62)), time_step=0.02)
    assert moon.kappa == pytest.approx(1e-9 * 2.0 * 1.62 * 0.02, rel=1e-12)
    nowhere = dojo.Simulator(replace(mech, gravity=(0.0, 0.0, 0.0)), time_step=0.02)
    assert nowhere.kappa == pytest.approx(1e-9 * 2.0 * 9.81 * 0.02, rel=1e-12)


def test_it_stays_between_rounding_and_soft_contact() -> None:
    assert dojo.Simulator(dojo.models.block(mass=1e-3), time_step=1e-4).kappa == 1e-13
    assert dojo.Simulator(dojo.models.block(mass=1e5), time_step=0.1).kappa == 1e-6


def test_parts_that_collide_may_carry_each_other() -> None:
    ball = dojo.models.sphere(mass=2.0)
    on_a_box = ball.with_obstacle(dojo.Box(1.0, 1.0, 1.0))
    assert dojo.Simulator(on_a_box, time_step=0.01).kappa == pytest.approx(1e-9 * 2.0 * 9.81 * 0.01, rel=1e-12)
    bodies = [dojo.Body(name, mass, shape=dojo.Sphere(0.1)) for name, mass in (("light", 1.0), ("heavy", 1e4))]
    joints = [dojo.Joint("floating", None, body.name) for body in bodies]
    for collisions, mass in (([dojo.Collision("light", "heavy")], 1e4 + 1.0), ([], 1.0)):
        mech = dojo.Mechanism(bodies, joints, collisions=collisions)
        assert dojo.Simulator(mech, time_step=0.01).kappa == pytest.approx(1e-9 * mass * 9.81 * 0.01, rel=1e-12)


def test_the_lightest_part_counts_with_all_that_hangs_on_it() -> None:
    robot, ball = dojo.models.quadruped(), dojo.models.sphere(mass=0.3)
    whole = sum(body.mass for body in robot.bodies)
    assert min(free_parts(robot)) == pytest.approx(whole)
    assert min(free_parts(robot.add(ball, pose=(1.0, 0.0, 0.0), prefix="ball/"))) == pytest.approx(0.3)
    bodies = [dojo.Body("shelf", 0.1, (1e-3,) * 3), dojo.Body("cart", 5.0, (0.1,) * 3)]
    joints = [dojo.Joint("fixed", None, "shelf"), dojo.Joint("prismatic", None, "cart")]
    assert min(free_parts(dojo.Mechanism(bodies, joints))) == 5.0  # immobile bodies do not count
    fourbar = dojo.models.fourbar()
    assert min(free_parts(fourbar)) == pytest.approx(sum(body.mass for body in fourbar.bodies))


def test_a_given_one_is_kept_and_the_rule_is_followed_again() -> None:
    mech = dojo.models.block()
    given, ruled = dojo.Simulator(mech, time_step=0.02, kappa=1e-6), dojo.Simulator(mech, time_step=0.02)
    assert given.replace(time_step=1e-3).kappa == 1e-6
    assert ruled.replace(time_step=1e-3).kappa == pytest.approx(0.05 * ruled.kappa)
    assert ruled.replace(kappa=1e-4).replace(friction=0.1).kappa == 1e-4
    assert given.replace(kappa=None).kappa == ruled.kappa
    for sim in (given, ruled):
        copied = pickle.loads(pickle.dumps(sim))
        assert copied.kappa == sim.kappa
        assert copied.replace(time_step=1e-3).kappa == sim.replace(time_step=1e-3).kappa
        assert f"kappa {sim.kappa:g} N s m" in sim.describe()


def test_parameters_change_at_the_same_kappa() -> None:
    sim = dojo.Simulator(dojo.models.block(), time_step=0.02)
    assert sim.with_parameters({"mass:*": 3.0, "time_step": 0.01}).kappa == sim.kappa


@pytest.mark.parametrize(
    ("height", "speed"), [(0.0, 0.0), (0.0, 3.0), (0.2, 1.0)], ids=["rolling", "sliding", "flying"]
)
def test_derivatives_agree_with_the_step(height: float, speed: float) -> None:
    """Central differences of the solver at its default kappa."""
    sim = dojo.Simulator(dojo.models.sphere(), time_step=0.02, tolerance=1e-12)
    x, u = sim.neutral(), np.array([0.1, -0.2, 0.1])
    x[2] += height
    x[7:10] += speed * np.array([1.0, 0.3, 0.0])
    x = sim.rollout(x, np.tile(u, (3, 1)), throw=True).x[-1]
    A, B = sim.linearize(x, u)
    size = np.abs(np.hstack([A, B])).max()

    def difference(dx: np.ndarray, du: np.ndarray) -> np.ndarray:
        ends = (sim.step(sim.integrate(x, s * dx), u + s * du, throw=True).x for s in (1e-9, -1e-9))
        return np.asarray(sim.difference(*ends)) / 2e-9

    for k, column in enumerate(np.eye(sim.ndx)):
        np.testing.assert_allclose(A[:, k], difference(column, 0.0 * u), atol=1e-5 * size, rtol=0)
    for k, column in enumerate(np.eye(sim.nu)):
        np.testing.assert_allclose(B[:, k], difference(np.zeros(sim.ndx), column), atol=1e-5 * size, rtol=0)
