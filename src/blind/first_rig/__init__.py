"""The virtual rig as a rig of the blind benchmark (src/blind/CASE.md).

What a document asks for is read by `asked`; `programme` draws what is tried, `doses` an effect
(one of `foreign_effects`, of `measured_effects`, of `further_effects` with `reading_effects`, or of
the contract's), and `sizing` finds the amplitude that makes it as large as is asked. `campaign`
runs all that on a bench (`station`), adds `noise`, converts (`channel`) and writes `logs`. `case`
puts it together.
"""

from collections.abc import Mapping

from blind.first_rig.case import write_case
from blind.first_rig.doses import FORMS
from blind.first_rig.foreign_effects import FOREIGN_EFFECTS
from blind.first_rig.further_effects import FURTHER_FORMS
from blind.first_rig.measured_effects import MEASURED_EFFECTS

__all__ = ["EFFECTS", "FOREIGN", "FURTHER", "NAME", "write_case"]

NAME = "virtual_rig"
EFFECTS: tuple[str, ...] = tuple(FORMS["a"])
FOREIGN: Mapping[str, tuple[str, ...]] = {
    name: effect.equivalents for name, effect in FOREIGN_EFFECTS.items()
}
FURTHER: tuple[str, ...] = (*MEASURED_EFFECTS, *FURTHER_FORMS["a"])
