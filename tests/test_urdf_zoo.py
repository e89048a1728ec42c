"""benchmarks/urdf_zoo.py on a file of our own, and on a sample of robots from packages where these are installed."""

import json
import warnings

import numpy as np
import pytest

import dojo_opt as dojo
from support.benchmark import loaded
from support.urdf_files import collision, compare_with_mujoco, inertial, joint, link, write

# part of a path: why it is in the sample
SAMPLE = {
    "a1_description": "quadruped with boxes, cylinders and balls",
    "g1_29dof_rev_1_0": "humanoid",
    "talos_full_v2_box": "humanoid with mimics",
    "panda_collision": "arm with capsules made of cylinders and balls",
    "ur5_robot": "arm below a root called world",
    "tiago_no_hand": "wheels and casters",
    "anymal_c_simple": "hundreds of contacts",
    "iris_simple": "one body, propellers merged",
    "romeo_small": "to be repaired",
    "double_pendulum_simple": "empty ranges",
    "ur_description/urdf/ur3.urdf": "no links",
}


@pytest.fixture(scope="module")
def zoo():
    yield from loaded("urdf_zoo")


@pytest.fixture(scope="module")
def files(zoo):
    found = zoo.package_files()
    if not any("example-robot-data" in f.parts for f in found):
        pytest.skip("example-robot-data is not installed: pip install 'dojo-opt[robots]'")
    return found


def test_own_files_are_simulated_or_refused(zoo, tmp_path, capsys):
    leg = link("leg", inertial(), collision('<sphere radius="0.1"/>'))
    good = write(tmp_path, link("base", inertial()), leg, joint("hip", "base", "leg"), name="good")
    assert zoo.main([str(good), "--json"]) == 0
    (out,) = json.loads(capsys.readouterr().out)["details"]["files"]
    assert (out["verdict"], out["bodies"], out["dofs"], out["contacts"]) == ("fine", 2, 7, 1)
    assert 0.0 < out["iterations"] < 60
    flat = write(tmp_path, link("base", inertial(inertia=(1, 1, 3, 0, 0, 0))), name="flat")
    (repaired,) = zoo.study([flat])
    assert (repaired.verdict, repaired.how) == ("fine", "repair")
    assert "exceeds the sum of the others" in repaired.reason
    massless = write(tmp_path, link("base", ""), name="massless")
    assert zoo.main([str(massless)]) == 0
    assert "no moving link has a mass" in capsys.readouterr().out
    rows = {row.name: row.value for row in zoo.summary(zoo.study([good, flat, massless])).rows}
    assert (rows["files"], rows["fine"], rows["fine, with repair=True"], rows["refused"]) == (3, 2, 1, 1)
    assert rows["refused: nothing in it can move"] == 1 and rows["can touch the ground"] == 1
    with pytest.raises(SystemExit, match="2"):
        zoo.main(["--match", "no file has this in its path"])
    capsys.readouterr()


def test_a_robot_that_does_badly_is_reported(zoo, tmp_path, capsys, monkeypatch):
    ball = write(tmp_path, link("ball", inertial(), collision('<sphere radius="0.1"/>')), name="ball")
    monkeypatch.setattr(zoo, "DEPTH", -1.0)
    assert zoo.main([str(ball)]) == 1
    assert "in the ground  0.2 ms; with 1 ms: in the ground" in capsys.readouterr().out


@pytest.mark.slow
def test_robots_of_the_wild_stand_or_fall(zoo, files):
    for part, why in SAMPLE.items():
        path = next(f for f in files if part in str(f) and "example-robot-data" in f.parts)
        out = zoo.run(path)
        assert out.verdict == ("refused" if why == "no links" else "fine"), zoo.line(out)
        assert ("repair" in out.how) == (why == "to be repaired"), zoo.line(out)


@pytest.mark.slow
def test_robots_of_the_wild_are_mujocos(files, rng):
    """Every file that both accept unchanged: poses of all links, masses, mass matrices."""
    pytest.importorskip("mujoco")
    compared = 0
    for path in files:
        if "random_urdfs" in path.parts:
            continue
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                worst = compare_with_mujoco(path, rng)
            except dojo.UrdfError:
                continue
            except ValueError as error:
                assert "rror" in str(error), path  # MuJoCo checks links before they are merged, so it refuses more
                continue
        assert np.all(np.array(worst) < 1e-9), (path, worst)
        compared += 1
    assert compared >= 45
