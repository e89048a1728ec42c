"""Bad input is refused by an error that names the call and the culprit; nothing ever returns NaN."""

import re

import numpy as np
import pytest

import dojo_opt as dojo
from dojo_opt.planning.term import knot_list
from support.refusals import check_refused
from support.scenes import ball, block, chain, free_body, pendulum, run

BODY = dojo.Body("arm", 1.0, (1.0, 1.0, 1.0))
HINGE = dojo.Joint("revolute", None, "arm", name="hinge")


def other(name="leg"):
    return dojo.Body(name, 1.0, (1.0, 1.0, 1.0))


# fmt: off
PARTS = {
    "zero mass": (lambda: dojo.Body("arm", 0.0, (1, 1, 1)), "arm", "mass"),
    "negative mass": (lambda: dojo.Body("arm", -1.0, (1, 1, 1)), "arm", "mass", "-1"),
    "infinite mass": (lambda: dojo.Body("arm", np.inf, (1, 1, 1)), "arm", "mass", "inf"),
    "nan mass": (lambda: dojo.Body("arm", np.nan, (1, 1, 1)), "arm", "mass", "nan"),
    "zero inertia": (lambda: dojo.Body("arm", 1.0, (0, 0, 0)), "arm", "inertia"),
    "inertia not positive": (lambda: dojo.Body("arm", 1.0, np.diag([1.0, -1.0, 1.0])), "arm", "inertia"),
    "inertia not symmetric": (lambda: dojo.Body("arm", 1.0, [[1, 0.5, 0], [0, 1, 0], [0, 0, 1]]), "arm", "symmetric"),
    "inertia of no body": (lambda: dojo.Body("arm", 1.0, (1, 1, 3)), "arm", "inertia", "exceeds"),
    "inertia shape": (lambda: dojo.Body("arm", 1.0, (1, 2)), "arm", "inertia", "(3,)", "(2,)"),
    "nan inertia": (lambda: dojo.Body("arm", 1.0, (1, np.nan, 1)), "arm", "inertia", "nan", "1"),
    "no inertia": (lambda: dojo.Body("arm", 1.0), "arm", "inertia"),
    "no name": (lambda: dojo.Body("", 1.0, (1, 1, 1)), "name"),
    "unknown joint": (lambda: dojo.Joint("hinge", None, "arm"), "arm", "kind", "hinge", "revolute"),
    "name before kind": (lambda: dojo.Joint("hip", "revolute", None, "arm"), "Joint('revolute', parent, child", "hip"),
    "kind last": (lambda: dojo.Joint("base", "arm", "revolute"), "Joint('revolute', parent, child, name)", "base"),
    "zero axis": (lambda: dojo.Joint("revolute", None, "arm", axis=(0, 0, 0)), "arm", "axis"),
    "quaternion length": (lambda: dojo.Joint("revolute", None, "arm", orientation=(1, 1, 0, 0)), "arm", "orientation"),
    "point shape": (lambda: dojo.Joint("revolute", None, "arm", parent_point=(1, 2)), "arm", "parent_point", "(2,)"),
    "negative spring": (lambda: dojo.Joint("revolute", None, "arm", spring=-1.0), "arm", "spring", "-1"),
    "nan damper": (lambda: dojo.Joint("revolute", None, "arm", damper=np.nan), "arm", "damper", "nan"),
    "limits reversed": (lambda: dojo.Joint("revolute", None, "arm", limits=(1.0, -1.0)), "arm", "limits"),
    "limits equal": (lambda: dojo.Joint("revolute", None, "arm", limits=(1.0, 1.0)), "arm", "limits"),
    "limits of a ball joint": (lambda: dojo.Joint("spherical", None, "arm", limits=[(0, 1), None, None]), "limits"),
    "limits of one number": (lambda: dojo.Joint("revolute", None, "arm", limits=1.0), "arm", "limits", "(lo, hi)", "1.0"),
    "number of limits": (lambda: dojo.Joint("planar", None, "arm", limits=[(0, 1)] * 3), "arm", "limits"),
    "negative friction": (lambda: dojo.Contact("arm", friction=-0.1), "arm", "friction", "-0.1"),
    "negative radius": (lambda: dojo.Contact("arm", radius=-0.1), "arm", "radius"),
    "unknown law": (lambda: dojo.Contact("arm", law="coulomb"), "arm", "law", "coulomb", "nonlinear"),
    "zero normal": (lambda: dojo.Contact("arm", normal=(0, 0, 0)), "arm", "normal"),
    "input on nothing": (lambda: dojo.Input(), "joint", "body"),
    "input on both": (lambda: dojo.Input("hinge", body="arm"), "joint", "body"),
    "empty wrench": (lambda: dojo.Input(body="arm"), "arm", "force"),
    "complex gravity": (lambda: dojo.Mechanism([BODY], [HINGE], gravity=(0, 0, 1j)), "gravity"),
    "gravity shape": (lambda: dojo.Mechanism([BODY], [HINGE], gravity=-9.81), "gravity", "(3,)"),
    "no bodies": (lambda: dojo.Mechanism([], []), "body"),
    "no joints": (lambda: dojo.Mechanism([BODY], []), "arm", "no joint"),
    "same name": (lambda: dojo.Mechanism([BODY, BODY], [HINGE]), "arm", "twice"),
    "unknown child": (lambda: dojo.Mechanism([other()], [HINGE]), "hinge", "arm", "leg"),
    "unknown parent": (lambda: dojo.Mechanism([BODY], [dojo.Joint("fixed", "torso", "arm")]), "arm", "torso", "world"),
    "body without joint": (lambda: dojo.Mechanism([BODY, other()], [HINGE]), "leg"),
    "two joints": (lambda: dojo.Mechanism([BODY], [HINGE, dojo.Joint("fixed", None, "arm", name="b")]), "arm", "hinge"),
    "cycle": (lambda: dojo.Mechanism([BODY, other()], [dojo.Joint("revolute", "leg", "arm", name="to the arm"),
                                                       dojo.Joint("revolute", "arm", "leg", name="to the leg")]),
              "cycle", "to the arm", "to the leg"),
    "own parent": (lambda: dojo.Mechanism([BODY], [dojo.Joint("revolute", "arm", "arm", name="a")]), "a"),
    "unknown contact body": (lambda: dojo.Mechanism([BODY], [HINGE], [dojo.Contact("toe")]), "toe", "arm"),
    "unknown input joint": (lambda: dojo.Mechanism([BODY], [HINGE], inputs=[dojo.Input("elbow")]), "elbow", "hinge"),
    "input dof": (lambda: dojo.Mechanism([BODY], [HINGE], inputs=[dojo.Input("hinge", dof=1)]), "hinge", "1"),
    "not a body": (lambda: dojo.Mechanism([HINGE], [HINGE]), "bodies", "Body"),
    "nothing moves": (lambda: dojo.Mechanism([BODY], [dojo.Joint("fixed", None, "arm")]), "free to move"),
    "neutral": (lambda: dojo.Mechanism([BODY], [HINGE], neutral={"elbow": 1.0}), "neutral", "elbow", "hinge"),
    "ball without volume": (lambda: dojo.Sphere(0.0), "Sphere(radius", "0"),
    "box without volume": (lambda: dojo.Box(1.0, 1.0, 0.0), "Box(z", "0"),
    "capsule of negative length": (lambda: dojo.Capsule(0.1, -1.0), "Capsule(length", "-1"),
    "ellipsoid without volume": (lambda: dojo.Ellipsoid(0.1, 0.0, 0.2), "Ellipsoid(y", "0"),
    "cylinder without volume": (lambda: dojo.Cylinder(0.0, 1.0), "Cylinder(radius", "0"),
    "flat polytope": (lambda: dojo.Polytope([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]]), "Polytope", "no volume"),
    "polytope of three": (lambda: dojo.Polytope(np.eye(3)), "Polytope", "at least 4", "3"),
    "polytope off centre": (lambda: dojo.Body("rock", 1.0, shape=dojo.Polytope(np.vstack([np.eye(3), np.zeros(3)]))),
                            "centroid", "0.25", "about_centroid"),
    "collision with itself": (lambda: dojo.Collision("arm", "arm"), "arm", "itself"),
    "obstacle without shape": (lambda: dojo.Collision("world", "arm"), "shape_a", "obstacle"),
    "collision of no body": (lambda: dojo.Mechanism([BODY], [HINGE], collisions=[dojo.Collision("arm", "leg")]), "leg"),
    "second joint of a pair": (lambda: dojo.Mechanism([BODY, other()], [HINGE,
                               dojo.Joint("revolute", "arm", "leg", name="knee"),
                               dojo.Joint("revolute", "arm", "leg", name="second knee")]), "knee", "close=True"),
}
# fmt: on


@pytest.mark.parametrize("case", PARTS)
def test_mechanism(case):
    check_refused(*PARTS[case])


def hopper():
    return dojo.Simulator(block(), time_step=0.01)


def state(**changes):
    """A good state of the block with some entries replaced."""
    x = np.r_[0.0, 0.0, 0.5, 1.0, np.zeros(9)]
    for index, value in changes.items():
        x[int(index[1:])] = value
    return x


CALLS = {
    "time step zero": (lambda: dojo.Simulator(block(), time_step=0.0), "time_step"),
    "time step nan": (lambda: dojo.Simulator(block(), time_step=np.nan), "time_step", "nan"),
    "kappa zero": (lambda: dojo.Simulator(block(), kappa=0.0), "kappa"),
    "kappa negative": (lambda: dojo.Simulator(block(), kappa=-1e-6), "kappa"),
    "tolerance zero": (lambda: dojo.Simulator(block(), tolerance=0.0), "tolerance"),
    "not a mechanism": (lambda: dojo.Simulator("block"), "Mechanism"),
    "unknown setting": (lambda: hopper().replace(timestep=0.1), "timestep"),
    "state shape": (lambda: hopper().step(np.zeros(5), np.zeros(0)), "step", "(13,)", "(5,)"),
    "input shape": (lambda: hopper().step(state(), np.zeros(3)), "step", "(0,)", "(3,)"),
    "state nan": (lambda: hopper().step(state(_7=np.nan), np.zeros(0)), "step", "nan", "7"),
    "state infinite": (lambda: hopper().step(state(_2=np.inf), np.zeros(0)), "step", "inf", "2"),
    "state text": (lambda: hopper().step("zero", np.zeros(0)), "step"),
    "state quaternion": (lambda: hopper().step(state(_3=0.0), np.zeros(0)), "step", "quaternion", "block"),
    "input nan": (lambda: dojo.Simulator(ball()).step(state(), np.r_[0, np.nan, 0, 0, 0, 0]), "step", "nan", "1"),
    "rollout shape": (lambda: dojo.Simulator(ball()).rollout(state(), np.zeros((10, 2))), "rollout", "6", "(10, 2)"),
    "rollout nan": (lambda: dojo.Simulator(ball()).rollout(state(), np.full((4, 6), np.nan)), "rollout", "nan"),
    "linearize shape": (lambda: hopper().linearize(np.zeros(12), np.zeros(0)), "linearize", "(13,)", "(12,)"),
    "linearize kappa": (lambda: hopper().linearize(state(), np.zeros(0), kappa=0.0), "linearize", "kappa"),
    "start shape": (
        lambda: hopper().state_from_velocity(np.zeros(7), np.zeros(5)),
        "state_from_velocity",
        "(6,)",
        "(5,)",
    ),
    "maximal shape": (lambda: hopper().maximal(np.zeros(3)), "maximal", "(13,)", "(3,)"),
    "minimal shape": (lambda: hopper().minimal(np.zeros((2, 13))), "minimal", "(1, 13)", "(2, 13)"),
    "vjp of no trajectory": (lambda: hopper().vjp("run", np.zeros((2, 12))), "vjp(trajectory)", "'run'"),
    "terrain of a number": (lambda: dojo.Terrain.from_function(3.0, x=(-1, 1), y=(-1, 1)), "from_function(f)", "3.0"),
    "terrain of a range": (
        lambda: dojo.Terrain.from_function(lambda x, y: np.sin(3 * x), x=(-3, 3), y=[0.0]),
        "from_function(x)",
        "np.linspace(-3, 3, 61)",
    ),
    "energy nan": (lambda: hopper().energy(state(_8=np.nan)), "energy", "nan"),
}


@pytest.mark.parametrize("case", CALLS)
def test_simulator(case):
    check_refused(*CALLS[case])


def kinematics():
    return dojo.Kinematics(dojo.Simulator(ball()))


def grid(radius=0.4):
    """Signed distances of a ball on 9 x 9 x 9 points, .15 m apart."""
    x = np.linspace(-0.6, 0.6, 9)
    return np.sqrt(x[:, None, None] ** 2 + x[None, :, None] ** 2 + x[None, None, :] ** 2) - radius


Q = np.r_[np.zeros(3), 1.0, np.zeros(3)]
FROM_DENSITY, FROM_FUNCTION = dojo.SignedDistance.from_density, dojo.SignedDistance.from_function
# fmt: off
ROOMS = {
    "number of 400 digits": (lambda: dojo.Simulator(block(), time_step=10**400), "time_step", "real numbers"),
    "number of 5000 digits": (lambda: dojo.Sphere(10**5000), "Sphere(radius", "a int"),
    "ragged number": (lambda: dojo.Sphere([[1, 2], [3]]), "Sphere(radius", "real numbers"),
    "masked state": (lambda: hopper().step(np.ma.masked_less(state(), 0.1)), "step", "masked"),
    "order of an array": (lambda: dojo.Simulator(block(), order=np.empty(0)), "order", "2"),
    "iterations beyond floats": (lambda: dojo.Simulator(block(), max_iterations=10**400), "max_iterations", "2^53"),
    "frame of an array": (lambda: kinematics().pose(np.empty(0), Q), "Kinematics.pose(frame)"),
    "text coordinates": (lambda: kinematics().jacobian("ball", "abc"), "Kinematics.jacobian(q)", "'abc'"),
    "nan velocity": (lambda: kinematics().velocity("ball", Q, np.full(6, np.nan)), "Kinematics.velocity(v)", "nan"),
    "inf momentum": (lambda: kinematics().centroidal_momentum(Q, np.full(6, np.inf)), "momentum(v)", "inf"),
    "bias that overflows": (lambda: kinematics().bias_forces(Q, np.full(6, 1e300)), "bias_forces", "not finite"),
    "option of 400 digits": (lambda: dojo.Options(tolerance=10**400), "ilqr(tolerance=...)", "2^53"),
    "ragged knots": (lambda: knot_list("Goal(knots=...)", [[1, 2], [3]], 5, True), "Goal(knots=...)", "[[1, 2], [3]]"),
    "ragged wrenches": (lambda: hopper().step(state(), wrenches=[[1, 2], [3]]), "wrenches", "[[1, 2], [3]]"),
    "command of nan": (lambda: dojo.Plant(hopper()).step(np.full(0, 1.0)[None]), "Plant.step(command)", "(0,)", "(1, 0)"),
    "gains of nothing": (lambda: dojo.tracking_gains(None, None), "tracking_gains(problem)", "None"),
    "ik of nothing": (lambda: dojo.ik(kinematics(), None), "ik(targets)", "None"),
    "ik to nan": (lambda: dojo.ik(kinematics(), {"ball": (0, 0, 1)}, tolerance=np.nan), "ik(tolerance", "nan"),
    "ik without attempts": (lambda: dojo.ik(kinematics(), {"ball": (0, 0, 1)}, attempts=None), "ik(attempts", "None"),
    "ik without iterations": (lambda: dojo.ik(kinematics(), {"ball": (0, 0, 1)}, max_iterations=0), "max_iterations"),
    "ik that fixes text": (lambda: dojo.ik(kinematics(), {"ball": (0, 0, 1)}, fixed="ball"), "ik(fixed", "'ball'"),
    "ik of strange limits": (lambda: dojo.ik(kinematics(), {"ball": (0, 0, 1)}, limits=[]), "ik(limits", "[]"),
    "grid of a light year": (lambda: dojo.SignedDistance(grid(), (-1, -1, -1), 1e300), "spacing", "1e+300"),
    "too many points": (lambda: FROM_FUNCTION(lambda p: p[:, 0], [[0] * 3, [1] * 3], 1e-9), "spacing", "grid points"),
    "function of no points": (lambda: FROM_FUNCTION(None, [[0] * 3, [1] * 3], 0.1), "from_function(f)", "None"),
    "density below its level": (lambda: FROM_DENSITY(-grid(), 1e9, 0.15), "from_density(level", "nowhere above 1e+09"),
    "density at the edge": (lambda: FROM_DENSITY(-grid(), -1.0, 0.15), "from_density(density)", "edge", "larger grid"),
    "inertia of nan": (lambda: dojo.Box(1, 1, 1).inertia(np.nan), "Box.inertia(mass)", "nan"),
    "inertia of no mass": (lambda: dojo.SignedDistance(grid(), (-0.6,) * 3, 0.15).inertia(None), "inertia(mass)", "None"),
    "place of text": (lambda: dojo.Box(1, 1, 1).place("abc"), "Box.place(points)", "'abc'"),
    "place in a plane": (lambda: dojo.Box(1, 1, 1).place(np.zeros((4, 2))), "Box.place(points)", "(4, 2)"),
}
# fmt: on


@pytest.mark.parametrize("case", ROOMS)
def test_other_rooms(case):
    check_refused(*ROOMS[case])


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (
            lambda: dojo.Joint("revolute", None, "arm", "hip", (0, 0, 0), (0, 0, 1), (0, 1, 0), 3.0),
            r"Joint\(kind, parent, child, name, parent_point, child_point\): expected at most 6 .* got 8.* axis=\.\.\., ",
        ),
        (
            lambda: dojo.Contact("arm", (0, 0, 0), 0.1, 0.5),
            r"Contact\(body, point, radius\): .* got 4.* friction=\.\.\., ",
        ),
        (lambda: dojo.Body("arm", 1.0, (1, 1, 1), None, ()), r"Body\(name, mass, inertia, shape\): .*visuals=\.\.\., "),
        (lambda: dojo.Gear("a", "b", 1.0, 0.0, 1), r"Gear\(joint, other, ratio, offset\): .*dof=\.\.\., other_dof"),
    ],
)
def test_rows_of_numbers_have_names(call, message):
    with pytest.raises(TypeError, match=message):
        call()


@pytest.mark.parametrize("mech", [free_body(), block(), chain("spherical", 1)])
def test_half_a_turn_per_step_is_refused(mech):
    """A body that turns by pi or more in one step: a Status with its reason, or an error; never a number."""
    sim = dojo.Simulator(mech, time_step=0.1, divide=False)
    x = np.array(sim.neutral())
    x[sim.nq + 3] = 32.0
    result = sim.step(x, np.zeros(sim.nu))
    assert dojo.Status(result.status).name == "TURN_TOO_LARGE"
    trajectory = sim.rollout(x, np.zeros((3, sim.nu)))
    assert trajectory.status == result.status and trajectory.solved_steps == 0
    with pytest.raises(Exception, match=re.compile("turn|angular", re.IGNORECASE)):
        sim.rollout(x, np.zeros((3, sim.nu)), throw=True)


def test_huge_numbers_do_not_become_nan():
    """Overflow inside a step ends in a status; the result is finite."""
    sim = dojo.Simulator(ball(), time_step=0.01)
    for scale in (1e10, 1e100, 1e300):
        for x, u in ((state(_9=-scale), np.zeros(6)), (state(), np.full(6, scale))):
            try:
                result = sim.step(x, u)
            except ValueError:
                continue
            assert np.isfinite(result.x).all()
            assert result.status != 0 or scale < 1e12


def test_an_unsolved_step_says_by_how_much_it_missed_the_central_path():
    sim = dojo.Simulator(block(), time_step=0.01, max_iterations=1)
    with pytest.raises(
        dojo.SimulationError, match=r"Residual .* \(tolerance 1e-08\),( but)? off the central path by \d"
    ):
        sim.step(state(_2=0.26, _9=-5.0), throw=True)


def test_results_print_on_a_line():
    sim = dojo.Simulator(block(), time_step=0.01)
    t = sim.rollout(state(_2=0.25), np.zeros((4, 0)))
    assert repr(sim.mechanism) == "Mechanism(mechanism, nq 7, nv 6, bodies 1, contacts 8)"
    assert repr(t.contacts) == f"Contacts(4 steps of {', '.join(t.contacts.names)})"
    assert re.fullmatch(r"Contacts\((block_\d \S+ N(, )?){8}\)", repr(sim.step(state(_2=0.25)).contacts))


def test_a_step_that_failed_is_not_used():
    """A rollout stops at the first step that did not meet its tolerance."""
    sim = dojo.Simulator(block(), time_step=0.01, max_iterations=1)
    trajectory = sim.rollout(state(_2=0.26, _9=-5.0), np.zeros((50, 0)))
    assert trajectory.status != 0 and 0 <= trajectory.solved_steps < 50
    assert np.isfinite(trajectory.x[: trajectory.solved_steps + 1]).all()


def test_pendulum_may_turn_by_any_angle():
    """Angles of hinges are not wrapped."""
    sim = dojo.Simulator(pendulum(1), time_step=0.01)
    assert run(sim, np.array([50.0 * np.pi, 1.0]), 5)[-1][0] > 50.0 * np.pi
