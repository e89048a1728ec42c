"""The `repr` of an object shows its type and size, not all its numbers."""

from __future__ import annotations

import dataclasses
import importlib
import inspect
import pkgutil
import re

import numpy as np
import pytest

import dojo_opt as dojo
import sim

LETTERS = 1500


@pytest.fixture(scope="module")
def objects():
    sim = dojo.Simulator(dojo.models.quadruped(), 0.02)
    x, us = sim.neutral(), np.zeros((50, sim.nu))
    run = sim.rollout(x, us)
    mpc = dojo.tasks.hopper_mpc()
    plant = dojo.tasks.plant(mpc, 2e-3)
    loop = dojo.closed_loop(mpc, plant, 0.2)
    study = mpc.monte_carlo(plant, dojo.Disturbances(7, velocity=0.1), 0.1, runs=3)
    plan = dojo.ilqr(dojo.problems.hop(), max_iterations=3)
    pushes = [dojo.Push(0.1 * i, (0, 1, 0)) for i in range(100)]
    space = dojo.ParameterSpace(sim, ("friction:*",))
    atlas = dojo.models.atlas()
    return [
        *(sim, run, run.contacts, sim.step(x, us[0]), sim.linearize_trajectory(run.x, us), sim.reactions(x, us[0])),
        *(sim.rollout_batch(np.tile(x, (20, 1)), np.tile(us, (20, 1, 1))), sim.rollout_feedback(x, us, run.x)),
        *(atlas, *atlas.bodies, *atlas.joints, *atlas.contacts, *atlas.inputs),
        *(mpc, mpc.settings, mpc.policy, mpc.references, plant, loop, loop.log[-1], study, study.outcomes[0]),
        *(plan, plan.problem, *plan.problem.specs[0], *plan.problem.specs[1], dojo.Options(), space),
        *(dojo.gaits.trot(sim), dojo.Environment(plan.problem), dojo.Perturbation(offset=np.ones(500), pushes=pushes)),
        *(dojo.cost.Tracking(run.x, np.ones((51, 36))), dojo.cost.Effort(np.ones((50, 12)))),
        *(dojo.constraint.Goal(run.x), dojo.constraint.StateBounds(run.x, run.x)),
        *(dojo.Polytope(np.random.default_rng(0).normal(size=(400, 3))), dojo.Terrain(np.zeros((200, 200)))),
        dojo.SampledReference(run.time, run.x, sim),
    ]


@pytest.mark.slow
def test_texts_are_short_and_name_the_type(objects):
    for thing in objects:
        text = repr(thing)
        assert len(text) <= LETTERS, (type(thing), len(text))
        assert text.startswith((type(thing).__name__, "<")), text[:80]


def test_tables_for_notebooks_are_short_and_escaped(objects):
    shown = [thing._repr_html_() for thing in objects if hasattr(thing, "_repr_html_")]
    tables = [re.sub("(?s)<iframe.*?</iframe>", "", text) for text in shown]  # without animations
    assert len(tables) >= 3
    assert all(("<table>" in table or table.startswith("<p>")) and len(table) < 20_000 for table in tables)
    study = next(thing for thing in objects if type(thing).__name__ == "MonteCarlo")
    hostile = dataclasses.replace(study.outcomes[0], message="<script>alert(1)</script>")
    many = dataclasses.replace(study, outcomes=[hostile] * 300)
    assert "<script>" not in many._repr_html_() and "&lt;script&gt;" in many._repr_html_()
    assert "and 250 more" in many._repr_html_()


def test_mechanisms_are_drawn_by_the_function_that_is_registered(monkeypatch):
    mech = dojo.models.pendulum()
    assert "<iframe" in mech._repr_html_()
    monkeypatch.setattr(sim, "_registered", [])  # the simulation alone
    assert mech._repr_html_().startswith("<p>Mechanism(")


FIXED = {  # a few numbers each, however large the robot; or nothing that a user gets
    *(
        "Body",
        "Contact",
        "Input",
        "Joint",
        "Push",
        "Link",
        "Mount",
        "ContactCandidate",
        "Footfall",
        "Choices",
        "UrdfJoint",
        "UrdfLink",
    ),
    *("Solid", "Box", "Capsule", "Cylinder", "Ellipsoid", "HalfSpace", "Sphere", "String"),
}
ARRAYS = ("Floats", "Vector", "Matrix", "Stack", "ArrayLike", "NDArray")


def test_no_class_with_arrays_prints_them_all():
    """Every public class with array fields defines its own text instead of the dataclass's."""
    seen = 0
    for package in ("dojo_opt", "sim"):
        root = importlib.import_module(package)
        for module in pkgutil.walk_packages(root.__path__, f"{package}."):
            if module.name.endswith("__main__") or ".report." in module.name:
                continue
            for name, cls in inspect.getmembers(importlib.import_module(module.name), inspect.isclass):
                if (
                    cls.__module__ != module.name
                    or name[0] == "_"
                    or name in FIXED
                    or not dataclasses.is_dataclass(cls)
                ):
                    continue
                fields = [f.name for f in dataclasses.fields(cls) if f.repr and any(a in str(f.type) for a in ARRAYS)]
                generated = hasattr(cls.__repr__, "__wrapped__")
                assert not (fields and generated), f"{module.name}.{name} prints {', '.join(fields)}: use short_repr"
                seen += bool(fields)
    assert seen > 10
