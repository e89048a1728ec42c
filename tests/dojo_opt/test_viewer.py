"""The animation, looked at in a real browser: the robot is drawn, and it moves."""

import dataclasses
import json
import shutil
import time
from io import BytesIO

import matplotlib
import numpy as np
import pytest

import dojo_opt as dojo
from dojo_opt.report.page import write_page
from dojo_opt.report.result import Report, Row, Table
from dojo_opt.viewer import animation, drawing, overlays
from dojo_opt.viewer.motion import motion
from dojo_opt.viewer.page import page as page_of
from dojo_opt.viewer.page import spacing
from sim.io.meshes.shading import clustered, shaded
from sim.io.meshes.triangles import TriangleMesh
from sim.mechanism.shapes import rotation_matrix
from sim.mechanism.short_repr import short_table

# a browser process that is closed leaves sockets to the garbage collector
pytestmark = [
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
    pytest.mark.filterwarnings("ignore:zmq.eventloop.ioloop:DeprecationWarning"),  # which MeshCat loads with its server
    pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning"),
]
WIDTH, HEIGHT = 480, 180  # pixels, few of them, as each takes time without a graphics card
DRAWN = 125  # of them, which a robot covers at least


@pytest.fixture(scope="module")
def window():
    """A page of a headless Chromium, the system's or playwright's own, which draws without a graphics card."""
    playwright = pytest.importorskip("playwright.sync_api")
    names = ("chromium", "chromium-browser", "google-chrome")
    path = next((found for found in map(shutil.which, names) if found), None)
    arguments = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist", "--no-sandbox"]
    with playwright.sync_playwright() as session:
        try:
            browser = session.chromium.launch(executable_path=path, args=arguments)
        except playwright.Error as error:
            pytest.skip(f"no Chromium: {error}")
        yield browser.new_page(viewport={"width": WIDTH, "height": HEIGHT})
        browser.close()


@pytest.fixture
def page(window):
    """The page, empty again after the test: a scene is drawn on and on, which takes a core without a graphics card."""
    yield window
    window.evaluate("typeof animator === 'undefined' || animator.pause()")
    window.goto("about:blank")


@pytest.fixture(scope="module")
def quadruped():
    """Half a second in which the robot falls from 20 cm and lands."""
    sim = dojo.Simulator(dojo.models.quadruped(), time_step=0.01)
    x = sim.neutral()
    x[2] += 0.2
    return sim.rollout(x, np.zeros((50, sim.nu)))


def shot(page):
    """The screen as (HEIGHT, WIDTH, 3) numbers, without the menu at its top right."""
    from matplotlib.image import imread

    image = imread(BytesIO(page.screenshot()))[..., :3]
    image[:40, 200:] = 0.0
    return image


def changed(a, b):
    """Number of pixels that differ."""
    return int((np.abs(a - b).max(axis=2) > 0.1).sum())


def settled(page, seconds=2.0):
    """The screen once it has been the same, and not blank, for .3 s, or when time is up."""
    end, image, same = time.monotonic() + seconds, shot(page), 0
    while same < 3 and time.monotonic() < end:
        time.sleep(0.1)
        later = shot(page)
        same = same + 1 if np.ptp(later) > 0.3 and changed(later, image) == 0 else 0
        image = later
    return image


def shown(page, path, empty=None, seconds=20.0):
    """The screen after loading; given the empty scene, as soon as a robot is on it, or when time is up."""
    errors = []
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.goto(path.as_uri())
    end = time.monotonic() + seconds
    image = shot(page)
    while empty is not None and changed(image, empty) < DRAWN and time.monotonic() < end:
        time.sleep(0.2)
        image = shot(page)
    assert not errors
    return image


@pytest.mark.slow
def test_the_robot_is_drawn_and_moves(page, quadruped, tmp_path):
    path = dojo.viewer.save_html(quadruped, tmp_path / "fall.html")
    (tmp_path / "empty.html").write_text(page_of([motion(quadruped)], [], {}))
    shown(page, tmp_path / "empty.html")
    empty = settled(page)
    assert np.ptp(empty) > 0.3, "not even the background"
    assert changed(empty, shot(page)) == 0, "the empty scene stands still"

    first = shown(page, path, empty)
    assert changed(first, empty) > DRAWN, "the robot is not drawn"
    later = []
    for _ in range(6):
        time.sleep(0.15)
        later.append(changed(shot(page), first))
    assert max(later) > DRAWN // 5, "the robot does not move"


@pytest.mark.slow
def test_sloping_ground_is_drawn(page, tmp_path):
    sim = dojo.Simulator(dojo.models.raiberthopper(), time_step=0.01)
    images = []
    for name, slope in (("flat", 0.0), ("slope", 0.2)):
        plant = dojo.Plant(sim, slope=slope)
        loop = dojo.closed_loop(lambda t, x: np.array([0.0, 0.0, 41.0]), plant, 0.05)
        shown(page, dojo.viewer.save_html(loop, tmp_path / f"{name}.html"))
        page.evaluate("go(0)")
        images.append(settled(page))
    assert changed(*images) > 10_000


@pytest.mark.slow
def test_a_robot_of_meshes_fills_a_third_of_the_picture_in_its_colors(page, tmp_path):
    """A green mesh with a red lid, mirrored by its scale; MeshCat's own menu is hidden."""
    trimesh = pytest.importorskip("trimesh")
    trimesh.creation.box(extents=(0.1, 0.2, 0.4)).export(tmp_path / "box.stl")
    seen = [dojo.Visual(mesh=str(tmp_path / "box.stl"), scale=(1, -1, 1), color=(0.0, 0.8, 0.0))]
    seen.append(dojo.Visual(dojo.Box(0.1, 0.2, 0.1, center=(0, 0, 0.25)), color=(0.9, 0.0, 0.0)))
    body = dojo.Body("b", 1.0, (0.1, 0.1, 0.1), visuals=seen)
    mech = dojo.Mechanism([body], [dojo.Joint("floating", None, "b")], neutral={"b": (0, 0, 0.2, 1, 0, 0, 0)})
    page.goto(dojo.viewer.save_html(mech, tmp_path / "a.html").as_uri())
    r, g, b = np.moveaxis(settled(page), 2, 0)
    green, red = (g > 2 * r) & (g > 2 * b) & (g > 0.2), (r > 2 * g) & (r > 2 * b) & (r > 0.2)
    rows = np.flatnonzero((green | red).any(axis=1))
    assert 0.25 < np.ptp(rows) / HEIGHT < 0.55 and red.sum() > 75 and green.sum() > 250
    assert np.flatnonzero(red.any(axis=1)).mean() < np.flatnonzero(green.any(axis=1)).mean()  # the lid is on top
    assert page.evaluate("getComputedStyle(document.querySelector('.dg')).display") == "none"


def test_every_library_robot_has_a_picture():
    """A body without shape has bones; the leg of a hopper is as long as in its neutral state."""
    for name in dojo.models.__all__:
        found = drawing.pieces(getattr(dojo.models, name)())
        assert sum(len(parts) for parts in found.values()) > 0, name
    hopper = drawing.pieces(dojo.models.raiberthopper())["foot"]
    leg = [p for p in hopper if p.solid.kind == "cylinder"]
    assert len(leg) == 1 and leg[0].solid.size[1] == pytest.approx(0.5) and leg[0].place[2, 3] == pytest.approx(0.25)


def test_meshes_of_pictures_get_lighter_and_keep_their_creases():
    trimesh = pytest.importorskip("trimesh")
    cube, ball = trimesh.creation.box(), trimesh.creation.icosphere(subdivisions=5)
    for part, count in ((cube, 24), (ball, len(ball.vertices))):
        mesh = TriangleMesh(np.asarray(part.vertices), np.asarray(part.faces), None)
        vertices, normals, colors, faces = shaded(mesh)
        assert len(vertices) == count and colors is None and faces.shape == part.faces.shape
        middle = vertices[faces].mean(axis=1)
        outward = middle / np.linalg.norm(middle, axis=1)[:, None]
        assert (normals[faces].mean(axis=1) * outward).sum(axis=1).min() > 0.7
        if part is ball:
            np.testing.assert_allclose(normals, vertices, atol=0.01)
    light = clustered(TriangleMesh(np.asarray(ball.vertices), np.asarray(ball.faces), None), 0.1)
    assert len(light.faces) < 0.3 * len(ball.faces)
    np.testing.assert_allclose(np.linalg.norm(light.vertices, axis=1), 1.0, atol=0.01)


def test_a_plant_with_short_steps_does_not_make_a_long_file(tmp_path):
    sim = dojo.Simulator(dojo.models.raiberthopper(), time_step=1e-3)
    us = np.tile([0.0, 0.0, 41.0], (400, 1))
    short = dojo.viewer.save_html(sim.rollout(sim.neutral(), us), tmp_path / "a.html").stat().st_size
    coarse = sim.replace(time_step=16e-3)
    long = dojo.viewer.save_html(coarse.rollout(sim.neutral(), us[:25]), tmp_path / "b.html").stat().st_size
    assert abs(short - long) < 5_000


def test_a_rollout_with_feedback_is_shown_at_its_times():
    """With the forces of its steps, under its wrenches; also one that ends at once."""
    sim = dojo.Simulator(dojo.models.raiberthopper(), time_step=0.01)
    us, lift = np.tile([0.0, 0.0, 41.0], (3, 1)), {"body": (0.0, 0.0, 20.0, 0.0, 0.0, 0.0)}
    found = sim.rollout_feedback(sim.neutral(), us, substeps=4, kappa=1e-4, wrenches=lift)
    steps = sim.replace(kappa=1e-4).rollout(sim.neutral(), np.repeat(us, 4, axis=0), wrenches=lift)
    shown = motion(found)
    np.testing.assert_allclose(shown.time, found.time)
    assert shown.time[-1] == pytest.approx(0.12) and shown.contact_time[-1] == pytest.approx(0.12)
    np.testing.assert_allclose(shown.force, steps.contacts.force, atol=1e-5)
    np.testing.assert_allclose(shown.x, steps.x[::4], atol=1e-7)
    assert motion(dataclasses.replace(found, x=found.x[:1], u=found.u[:0])).force.shape == (0, sim.ncontact, 3)


def test_obstacles_are_drawn():
    ball = dojo.Body("ball", 1.0, shape=dojo.Sphere(0.1))
    walls = [
        dojo.Collision("ball", shape_b=dojo.HalfSpace(center=(0, 0, 0.5)), name="floor"),
        dojo.Collision("ball", shape_b=dojo.Box(0.2, 1.0, 1.0, center=(1, 0, 0)), name="wall"),
    ]
    mech = dojo.Mechanism([ball], [dojo.Joint("floating", None, "ball")], collisions=walls)
    sim = dojo.Simulator(mech, time_step=0.01)
    x = sim.neutral()
    x[2] = 1.0
    commands = animation._scene(motion(sim.rollout(x, np.zeros((3, 0)))))
    drawn = [command.path.lower() for command in commands if "obstacles" in command.path.lower()]
    assert sum("floor" in path for path in drawn) == 2 and sum("wall" in path for path in drawn) == 2


def test_an_ellipsoid_is_a_ball_with_three_radii():
    stone = dojo.Body("stone", 1.0, shape=dojo.Ellipsoid(0.3, 0.2, 0.1, orientation=(0.6, 0.8, 0.0, 0.0)))
    mech = dojo.Mechanism([stone], [dojo.Joint("floating", None, "stone")])
    sim = dojo.Simulator(mech, time_step=0.01)
    drawn = [c.lower() for c in animation._scene(motion(sim.rollout(sim.neutral(), np.zeros((1, 0)))))]
    (ball,) = [c for c in drawn if "object" in c]
    assert ball["object"]["geometries"][0]["type"] == "SphereGeometry"
    radius = ball["object"]["geometries"][0]["radius"]
    scale = np.reshape(ball["object"]["object"]["matrix"], (4, 4))
    np.testing.assert_allclose(radius * np.diag(scale)[:3], [0.3, 0.2, 0.1])
    outline = dojo.plots.thumbnail(mech).axes[0].patches[0].get_xy()
    right = np.array([np.cos(np.radians(30.0)), np.sin(np.radians(30.0)), 0.0])  # of the picture
    width = 2.0 * stone.shape.support(rotation_matrix(stone.shape.orientation).T @ right)
    assert np.ptp(outline, axis=0)[0] == pytest.approx(width, rel=0.03)


HOSTILE = "</title></script><script>hit('{}')</script><img src=x onerror=\"hit('{}')\">'\"&{{viewer}}$\\frac/{}"
NAMES = ["constructor", "__proto__", "<object>", "a/b", "//", "$\\frac{", *(HOSTILE.format(*3 * [k]) for k in "mbjco")]


def hostile(name, names):
    """A mechanism with this name; every part with each of the others, which a part shares with its neighbours."""
    balls = [dojo.Body(n, 1.0, shape=dojo.Sphere(0.1)) for n in names]
    joints = [dojo.Joint("floating", None, n, n) for n in names]
    walls = [dojo.Collision(n, shape_b=dojo.Box(0.2, 1.0, 1.0, center=(1, 0, 0)), name=n) for n in names]
    contacts = [dojo.Contact(n, radius=0.1, name=n) for n in names]
    return dojo.Mechanism(balls, joints, contacts, name=name, collisions=walls)


def opened(page, path):
    """Errors and outgoing requests after loading a page and opening every folder of MeshCat's menu."""
    wrong = []
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.on(
        "request",
        lambda request: wrong.append(request.url) if request.url[:5] not in ("file:", "data:", "blob:") else None,
    )
    page.add_init_script("window.hits = []; window.hit = name => window.hits.push(name)")
    page.goto(path.as_uri())
    page.evaluate("document.querySelectorAll('.dg .title, .dg .close-button').forEach(e => e.click())")
    page.wait_for_timeout(500)
    return wrong + page.evaluate("window.hits")


@pytest.mark.sweep(2)
@pytest.mark.parametrize("name", ["<object>", NAMES[-1]], ids=["object", "html"])
def test_names_of_a_user_are_text_in_the_page(page, tmp_path, name):
    sim = dojo.Simulator(hostile(name, NAMES[:-1]), time_step=0.01)
    x = sim.neutral()
    x[2 : sim.nq : 7] = 1.0 + np.arange(len(NAMES) - 1)
    motion_of = sim.rollout(x, np.zeros((3, sim.nu)))
    path = dojo.viewer.save_html(motion_of, tmp_path / "a.html")
    assert opened(page, path) == []
    assert page.title() == " ".join(name.split())
    assert page.locator("#bar b").inner_text() == name
    bodies = "Object.keys(viewer.scene_tree.find(['meshcat', 'bodies']).children).length"
    assert page.evaluate(bodies) == len(NAMES) - 1
    dojo.plots.trajectory(motion_of).savefig(tmp_path / "a.png")


@pytest.mark.slow
def test_names_of_a_file_are_text_in_the_page_of_show(page, tmp_path):
    from xml.sax.saxutils import quoteattr

    from dojo_opt.__main__ import main

    link = """<link name={}><inertial><mass value="1"/>
    <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><geometry><sphere radius="0.1"/></geometry></collision></link>"""
    text = f"<robot name={quoteattr(NAMES[6])}>{link.format(quoteattr(NAMES[7]))}</robot>"
    (tmp_path / "r.urdf").write_text(text)
    assert main(["show", str(tmp_path / "r.urdf"), "--seconds", "0.05", "--html", str(tmp_path / "r.html")]) == 0
    assert opened(page, tmp_path / "r.html") == []
    assert page.title() == NAMES[6]


OTHERS = [NAMES[0], NAMES[3], NAMES[-2]]


@pytest.fixture(scope="module")
def hostile_motion():
    """Balls that touch the ground and a wall, all of whose names are hostile."""
    mech = hostile(NAMES[-1], OTHERS)
    sim = dojo.Simulator(mech, time_step=0.01)
    x = sim.neutral()
    x[0 : sim.nq : 7], x[1 : sim.nq : 7], x[2 : sim.nq : 7] = 0.81, np.arange(len(mech.bodies)), 0.099
    return sim.rollout(x, np.zeros((3, sim.nu)))


@pytest.mark.slow
def test_names_are_text_beside_forces_paths_and_ghosts_of_several_motions(page, hostile_motion, tmp_path):
    m = motion(hostile_motion)
    assert np.abs(m.force).max() > 1.0
    goal = np.concatenate([m.position[0], m.quaternion[0]], axis=1)
    two = [dataclasses.replace(m, goal=goal), dataclasses.replace(m, goal=goal)]
    shown = {"forces": True, "paths": True, "ghost": True}
    (tmp_path / "two.html").write_text(animation.html_of(*two, shown=shown), encoding="utf-8")
    assert opened(page, tmp_path / "two.html") == []
    for part in overlays_of(page):
        page.uncheck(f"input[data-part={part}]")
        page.check(f"input[data-part={part}]")
    assert overlays_of(page) == ["forces", "paths", "ghost"] and page.evaluate("window.hits") == []
    count = "Object.keys(viewer.scene_tree.find({}).children).length"
    for group in (["meshcat"], ["meshcat", "motion1"]):
        assert page.evaluate(count.format(json.dumps([*group, "bodies"]))) == len(OTHERS)
        ghosts = f"viewer.scene_tree.find({json.dumps([*group, 'ghost'])}).object.children.length"
        assert page.evaluate(ghosts) == len(OTHERS)


def overlays_of(page):
    """Parts that the page has boxes for."""
    return page.eval_on_selector_all("input[data-part]", "boxes => boxes.map(box => box.dataset.part)")


@pytest.mark.slow
def test_names_are_text_in_notebooks_reports_and_figures(page, hostile_motion, tmp_path):
    name = NAMES[-1]
    table = short_table(name, (name, name), [(name, 1.0)])
    result = hostile_motion._repr_html_()
    assert "<iframe" in result
    body = f"<!DOCTYPE html><html><head><meta charset='utf-8'></head><body>{table}{result}</body></html>"
    (tmp_path / "notebook.html").write_text(body, encoding="utf-8")
    assert opened(page, tmp_path / "notebook.html") == []
    page.frames[1].wait_for_load_state()
    assert len(page.frames) == 2 and [frame.evaluate("window.hits") for frame in page.frames] == [[], []]
    assert page.frames[1].title() == " ".join(name.split()) and page.locator("th").first.inner_text() == name

    figure = dojo.plots.trajectory(hostile_motion)
    figure.suptitle(name.replace("$", ""))
    report = Report(name, name, [Row(name, 1.0, name, note=name)], summary=name, notes=[name], figure=figure)
    report.tables.append(Table(name, (name,), [(name,)] * 30, name))
    write_page({"timing": report}, tmp_path / "report", name)
    assert opened(page, tmp_path / "report" / "report.html") == []
    assert page.locator("h2").inner_text() == name
    with matplotlib.rc_context({"svg.fonttype": "none"}):  # text stays text
        figure.savefig(tmp_path / "figure.svg", metadata={"Title": name})
    assert opened(page, tmp_path / "figure.svg") == []


@pytest.mark.slow
def test_names_are_text_in_the_live_page(page, hostile_motion):
    with dojo.viewer.live(hostile_motion.simulator) as view:
        wrong = []
        page.on("pageerror", lambda error: wrong.append(str(error)))
        page.goto(view.url)
        view.show(hostile_motion.x[-1])
        page.wait_for_timeout(500)
        assert page.locator("#bar b").text_content() == NAMES[-1] and wrong == page.evaluate("window.hits") == []


def test_forces_are_bars_as_long_as_the_robot_for_its_weight(quadruped):
    """At rest the bars of four feet add up to the size of the robot."""
    sim = quadruped.simulator
    still, u = dojo.equilibrium(sim)
    m = motion(sim.rollout(still, np.tile(u, (3, 1))))
    commands, clips = overlays.forces(m, ("meshcat",), 1.0)
    bars = [clip.tracks["scale"].values[1][2] for clip in clips.values()]
    assert len(commands) == 2 * len(bars) == 8 and sum(bars) == pytest.approx(2.0 * m.radius, rel=1e-3)
    assert all(clip.tracks["scale"].frames[-1] == 60.0 for clip in clips.values())  # they stay until the page ends


@pytest.mark.slow
def test_the_goal_of_a_plan_is_a_ghost_where_the_plan_leaves_nothing_free():
    sim = dojo.Simulator(dojo.models.pendulum(), time_step=0.05)
    goal = np.array([np.pi, 0.0])
    effort = [dojo.cost.Effort(1e-3)]
    ends = [dojo.constraint.Goal(goal), dojo.constraint.Goal(goal, components="v")]
    plans = [dojo.ilqr(dojo.Problem(sim, sim.neutral(), horizon=20, cost=effort, constraints=[end])) for end in ends]
    np.testing.assert_allclose(motion(plans[0]).goal[0, :3], sim.maximal(goal)[0, :3], atol=1e-9)
    assert motion(plans[1]).goal is None
    assert motion(sim.rollout(plans[0].x[0], plans[0].u)).goal is None


def test_the_goal_of_a_reach_is_a_ghost_with_the_frame_at_its_target():
    arm = dojo.Simulator(dojo.models.panda(gripper=False), time_step=0.05)
    kin = dojo.Kinematics(arm)
    target = kin.pose("link7", arm.neutral()[: arm.nq])[0] + (0.0, 0.1, 0.1)
    problem = dojo.problems.reach(arm, "link7", target, duration=0.5, time_step=0.05)
    start = dojo.ilqr(problem, options=dojo.Options(max_iterations=1))
    body, origin, _ = kin.place("link7")
    pose = motion(start).goal[body]
    np.testing.assert_allclose(pose[:3] + rotation_matrix(pose[3:]) @ origin, target, atol=1e-7)
    ends = [dojo.constraint.Point("link7", target), dojo.constraint.Point("link7", target, knots=-1, weight={"x": 1.0})]
    for end in ends:  # at all knots, and one entry alone
        other = dojo.Problem(arm, arm.neutral(), 2, cost=[dojo.cost.Effort(1e-3)], constraints=[end])
        assert motion(dojo.ilqr(other, options=dojo.Options(max_iterations=1))).goal is None


def test_a_thumbnail_has_the_shank_between_the_last_joint_and_the_contact():
    bodies = [dojo.Body("hip", 1.0, shape=dojo.Sphere(0.1)), dojo.Body("shank", 1.0, inertia=0.01 * np.eye(3))]
    joints = [
        dojo.Joint("floating", None, "hip"),
        dojo.Joint("revolute", "hip", "shank", child_point=(0, 0, 0.2), axis=(0, 1, 0)),
    ]
    mech = dojo.Mechanism(bodies, joints, [dojo.Contact("shank", point=(0.0, 0.0, -0.3))])
    bones = [line.get_xydata() for line in dojo.plots.thumbnail(mech).axes[0].lines if line.get_linewidth() == 2.0]
    longest = max(float(np.linalg.norm(bone[-1] - bone[0])) for bone in bones)
    assert longest == pytest.approx(0.5 * np.cos(np.radians(18.0)), rel=1e-6)  # seen from above


@pytest.mark.slow
def test_motions_side_by_side_are_apart_and_end_together(quadruped, tmp_path):
    two = [motion(quadruped), motion(quadruped.simulator.rollout(quadruped.x[0], quadruped.u[:10]))]
    text = animation.html_of(*two, shown={"forces": True})
    assert 'data-part="forces" type="checkbox" checked' in text and 'data-part="paths" type="checkbox">' in text
    assert "motion1" in text and 'data-part="ghost"' not in text
    assert spacing(two) > np.ptp(two[0].bounds, axis=0)[1]
    with pytest.raises(ValueError, match="expected one result or more"):
        dojo.viewer.save_html([], tmp_path / "none.html")
    with pytest.raises(ValueError, match=r"expected a page such as one.html, got 'one.mp4'"):
        dojo.viewer.save_html(quadruped, tmp_path / "one.mp4")


@pytest.mark.slow
def test_a_robot_that_is_drawn_twice_has_two_colors_and_a_shadow(page, quadruped, tmp_path):
    """As a measured motion and its prediction, which looked alike."""
    file = dojo.viewer.save_html([quadruped] * 2, tmp_path / "fit.html", names=["measured", "<b>fit"], together=True)
    assert opened(page, file) == []
    looks = [
        page.evaluate(
            """group => {
                const found = [];
                viewer.scene_tree.find([...group, "bodies"]).object.traverse(part => {
                    if (part.material) found.push([part.material.color.getHex(), part.material.opacity]);
                });
                return found;
            }""",
            group,
        )
        for group in (["meshcat"], ["meshcat", "motion1"])
    ]
    assert len(looks[0]) == len(looks[1]) > 12
    assert all(a != b and (a[1], b[1]) == (1, 0.5) for a, b in zip(*looks, strict=True))
    assert page.evaluate("[sun.castShadow, ground.parent === viewer.scene, viewer.scene_tree.find(['meshcat', "
                         "'floor', 'lines', '<object>']).object.castShadow]") == [True, True, False]  # fmt: skip
    assert "measured" in page.inner_text("#bar") and "<b>fit" in page.inner_text("#bar")
    with pytest.raises(ValueError, match=r"save_html\(names=...\): expected 1 names, got 2"):
        dojo.viewer.save_html(quadruped, tmp_path / "one.html", names=["a", "b"])


@pytest.mark.slow
def test_motions_of_the_same_robot_share_its_meshes(page, tmp_path):
    """The second robot adds its motion to the file, not its triangles, and is drawn nevertheless."""
    corners = np.random.default_rng(1).standard_normal((400, 3))
    shape = dojo.Polytope.about_centroid(0.2 * corners / np.linalg.norm(corners, axis=1)[:, None])
    body = dojo.Body("rock", 1.0, shape=shape)
    rock = dojo.Mechanism([body], [dojo.Joint("floating", None, "rock")])
    fall = dojo.Simulator(rock, time_step=0.01).rollout(np.eye(1, 13, 3)[0], steps=2)
    sizes = [dojo.viewer.save_html([fall] * n, tmp_path / f"{n}.html").stat().st_size for n in (1, 2, 3)]
    drawn = animation.html_of(motion(fall), moving=False)
    triangles = max(len(part) for part in drawn.split('"'))
    assert sizes[1] - sizes[0] < 0.3 * triangles and sizes[2] - sizes[1] < 0.3 * triangles
    shown(page, tmp_path / "3.html")
    find = "viewer.scene_tree.find(['meshcat', 'motion2', 'bodies', '0 rock', 'part0', '<object>']).object"
    assert page.evaluate(f"{find}.geometry.attributes.position.count") >= 400


@pytest.mark.slow
def test_a_page_steps_from_knot_to_knot_and_shows_its_overlays(page, quadruped, tmp_path):
    page.goto(dojo.viewer.save_html([quadruped, quadruped], tmp_path / "two.html", forces=True).as_uri())
    page.wait_for_function("typeof animator !== 'undefined'")
    page.evaluate("go(0.2)")
    page.click("#ahead")
    assert page.evaluate("now()") == pytest.approx(0.21, abs=1e-6)
    page.click("#back")
    assert page.evaluate("now()") == pytest.approx(0.2, abs=1e-6)
    page.select_option("#speed", "0.25")
    assert page.evaluate("animator.mixer.timeScale") == 0.25
    page.evaluate("go(0.45)")
    page.evaluate("follow.checked = false")
    before = settled(page)
    page.uncheck("input[data-part=forces]")
    r, g, b = np.moveaxis(before, 2, 0)
    assert changed(settled(page), before) > 12 and ((r > 2 * g) & (r > 2 * b) & (r > 0.3)).sum() > 12


def test_a_page_ends_with_its_longest_motion_and_others_stay_at_their_end(quadruped):
    """The slider reaches an end that is no round number; keys that are left out do not delay the end of a motion."""
    long = motion(quadruped)
    short = dataclasses.replace(long, time=0.2 * long.time)
    text = page_of([short, dataclasses.replace(long, time=24.69 * long.time)], [], {})
    assert 'max="12.345"' in text and "now() / 0.1, 1)" in text
    (first, *_) = animation._clips(short, ("meshcat",), 0.5).values()
    keys = first.tracks["position"]
    assert [k / animation.FRAMES for k in keys.frames[-2:]] == pytest.approx([0.1, 0.5])
    assert keys.values[-2] == keys.values[-1] == short.position[-1, 0].tolist()
