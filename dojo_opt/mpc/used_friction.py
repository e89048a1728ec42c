"""UsedFriction: the friction that standing feet were seen to use, a lower bound of theirs.

A foot that stands tells nothing of its friction but that it is at least what it uses:

    mu >= |t|/n,    n, t: normal and tangential impulse of the foot over an interval

Impulses are those of a model that predicts the measured motion. An error s of the predicted velocities, by noise or
parameters, is an error m s of the impulses of a robot of mass m, and the feet carry its weight, sum n = m g T:

    error of |t|/n = s/(g T) sum n/n
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sim.mechanism.mechanism import Mechanism
from sim.simulator.results import Contacts
from solvers.types import Flags, Vector

_LEAST = 0.2  # share of the load that a foot carries, if its impulses are to tell anything
_SURE = 2.0  # errors of a ratio that are taken from it
_STICKS = 0.01  # [m/s] largest slip of a foot of the model that sticks

__all__ = ["UsedFriction"]


class UsedFriction:
    """Lower bounds of the frictions among parameters: `least` (n,), -inf of the others.

    Args:
        mechanism: the robot.
        labels: of the parameters; of any kind.
    """

    def __init__(self, mechanism: Mechanism, labels: Sequence[str]) -> None:
        names = mechanism.ground_contact_names
        self._gravity = float(np.linalg.norm(mechanism.gravity))
        own = [[label in ("friction:*", f"friction:{name}") for name in names] for label in labels]
        self._of = np.array(own, dtype=np.bool_).reshape(len(labels), len(names))  # whose friction a parameter is
        self.frictions = self._of.any(axis=1)  # (n,)
        self.forget()

    def forget(self) -> None:
        """Back to no bound."""
        self.least = np.where(self.frictions, 0.0, -np.inf)

    def observe(self, contacts: Contacts, stands: Flags, error: float) -> None:
        """Take the steps of an interval in which the model moved as the robot.

        Args:
            contacts: of the model, over T steps.
            stands: (ncontact,) the feet that stood.
            error: of the velocities that the model predicted [m/s].
        """
        count = self._of.shape[1]
        impulse, normals = contacts.impulse[:, :count], contacts.normals[:, :count]
        along = (impulse * normals).sum(axis=2, keepdims=True)
        n, t = along.sum(axis=(0, 2)), np.linalg.norm((impulse - along * normals).sum(axis=0), axis=1)
        load, time = float(n.sum()), len(impulse) * contacts.time_step
        tells = stands & ~self.sliding(contacts, stands) & (n > _LEAST * load)
        if load > 0.0 and self._gravity > 0.0 and tells.any():
            off = _SURE * error / (self._gravity * time) * load
            used = np.where(tells, (t - off) / np.where(tells, n, 1.0), 0.0)
            self.least = np.maximum(self.least, np.where(self._of, used, -np.inf).max(axis=1))

    def sliding(self, contacts: Contacts, stands: Flags) -> Flags:
        """The feet that slide in the model.

        Args:
            contacts: of the model, over T steps.
            stands: (ncontact,) the feet that stand on the ground.

        Returns:
            (ncontact,) of them.
        """
        return np.asarray(stands & (contacts.slip[:, : self._of.shape[1]].max(axis=0) > _STICKS))

    def tells(self, slides: Flags) -> Flags:
        """The parameters of which an interval tells something: no friction of which no foot slides.

        Args:
            slides: (ncontact,) the feet that slide.

        Returns:
            (n,) of the parameters.
        """
        return np.asarray(~self.frictions | (self._of & slides).any(axis=1))

    def bound(self, most: Vector, slides: Flags) -> None:
        """Lower the bounds of feet that slide: what they used before was on other ground.

        Args:
            most: (n,) largest values that the parameters may have.
            slides: (ncontact,) the feet that slide.
        """
        sliding = (self._of & slides).any(axis=1)
        self.least[sliding] = np.minimum(self.least, most)[sliding]
