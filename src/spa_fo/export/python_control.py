"""For python-control: a StateSpace, and a file that builds it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from spa_fo.arrays import Floats

if TYPE_CHECKING:
    from control import StateSpace

    from spa_fo.export.exported import Exported

PADE_ORDER = 4


def control_system(made: Exported, pade_order: int = PADE_ORDER) -> StateSpace:
    """Return the exported model as a `control.StateSpace`.

    Parameters
    ----------
    made : Exported
        From `export_model`.
    pade_order : int
        Of the Padé approximation of the dead time, where the model has one: python-control has
        no delays.
    """
    import control

    form = made.rational.state_space()
    system = control.ss(
        form.A, form.B, form.C, form.D, inputs=["u"], outputs=["angle_rad"], name="actuator"
    )
    if made.part.dead_time_s:
        delay = control.tf(*control.pade(made.part.dead_time_s, pade_order))
        system = control.series(control.ss(delay), system)
    system.__doc__ = "\n".join(made.statement())
    return system


def python_file(made: Exported) -> str:
    """Return a Python file whose ``actuator()`` builds the system; it needs control and numpy."""
    form = made.rational.state_space()
    matrices = "\n".join(
        f"{name} = {_literal(value)}"
        for name, value in (("A", form.A), ("B", form.B), ("C", form.C), ("D", form.D))
    )
    statement = "\n".join(made.statement()).replace("\\", "/").replace('"', "'")
    return _FILE.format(
        statement=statement,
        matrices=matrices,
        dead_time=repr(made.part.dead_time_s),
        reference=repr(made.model.reference_kpa),
        pade=PADE_ORDER,
    )


_FILE = '''"""{statement}"""

import control
import numpy as np

REFERENCE_KPA = {reference}  # u = pressure / REFERENCE_KPA
DEAD_TIME_S = {dead_time}
{matrices}


def actuator(pade_order={pade}):
    """Return a control.StateSpace from u to the bending angle (rad).

    A dead time is replaced by its Pade approximation of order `pade_order`.
    """
    system = control.ss(A, B, C, D, inputs=["u"], outputs=["angle_rad"], name="actuator")
    if DEAD_TIME_S:
        delay = control.ss(control.tf(*control.pade(DEAD_TIME_S, pade_order)))
        system = control.series(delay, system)
    return system


if __name__ == "__main__":
    print(actuator())
    print("static gain", control.dcgain(actuator()), "rad")
'''


def _literal(matrix: Floats) -> str:
    rows = ",\n        ".join(f"[{', '.join(_number(value) for value in row)}]" for row in matrix)
    return f"np.array(\n    [\n        {rows},\n    ]\n)"


def _number(value: Any) -> str:
    return repr(float(value)) if np.any(value) else "0.0"
