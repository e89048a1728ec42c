"""ParameterSpace: named parameters of a simulator as one vector, within their physical bounds."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import groupby
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from dojo_opt.identification import inertia_coordinates
from sim.mechanism import checks
from sim.simulator.simulator import Simulator
from solvers.types import Flags, Floats

_Row = tuple[float, float, float, float]  # value, low, high, scale
Chart = Callable[[Floats], tuple[Floats, Floats]]  # coordinates -> values of parameters, and their derivative

_VECTORS = ("orientation", "axis", "contact_normal")  # whose derivatives are those from where they have come to
_NOT_NEGATIVE = ("spring", "damper", "armature", "contact_radius")
_POSITIVE = (
    "mass",
    "time_step",
    "size_a",
    "size_b",
    "friction",
    "torsional_friction",
    "rolling_friction",
)  # a contact without friction is another law
_SMALL = 1e-3  # least scale of a value
_LEAST = 1e-6  # of the value: where positive parameters end


class _ParameterGroup(NamedTuple):
    """Coordinates that are seen in a few blocks of derivatives."""

    names: tuple[str, ...]  # of blocks
    columns: slice  # coordinates
    chart: Chart


class ParameterSpace:
    """Parameters of a simulator as one vector theta (n,), for fits:

        space = dojo.ParameterSpace(sim, ("friction:*", "damper"), bodies=("trunk",))
        def errors(theta): ... space.simulator(theta).rollout(x, us).x ...
        def slopes(theta): ... space.chain(theta, space.simulator(theta).linearize(x, u, wrt=space.wrt)) ...
        scipy.optimize.least_squares(errors, space.values, slopes, bounds=(space.low, space.high))

    The attributes `labels`, `values`, `low`, `high` and `scale` (n,) belong to theta; `values` are those of `sim`, but
    for a restitution of 0, which is 1e-6: without any, a contact has another law. `scale` has sizes of changes: the
    values, at least 1e-3; of the coordinates of bodies, 1 for logarithms and a radius of gyration for lengths.

    Args:
        sim: the simulator.
        names: names of parameters, as in `Simulator.parameters`; they are their own coordinates.
        bodies: names of bodies whose mass, centre of mass and inertia are fitted together, in ten coordinates in which
            every value is a physical body (inertia_coordinates.py). With `inertia` among the names instead, theta may
            leave the set of physical bodies; `simulator` then raises a ValueError.
        bounds: {name: (low, high)} of a label, or of all that begin with the name, as "damper"; within those that
            mechanisms have: masses, sizes, friction > 0, springs, dampers, armatures, radii >= 0, restitution from 1e-6
            to 1 (default None: the latter).

    Raises:
        ValueError: for an unknown name, a name given twice, no name at all, or bounds that exclude the value of `sim`.
    """

    def __init__(
        self,
        sim: Simulator,
        names: Sequence[str] = (),
        bodies: Sequence[str] = (),
        bounds: Mapping[str, tuple[float, float]] | None = None,
    ) -> None:
        call = "ParameterSpace"
        if not isinstance(sim, Simulator):
            raise TypeError(f"{call}(sim): expected a Simulator, got {sim!r}")
        names, bodies = checks.names(f"{call}(names)", names), checks.names(f"{call}(bodies=...)", bodies)
        self._sim = sim
        self._groups: list[_ParameterGroup] = []
        self._rows: dict[str, _Row] = {}
        found = sim.parameters(tuple(names))
        checks.distinct(f"{call}(names)", found.names)
        every = _of_several_sizes(found.names)
        for name, entries in groupby(
            zip(found.names, found.values, strict=True), key=lambda entry: _unit(entry[0], every)
        ):
            self._add(f"{call}(names)", name, *map(list, zip(*entries, strict=True)))
        for body in bodies:
            self._add_body(f"{call}(bodies=...)", body)
        if not self._groups:
            raise ValueError(f"{call}: expected names, or bodies=..., got none")
        asked = sim.parameters(tuple(name for group in self._groups for name in group.names)).names
        checks.distinct(f"{call}(names, bodies=...)", asked)
        for common in (name for name in asked if ":*" in name):
            clash = [name for name in asked if _kind(name) == _kind(common) and ":*" not in name]
            if clash:
                raise ValueError(f"{call}(names, bodies=...): {common!r} covers all parts, {clash[0]!r} included")
        self.labels = tuple(self._rows)
        columns = zip(*self._rows.values(), strict=True)
        self.values, self.low, self.high, self.scale = (np.array(column) for column in columns)
        self._narrow(f"{call}(bounds=...)", bounds)

    def __repr__(self) -> str:
        return f"ParameterSpace({self._sim.mechanism.name}, {len(self.labels)} values: {', '.join(self.labels)})"

    @property
    def wrt(self) -> tuple[str, ...]:
        """Names of the parameters whose derivatives `chain` needs."""
        return tuple(name for group in self._groups for name in group.names)

    def simulator(self, theta: ArrayLike) -> Simulator:
        """The simulator with other values of the parameters.

        Args:
            theta: (n,) the vector.

        Returns:
            The simulator; everything else is that of the first one.

        Raises:
            ValueError: for a wrong shape, a number that is not finite, or values that no mechanism has.
        """
        at = checks.array("ParameterSpace.simulator(theta)", theta, self.values.shape)
        changed: Simulator = self._sim.with_parameters(self.named(at))
        return changed

    def named(self, theta: ArrayLike) -> dict[str, Floats]:
        """The values at theta, by name, as `Simulator.with_parameters` and `set_parameters` take them.

        Args:
            theta: (n,) the vector.

        Returns:
            {name: (k,) values}.

        Raises:
            ValueError: for a wrong shape, or a number that is not finite.
        """
        at = checks.array("ParameterSpace.named(theta)", theta, self.values.shape)
        values: dict[str, Floats] = {}
        for group in self._groups:
            numbers, first = group.chart(at[group.columns])[0], 0
            for name in group.names:
                last = first + len(self._sim.parameters((name,)).values)
                values[name], first = numbers[first:last], last
        return values

    def chain(self, theta: ArrayLike, blocks: Mapping[str, ArrayLike]) -> Floats:
        """Derivatives by theta, from those by the parameters.

        Args:
            theta: (n,) the vector.
            blocks: derivatives (..., n_k) by the names of `wrt` of the simulator at theta, as `linearize`, `vjp`, or
                the `parameters` of `linearize_rollout` return them.

        Returns:
            (..., n) derivatives by theta.

        Raises:
            ValueError: for a wrong shape, or a missing block.
        """
        call = "ParameterSpace.chain"
        at = checks.array(f"{call}(theta)", theta, self.values.shape)
        for name in self.wrt:
            checks.one_of(f"{call}(blocks)", name, blocks.keys())
        parts = []
        for group in self._groups:
            block = np.concatenate([np.asarray(blocks[name]) for name in group.names], axis=-1)
            parts.append(block @ group.chart(at[group.columns])[1])
        return np.concatenate(parts, axis=-1)

    def slopes(self, theta: ArrayLike) -> Floats:
        """Derivatives of the parameters `wrt`, with all their components in this order, by theta.

        Args:
            theta: (n,) the vector.

        Returns:
            (m, n) derivatives.

        Raises:
            ValueError: for a wrong shape.
        """
        at = checks.array("ParameterSpace.slopes(theta)", theta, self.values.shape)
        blocks = [group.chart(at[group.columns])[1] for group in self._groups]
        out = np.zeros((sum(len(block) for block in blocks), len(at)))
        first = 0
        for group, block in zip(self._groups, blocks, strict=True):
            out[first : first + len(block), group.columns] = block
            first += len(block)
        return out

    @property
    def of_bodies(self) -> Flags:
        """(n,) which coordinates are those of bodies."""
        out = np.zeros(len(self.labels), dtype=np.bool_)
        for group in self._groups:
            out[group.columns] = group.chart is inertia_coordinates.body_of
        return out

    def _append(self, names: Sequence[str], chart: Chart, rows: Mapping[str, _Row]) -> None:
        """Coordinates by their labels."""
        first = len(self._rows)
        checks.distinct("ParameterSpace", (*self._rows, *rows))
        self._rows.update(rows)
        self._groups.append(_ParameterGroup(tuple(names), slice(first, first + len(rows)), chart))

    def _add(self, call: str, name: str, entries: list[str], values: list[float]) -> None:
        """A parameter, or the three of a direction or a rotation."""
        kind = _kind(name)
        chart = _CHARTS.get("scale" if name.endswith("[scale]") else kind, _plain)
        if kind in _VECTORS and (len(entries) != 3 or ":*" in name):
            given = ", ".join(entries)
            raise ValueError(f"{call}: {kind} is a vector; give all components of one part at a time, got {given}")
        if name.endswith("[scale]") and ":*" in name:
            raise ValueError(f"{call}: give the scale of one part at a time, got {name}")
        rows = {}
        for entry, value in zip(entries, values, strict=True):
            low, high = self._limits(entry, kind, value)
            inside = float(np.clip(value, low, high))
            rows[entry] = (inside, low, high, max(abs(inside), _SMALL))
        self._append([name], chart, rows)

    def _limits(self, name: str, kind: str, value: float) -> tuple[float, float]:
        """Admissible range; for `kind:*`, which shifts all parts equally, the intersection of their ranges."""
        if ":*" not in name:
            return _limits(kind, value)
        found = self._sim.parameters((kind,))
        component = name.partition("[")[2]
        same = [x for n, x in zip(found.names, found.values, strict=True) if n.partition("[")[2] == component]
        return value + _limits(kind, min(same))[0] - min(same), value + _limits(kind, max(same))[1] - max(same)

    def _add_body(self, call: str, body: str) -> None:
        """The ten coordinates of the mass, centre and inertia of a body."""
        names = (f"mass:{body}", f"com:{body}", f"inertia:{body}")
        values = self._sim.parameters(names).values  # mass, centre (3), inertia (6)
        start = inertia_coordinates.coordinates(
            f"{call}: body {body!r}", float(values[0]), values[inertia_coordinates.INERTIA]
        )
        labels = [f"{body}.{label}" for label in inertia_coordinates.LABELS]
        scale = inertia_coordinates.scale(start)
        free = {label: (float(x), -np.inf, np.inf, float(s)) for label, x, s in zip(labels, start, scale, strict=True)}
        self._append(names, inertia_coordinates.body_of, free)

    def _narrow(self, call: str, bounds: Any) -> None:
        """Bounds of single coordinates."""
        for name, pair in checks.mapping(call, bounds).items():
            rows = rows_of(call, name, self.labels)
            given = checks.floats(f"{call}: {name!r}", pair)
            if given.shape != (2,):
                raise ValueError(f"{call}: {name!r}: expected (low, high), got {checks.shown(pair)}")
            for k in rows:
                low, high = max(float(given[0]), self.low[k]), min(float(given[1]), self.high[k])
                if not low <= self.values[k] <= high or not low < high:
                    label = self.labels[k]
                    raise ValueError(f"{call}: {label!r} is {self.values[k]:g}, outside of {low:g} to {high:g}")
                self.low[k], self.high[k] = low, high


def rows_of(call: str, name: Any, labels: Sequence[str]) -> list[int]:
    """The coordinates that a name stands for: that of this label, or all of its parts and components.

    Args:
        call: beginning of the message.
        name: a label, or the part of it before ":" or "[".
        labels: of all coordinates.

    Returns:
        Their numbers.

    Raises:
        ValueError: there is none.
    """
    rows = [k for k, label in enumerate(labels) if label == name or label.startswith((f"{name}:", f"{name}["))]
    if not rows:
        checks.one_of(call, name, labels)
    return rows


def _kind(name: str) -> str:
    return name.partition(":")[0].partition("[")[0]


def _of_several_sizes(names: Sequence[str]) -> set[str]:
    """The `kind:*` of parts with and without components: then one name is that of the latter, and of all together."""
    common = {name for name in names if name.endswith(":*")}
    return {name.partition("[")[0] for name in names if "[" in name} & common


def _unit(name: str, every: set[str]) -> str:
    """The group of a coordinate: a whole vector, all of a `kind:*` in `every`, or a single parameter."""
    whole = name.partition("[")[0]
    return whole if name.startswith(_VECTORS) or whole in every else name


def _limits(kind: str, value: float) -> tuple[float, float]:
    """Admissible range of a kind of parameter."""
    if kind in _POSITIVE:
        return _LEAST * abs(value), np.inf
    if kind == "restitution":  # a contact without any is another law, without a derivative by it
        return _LEAST, 1.0
    if kind == "cone":
        return _LEAST, np.pi
    return (0.0 if kind in _NOT_NEGATIVE else -np.inf), np.inf


def _plain(theta: Floats) -> tuple[Floats, Floats]:
    return theta, np.eye(len(theta))


def _direction(theta: Floats) -> tuple[Floats, Floats]:
    """Derivatives are by a vector of length one."""
    return theta, np.eye(3) / np.linalg.norm(theta)


def _scale(theta: Floats) -> tuple[Floats, Floats]:
    """Derivatives are by a further factor."""
    return theta, np.array([[1.0 / theta[0]]])


def _rotation(theta: Floats) -> tuple[Floats, Floats]:
    """Derivatives are by a further rotation:

    exp(r + dr) = exp(r) exp(J dr),   J = 1 - (1 - cos a)/a^2 [r] + (a - sin a)/a^3 [r]^2,   a = |r|
    """
    a = float(np.linalg.norm(theta))
    x, y, z = theta
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    if a < 1e-4:
        return theta, np.eye(3) - 0.5 * K + K @ K / 6.0
    return theta, np.eye(3) - (1.0 - np.cos(a)) / a**2 * K + (a - np.sin(a)) / a**3 * K @ K


_CHARTS: dict[str, Chart] = {
    "orientation": _rotation,
    "axis": _direction,
    "contact_normal": _direction,
    "scale": _scale,
}
