"""Saved files that are damaged or hostile: a ValueError that names the call and the file, or a result that works."""

import warnings
from functools import cache

import numpy as np
import pytest

import dojo_opt as dojo
from dojo_opt.learn.network import Network
from dojo_opt.learn.policy import LearnedPolicy
from dojo_opt.learn.training_result import Learned
from support.damaged_files import Bomb, damaged_npz

SIM = dojo.Simulator(dojo.models.pendulum(), time_step=0.05)
POLICY = LearnedPolicy(Network((2, 3, 1)), np.ones(13), np.zeros(2), np.ones(2))
RECORD = dict.fromkeys(("epoch", "steps", "unsolved", "infinite"), 1)
RECORD |= dict.fromkeys(("return", "evaluated", "gradient", "clipped", "seconds"), 0.5)
END = (True, dojo.Status.SOLVED, "All epochs are done.", "shac", 0, 1.0, 10, 0, 0, 2.0, [RECORD])
SAVED = {
    "Plan": (lambda: plan(), dojo.Plan, lambda found: (found.summary(), found.time, found.repeated)),
    "Trajectory": (
        lambda: SIM.rollout(SIM.neutral(), steps=3),
        dojo.Trajectory,
        lambda found: (repr(found), found.contacts),
    ),
    "LearnedPolicy": (lambda: POLICY, LearnedPolicy, lambda found: found.action(np.ones(found.network.sizes[0]))),
    "Learned": (lambda: Learned(POLICY, *END, {"weights": np.ones(13)}), Learned, lambda found: found.summary()),
}


@cache
def plan():
    """Five knots of a pendulum."""
    cost, goal = dojo.cost.Effort(1.0), dojo.constraint.Goal([1, 0])
    return dojo.ilqr(dojo.Problem(SIM, SIM.neutral(), 5, cost=cost, constraints=goal))


def outcome(kind, path):
    """The message of the refusal, empty where the file was read and its result works."""
    _, made, use = SAVED[kind]
    try:
        use(made.load(path))
    except ValueError as error:
        return str(error)
    return ""


def attack(kind, folder, seeds):
    """Load damaged files; the number of refusals."""
    path, refused = folder / "saved.npz", 0
    SAVED[kind][0]().save(path)
    whole = path.read_bytes()
    assert outcome(kind, path) == ""
    for seed in seeds:
        path.write_bytes(damaged_npz(whole, np.random.default_rng(seed)))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of strange inertias
            message = outcome(kind, path)
        refused += bool(message)
        assert not message or (message.startswith(f"{kind}.load: ") and str(path) in message), (seed, message)
    assert not Bomb.loaded
    return refused


@pytest.mark.parametrize("kind", SAVED)
@pytest.mark.parametrize(
    "seeds", [range(40), pytest.param(range(40, 150), marks=pytest.mark.slow)], ids=["some", "many"]
)
def test_damaged_files_are_refused_by_name_or_work(kind, seeds, tmp_path):
    assert attack(kind, tmp_path, seeds) > len(seeds) // 2


def test_paths_that_are_none_are_refused(tmp_path):
    calls = {
        "save_html": lambda path: dojo.viewer.save_html(plan(), path),
        "save_picture": lambda path: dojo.viewer.save_picture(plan(), path),
        "save_video": lambda path: dojo.viewer.save_video(plan(), path),
        "load_urdf": dojo.load_urdf,
        **{f"{kind}.save": SAVED[kind][0]().save for kind in SAVED},
        **{f"{kind}.load": SAVED[kind][1].load for kind in SAVED},
        "Plan.export": plan().export,
    }
    for name, call in calls.items():
        for path in (None, b"a.npz", 3, ""):
            with pytest.raises((TypeError, ValueError), match=rf"{name}\(path\): expected the path of a file"):
                call(path)


@pytest.mark.parametrize("simulator", [None, SIM, "sim"])
def test_results_that_are_none_are_refused(simulator, tmp_path):
    for call in (dojo.viewer.save_html, dojo.viewer.save_video, dojo.viewer.save_picture):
        for result in (None, 3, "plan", SIM, [None]):
            with pytest.raises(TypeError, match="expected a Trajectory, a Plan or a ClosedLoop"):
                call(result, tmp_path / ("a.mp4" if "video" in call.__name__ else "a.png"), simulator=simulator)
