"""Contact: a point or ball of a body that cannot enter the ground."""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sim.mechanism import checks
from sim.mechanism.positional import few_positional
from sim.mechanism.terrain import Terrain

LAWS = ("impact", "linear", "nonlinear")


@few_positional
@dataclass(frozen=True)
class Contact:
    """A ball on a body that cannot enter the ground, the half-space normal . x < height.

    Attributes:
        body: name of the body.
        point: (3,) centre of the ball, from the centre of mass, body axes [m] (default the centre of mass).
        radius: radius of the ball; 0 is a point [m] (default 0).
        friction: coefficient of friction (default 0.5).
        law: "nonlinear", the friction cone; "linear", a four-sided pyramid inside it; or "impact", no friction (default
            "nonlinear").
        normal: (3,) outward normal of the ground, world axes (default z).
        height: height of the ground along its normal; of terrain, its rise [m] (default 0).
        name: name of the contact (default that of the body, numbered if the body has several).
        terrain: ground that is not a half-space, see `dojo.Terrain`, and `Mechanism.with_terrain` for all contacts
            (default None: the half-space).
        restitution: share of the normal velocity that an impact gives back, 0 to 1, see sim/contact/restitution.py
            (default 0).
        torsional_friction: largest moment about the normal, over the normal force [m] (default 0: none;
            docs/theory/interior_point.md).
        rolling_friction: largest moment across the normal, against rolling, over the normal force [m] (default 0).

    Raises:
        ValueError: for a value of the wrong shape or out of range; the message names the contact.
    """

    body: str
    point: ArrayLike = (0.0, 0.0, 0.0)  # from the centre of mass, body axes [m]
    radius: float = 0.0  # [m]
    _: KW_ONLY
    friction: float = 0.5
    law: str = "nonlinear"
    normal: ArrayLike = (0.0, 0.0, 1.0)
    height: float = 0.0  # [m]
    name: str = ""  # default: that of the body, numbered when it has several
    terrain: Terrain | None = None
    restitution: float = 0.0
    torsional_friction: float = 0.0  # [m]
    rolling_friction: float = 0.0  # [m]

    def __post_init__(self) -> None:
        checks.name("Contact(body=...)", self.body)
        call = f"Contact({checks.name_or('Contact(name=...)', self.name, self.body)!r}"
        object.__setattr__(self, "point", checks.vector(f"{call}, point=...)", self.point, 3))
        for field in ("radius", "friction", "torsional_friction", "rolling_friction"):
            value = checks.number(f"{call}, {field}=...)", getattr(self, field), at_least=0.0)
            object.__setattr__(self, field, value)
        checks.one_of(f"{call}, law=...)", self.law, LAWS)
        object.__setattr__(self, "normal", checks.direction(f"{call}, normal=...)", self.normal))
        object.__setattr__(self, "height", checks.number(f"{call}, height=...)", self.height))
        object.__setattr__(self, "restitution", checks.fraction(f"{call}, restitution=...)", self.restitution))
        if self.terrain is not None:
            self._put_on(f"{call}, terrain=...)", self.terrain)

    def _put_on(self, call: str, terrain: Terrain) -> None:
        """A slope is a half-space; other terrain lies above and below the level plane."""
        if not isinstance(terrain, Terrain):
            raise ValueError(f"{call}: expected a Terrain, got {terrain!r}")
        if self.normal != (0.0, 0.0, 1.0):
            raise ValueError(f"{call}: a contact with terrain has no normal of its own, got normal={self.normal}")
        if terrain.plane is not None:
            normal, height = terrain.plane
            object.__setattr__(self, "normal", normal)
            object.__setattr__(self, "height", height + self.height * normal[2])
            object.__setattr__(self, "terrain", None)

    def gap(self, centers: ArrayLike) -> NDArray[np.float64]:
        """Distance of the ball from the ground.

        Above terrain it is the height over the surface times the vertical part of the normal, right to first order.

        Args:
            centers: (..., 3) centres of the ball, world axes [m].

        Returns:
            (...,) distances [m], negative below the ground.

        Raises:
            ValueError: the centres have another shape, or are not finite.
        """
        at = checks.points("Contact.gap(centers)", centers)
        if self.terrain is None:
            return np.asarray(at @ np.asarray(self.normal) - self.radius - self.height)
        surface = self.terrain.surface(float(self.radius))
        return (at[..., 2] - surface.height(at[..., 0], at[..., 1]) - self.height) * self.normal_at(at)[..., 2]

    def normal_at(self, centers: ArrayLike) -> NDArray[np.float64]:
        """Outward normal of the ground at the ball.

        Args:
            centers: (..., 3) centres of the ball, world axes [m].

        Returns:
            (..., 3) unit normals, world axes.

        Raises:
            ValueError: the centres have another shape, or are not finite.
        """
        at = checks.points("Contact.normal_at(centers)", centers)
        if self.terrain is None:
            return np.array(np.broadcast_to(np.asarray(self.normal), at.shape))
        return self.terrain.surface(float(self.radius)).normal(at[..., 0], at[..., 1])
