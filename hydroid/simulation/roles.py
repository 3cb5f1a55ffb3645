"""What each joint of an arm does while it is simulated: asked here alone."""

import numpy as np

from hydroid.arrays import Mask, record
from hydroid.settings.problem import OtherJoints


@record
class Roles:
    """What the joints of an arm do, masks of shape (J,); those of no mask are locked.

    Attributes:
        active: have hydraulics, or a gain.
        passive: move on their spring and damper.
        following: follow their logged motion.
    """

    active: Mask
    passive: Mask
    following: Mask

    @property
    def simulated(self) -> Mask:
        """Joints whose motion comes from the simulation."""
        return self.active | self.passive

    @property
    def moving(self) -> Mask:
        """Joints that are not locked."""
        return self.simulated | self.following


def roles(active: Mask, others: OtherJoints, *, logged: bool = True) -> Roles:
    """Return what joints do, shape (J,), of which some are active.

    Without a `logged` motion to follow, others are locked that would follow one.
    """
    nobody = np.zeros_like(active)
    passive = nobody
    if others == "passive":
        passive = ~active
    following = nobody
    if others == "measured" and logged:
        following = ~active
    return Roles(active=active, passive=passive, following=following)
