"""The second rig of the blind benchmark: its own solver, its own forms, no code of what it judges.

The fractional damping is a bank of Maxwell elements stepped in time with the nonlinear moments in
the loop; a specimen lives on one clock from its first trial to its last, rests included, so what
carries over between trials does so by itself.
"""

from collections.abc import Mapping

from blind.second_rig.case import write_case
from blind.second_rig.effects import LIBRARY
from blind.second_rig.foreign import EQUIVALENTS
from blind.second_rig.further import DRAWS

NAME: str = "second_rig"
EFFECTS: tuple[str, ...] = tuple(LIBRARY)
FURTHER: tuple[str, ...] = tuple(DRAWS)
FOREIGN: Mapping[str, tuple[str, ...]] = EQUIVALENTS

__all__ = ["EFFECTS", "FOREIGN", "FURTHER", "NAME", "write_case"]
