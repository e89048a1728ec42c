"""Elements and attributes of an MJCF file that its mechanism lacks, as notes.

`_ROWS` lists the attributes that change the motion and have no counterpart here. `_KNOWN` lists the fields of MuJoCo's
compiled model that the other files of this folder read, that are in `_ROWS`, or that do not change the motion of hard
contact: drawing, indices, sizes of buffers, the numerics of MuJoCo's solver. A field in neither is one of a later
version of MuJoCo; it is compared with its default, and named where it differs.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from sim.io.loader_choices import LoaderChoices
from sim.io.mjcf.equalities import WELD
from sim.io.mjcf.flags import actuation_disabled, contacts_disabled
from sim.io.mjcf.welded_bodies import PLANE, name_of
from sim.io.urdf.report import Notes
from solvers.types import Floats

_BOUNCES = 0.5  # damping ratio of a contact below which it visibly bounces
_SLOW = 0.04  # [s] of MuJoCo's contacts that visibly give way, 0.02 s by default
_GIVES = 0.5  # largest impedance of these
_TORQUE = 0.5  # scale of the torque of welds that visibly turn
_ASLEEP = 5  # mjtSleepPolicy


class _Dropped(NamedTuple):
    """Elements of one kind that have an attribute without a counterpart."""

    kind: str
    text: str
    found: Callable[[Any], Any]  # from the model to (elements,) whether each has it
    warn: bool = True


def _touching(model: Any) -> Any:
    """(ngeom,) whether a geom may touch others."""
    if contacts_disabled(model):
        return np.zeros(model.ngeom, dtype=bool)
    paired = np.isin(np.arange(model.ngeom), [*model.pair_geom1, *model.pair_geom2])
    return (model.geom_contype | model.geom_conaffinity).astype(bool) | paired


def _spins(condim: Any, torsional: Any, rolling: Any) -> Any:
    """Whether contacts have torsional or rolling friction."""
    return ((condim >= 4) & (torsional > 0.0)) | ((condim >= 6) & (rolling > 0.0))


def _bounces(solref: Floats) -> Any:
    """Whether contacts or limits with rows (time constant, damping ratio) or (-stiffness, -damping) spring back."""
    first, second = solref[:, 0], solref[:, 1]
    direct = first < 0.0
    ratio = np.where(direct, -second / (2.0 * np.sqrt(np.where(direct, -first, 1.0))), second)
    return ratio < _BOUNCES


def _yields(solref: Floats, solimp: Floats) -> Any:
    """Whether contacts or limits give way: by the time in which they close, 1/sqrt(stiffness), and their impedance."""
    first, second = solref[:, 0], solref[:, 1]
    direct = first < 0.0
    time = np.where(direct, 1.0 / np.sqrt(np.where(direct, -first, 1.0)), first * second)
    return (time > _SLOW) | (solimp[:, 1] < _GIVES)


def _soft(solref: Floats, solimp: Floats) -> Any:
    """Whether rows differ from MuJoCo's default."""
    return (solref != [0.02, 1.0]).any(axis=1) | (solimp != [0.9, 0.95, 0.001, 0.5, 2.0]).any(axis=1)


def _pairs(model: Any, found: Any) -> Any:
    """(npair,) what was found of pairs, of none where contacts are switched off."""
    return np.zeros(model.npair, dtype=bool) if contacts_disabled(model) else found


def _limited(model: Any) -> Any:
    """(njnt,) whether a hinge or slide has a range."""
    return np.asarray(model.jnt_limited, dtype=bool)


def _compensated(model: Any) -> Any:
    """(njnt,) whether the range of the forces of a joint bounds the compensation of gravity, or its flag ends it."""
    bounded = np.asarray(model.jnt_actfrclimited, dtype=bool) | actuation_disabled(model)
    return np.asarray(model.jnt_actgravcomp, dtype=bool) & bounded & bool(np.any(model.body_gravcomp))


def _gives_way(model: Any) -> Any:
    """(neq,) whether an equality constraint gives way, or springs back."""
    soft = _yields(model.eq_solref, model.eq_solimp) | _bounces(model.eq_solref)
    return np.asarray(model.eq_active0, dtype=bool) & soft


def _turns(model: Any) -> Any:
    """(neq,) whether a weld leaves the rotation free, or nearly so."""
    return np.asarray(model.eq_active0, dtype=bool) & (model.eq_type == WELD) & (model.eq_data[:, 10] < _TORQUE)


_RIGID = "contacts and limits are rigid here, whatever their solref and solimp"
_SOFT = "contacts and limits that give way visibly in MuJoCo are rigid here"
_SPRINGY = "contacts and limits that MuJoCo's solref lets bounce do not bounce here"
_ROLLING = "torsional and rolling friction is omitted (condim 4 and 6; turning_friction=True has it)"
_ONE_ROLLING = "rolling friction of pairs is that of the first direction in all directions"
_STICKY = "adhesion of contacts is omitted"
_PLUGIN = "plugins are omitted"

_ROWS = (
    _Dropped("body", _PLUGIN, lambda m: m.body_plugin >= 0),
    _Dropped("body", "bodies moved by mocap stay where they are", lambda m: m.body_mocapid >= 0, warn=False),
    _Dropped("joint", "nonlinear stiffness is omitted", lambda m: m.jnt_stiffnesspoly.any(axis=1)),
    _Dropped(
        "joint",
        "springs do not yield here (springyield)",
        lambda m: (m.jnt_springyield > 0.0) & ((m.jnt_stiffness != 0.0) | m.jnt_stiffnesspoly.any(axis=1)),
    ),
    _Dropped("joint", "gravity compensation by actuators is unbounded here (actuatorgravcomp)", _compensated),
    _Dropped("joint", _SPRINGY, lambda m: _limited(m) & _bounces(m.jnt_solref)),
    _Dropped("joint", _SOFT, lambda m: _limited(m) & _yields(m.jnt_solref, m.jnt_solimp)),
    _Dropped("joint", _RIGID, lambda m: _limited(m) & _soft(m.jnt_solref, m.jnt_solimp), warn=False),
    _Dropped("geom", _PLUGIN, lambda m: m.geom_plugin >= 0),
    _Dropped(
        "geom",
        _ROLLING,
        lambda m: _touching(m) & _spins(m.geom_condim, m.geom_friction[:, 1], m.geom_friction[:, 2]),
    ),
    _Dropped("geom", _STICKY, lambda m: _touching(m) & (m.geom_adhesion != 0.0)),
    _Dropped("geom", "velocities of surfaces are omitted", lambda m: _touching(m) & m.geom_surfacevel.any(axis=1)),
    _Dropped("geom", _SPRINGY, lambda m: _touching(m) & _bounces(m.geom_solref)),
    _Dropped("geom", _SOFT, lambda m: _touching(m) & _yields(m.geom_solref, m.geom_solimp)),
    _Dropped("geom", _RIGID, lambda m: _touching(m) & _soft(m.geom_solref, m.geom_solimp), warn=False),
    _Dropped(
        "pair",
        _ROLLING,
        lambda m: _pairs(m, _spins(m.pair_dim, m.pair_friction[:, 2], m.pair_friction[:, 3:].max(axis=1, initial=0.0))),
    ),
    _Dropped(
        "pair",
        "friction of pairs is that of the first direction in all directions",
        lambda m: _pairs(m, (m.pair_dim > 1) & (m.pair_friction[:, 0] != m.pair_friction[:, 1])),
    ),
    _Dropped(
        "pair",
        _ONE_ROLLING,
        lambda m: _pairs(m, (m.pair_dim >= 6) & (m.pair_friction[:, 3] != m.pair_friction[:, 4])),
    ),
    _Dropped("pair", _STICKY, lambda m: _pairs(m, m.pair_adhesion != 0.0)),
    _Dropped("pair", _SPRINGY, lambda m: _pairs(m, _bounces(m.pair_solref))),
    _Dropped("pair", _SOFT, lambda m: _pairs(m, _yields(m.pair_solref, m.pair_solimp))),
    _Dropped("pair", _RIGID, lambda m: _pairs(m, _soft(m.pair_solref, m.pair_solimp)), warn=False),
    _Dropped("equality", "equality constraints that give way visibly in MuJoCo are rigid here", _gives_way),
    _Dropped("equality", "welds of little torque (torquescale) are rigid here", _turns),
    _Dropped("actuator", _PLUGIN, lambda m: m.actuator_plugin >= 0),
    _Dropped("actuator", "nonlinear damping is omitted", lambda m: m.actuator_dampingpoly.any(axis=1)),
    _Dropped("actuator", "delays of actuators are omitted", lambda m: m.actuator_delay != 0.0),
    _Dropped(
        "flex", "flexes are omitted, but for the masses of their vertices", lambda m: np.ones(m.nflex, dtype=bool)
    ),
)

_FORCES_OF_TENDONS = (
    "stiffness stiffnesspoly damping dampingpoly limited frictionloss armature"  # of those that pull, or weigh
)
_NUMERICS = "solref solimp user group"
_KNOWN = {
    "body": "parentid rootid weldid mocapid jntnum jntadr dofnum dofadr treeid geomnum geomadr simple sameframe pos "
    "quat ipos iquat mass subtreemass inertia invweight0 gravcomp margin plugin contype conaffinity bvhadr bvhnum",
    "jnt": "type qposadr dofadr bodyid actuatorid plasticadr limited actfrclimited actgravcomp pos axis stiffness "
    "stiffnesspoly springyield range actfrcrange margin",
    "dof": "bodyid jntid parentid treeid Madr simplenum frictionloss armature damping dampingpoly invweight0 M0 length",
    "geom": "type contype conaffinity condim bodyid dataid matid priority plugin sameframe size aabb rbound pos quat "
    "friction adhesion surfacevel solmix margin gap fluid castshadow rgba",
    "pair": "dim geom1 geom2 signature solreffriction margin gap friction adhesion",
    "site": "type bodyid dataid matid sameframe size pos quat rgba",
    "eq": "type obj1id obj2id objtype active0 data",
    "tendon": "actuatorid adr num treenum treeid matid plasticadr type limited actfrclimited width solref_lim "
    "solimp_lim solref_fri solimp_fri range actfrcrange margin stiffness stiffnesspoly damping dampingpoly "
    "armature frictionloss springyield lengthspring length0 invweight0 rgba",
    "actuator": "trntype dyntype gaintype biastype ctrladr ctrlnum ctrlspec outadr outnum actadr actnum trnid "
    "cranklength dynprm gainprm biasprm actlimited actrange actearly history historyadr delay damping dampingpoly "
    "armature plugin forcelimited forcerange ctrllimited ctrlrange gear acc0 length0 lengthrange",
}
_FLAGS = {"disableflags": 20, "enableflags": 8}  # bits
_OPTIONS = (
    "timestep impratio tolerance ls_tolerance noslip_tolerance ccd_tolerance sleep_tolerance gravity wind magnetic "
    "density viscosity o_margin o_solref o_solimp o_friction integrator cone jacobian solver iterations ls_iterations "
    "noslip_iterations ccd_iterations disableflags enableflags disableactuator sdf_initpoints sdf_iterations"
)
_ONE_OF_EACH = """<mujoco><worldbody><body name="a"><joint name="j"/><geom name="g" size="1"/><site name="s"/></body>
<body name="b"><joint/><geom name="h" size="1"/></body></worldbody><contact><pair geom1="g" geom2="h"/></contact>
<equality><connect body1="a" anchor="0 0 0"/></equality><tendon><fixed><joint joint="j" coef="1"/></fixed></tendon>
<actuator><motor joint="j"/></actuator></mujoco>"""


def note_omitted(model: Any, collisions: bool | str, choices: LoaderChoices, notes: Notes) -> None:
    """Notes on the elements and attributes of the file that the mechanism lacks."""
    for row in _ROWS:
        if row.kind in ("geom", "pair") and not (choices.ground or collisions):
            continue
        if row.text == (_ROLLING if choices.turning_friction else _ONE_ROLLING):
            continue
        found = np.flatnonzero(row.found(model))
        if len(found):
            notes.add(row.text, [name_of(model, row.kind, int(k)) for k in found], warn=row.warn)
    _note_collisions(model, collisions, notes)
    if model.ntendon:
        felt = any(np.any(getattr(model, f"tendon_{field}")) for field in _FORCES_OF_TENDONS.split())
        notes.add("tendons are omitted", [name_of(model, "tendon", k) for k in range(model.ntendon)], warn=felt)
    if model.dof_dampingpoly.any():
        rough = sorted({int(model.dof_jntid[d]) for d in np.flatnonzero(model.dof_dampingpoly.any(axis=1))})
        notes.add("nonlinear damping is omitted", [name_of(model, "joint", j) for j in rough], warn=True)
    if model.opt.density or model.opt.viscosity:
        notes.add("the drag of a fluid is omitted", warn=True)
    if np.any(model.tree_sleep_policy == _ASLEEP):
        notes.add("bodies that begin asleep are awake here", warn=True)
    unknown = _unknown(model)
    if unknown:
        notes.add(
            "fields of this version of MuJoCo's model that are unknown here and not the default", unknown, warn=True
        )


def _note_collisions(model: Any, collisions: bool | str, notes: Notes) -> None:
    """Notes on bodies, pairs and margins without collisions."""
    pairs = range(0 if contacts_disabled(model) else model.npair)
    ends = [(int(model.geom_type[model.pair_geom1[k]]), int(model.geom_type[model.pair_geom2[k]])) for k in pairs]
    missing = [name_of(model, "pair", k) for k in pairs if PLANE not in ends[k]]
    if missing and collisions is not True:
        notes.add("explicit contact pairs, but for those with planes, are omitted (collisions=True has them)", missing)
    wide = np.flatnonzero(_touching(model) & (model.geom_margin != 0.0))
    if collisions == "self" and len(wide):
        text = "margins of geoms are those of contacts with planes only; collisions=True has those of others"
        notes.add(text, [name_of(model, "geom", int(g)) for g in wide], warn=True)
    moving = [g for g in range(model.ngeom) if model.body_weldid[model.geom_bodyid[g]] != 0]
    types, affinities = model.geom_contype[moving], model.geom_conaffinity[moving]
    if collisions or not len(moving) or contacts_disabled(model):
        return
    if np.any(types[:, None] & affinities[None, :]):
        notes.add("bodies do not collide with one another (collisions=True lets them)")


def _unknown(model: Any) -> list[str]:
    """Fields of the model that no file of this folder knows, and that differ from their default."""
    import mujoco

    found = [name for name in _fields(model.opt) if name not in _OPTIONS.split()]
    usual = mujoco.MjOption()
    out = [f"option.{name}" for name in found if np.any(getattr(model.opt, name) != getattr(usual, name))]
    out += [f"option.{name}" for name, bits in _FLAGS.items() if int(getattr(model.opt, name)) >> bits]
    new = [name for name in _fields(model) if _is_new(name)]
    if not new:
        return out
    reference = mujoco.MjModel.from_xml_string(_ONE_OF_EACH)
    for name in new:
        given, default = getattr(model, name), getattr(reference, name)
        if isinstance(given, np.ndarray) and given.shape[1:] == default.shape[1:] and np.any(given != default[:1]):
            out.append(name)
    return out


def _fields(part: Any) -> list[str]:
    """Names of the data of a part of the model."""
    return [name for name in dir(part) if not name.startswith("_") and not callable(getattr(part, name))]


def _is_new(name: str) -> bool:
    """Whether a field is one of an element that this folder reads, but unknown, and neither an index nor a count."""
    kind, _, rest = name.partition("_")
    known = f"{_KNOWN[kind]} {_NUMERICS}".split() if kind in _KNOWN and rest else [rest]
    return rest not in known and not rest.endswith(("adr", "id", "num"))
