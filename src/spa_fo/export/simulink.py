"""For MATLAB and Simulink: a script, which GNU Octave with its control package runs too."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from spa_fo.arrays import Floats
from spa_fo.export.rational import Complexes

if TYPE_CHECKING:
    from spa_fo.export.exported import Exported


def matlab_script(made: Exported) -> str:
    """Return a script that builds the system, its discrete filter and the blocks' parameters."""
    form, rational = made.rational.state_space(), made.rational
    filtered = made.filter
    return _SCRIPT.format(
        statement="\n".join(f"% {line}" for line in made.statement()),
        filter_statement=made.filter_accuracy.text(),
        reference=repr(made.model.reference_kpa),
        dead_time=repr(made.part.dead_time_s),
        zeros=_column(rational.zeros),
        poles=_complex_column(rational.poles),
        gain=repr(rational.leading_gain),
        A=_matrix(form.A),
        B=_matrix(form.B),
        C=_matrix(form.C),
        D=_matrix(form.D),
        sample_time=repr(filtered.sample_time_s),
        hold=filtered.hold,
        delay=filtered.delay_samples,
        sos=_matrix(filtered.sos),
    )


_SCRIPT = """{statement}
%
% Run it: it leaves actuator.sys (ss), actuator.sysz (zpk), actuator.sysd (discrete) and the
% parameters of Simulink's blocks in actuator.blocks. It needs the Control System Toolbox, or GNU
% Octave with its package control.

actuator = struct();
actuator.reference_kpa = {reference};  % u = pressure / reference_kpa
actuator.dead_time_s = {dead_time};
if exist('OCTAVE_VERSION', 'builtin')
  pkg load control
end

% Zeros, poles and gain. Do not turn them into tf: polynomial coefficients lose the digits.
actuator.zeros = {zeros};
actuator.poles = {poles};
actuator.gain = {gain};

% State-space form, a chain of sections: its eigenvalues are the poles.
actuator.A = {A};
actuator.B = {B};
actuator.C = {C};
actuator.D = {D};
actuator.sys = ss(actuator.A, actuator.B, actuator.C, actuator.D);
actuator.sysz = zpk(actuator.zeros, actuator.poles, actuator.gain);
if actuator.dead_time_s > 0 && ~exist('OCTAVE_VERSION', 'builtin')
  actuator.sys.InputDelay = actuator.dead_time_s;   % Octave's systems have no delays
  actuator.sysz.InputDelay = actuator.dead_time_s;
end

% Discrete filter ({hold}); {filter_statement}.
% Rows are b0 b1 b2 a0 a1 a2; delay_samples whole samples before it.
actuator.sample_time_s = {sample_time};
actuator.delay_samples = {delay};
actuator.sos = {sos};
actuator.sysd = c2d(ss(actuator.A, actuator.B, actuator.C, actuator.D), ...
                    actuator.sample_time_s, '{hold}');

% Parameters of Simulink's blocks, by the names of their masks.
actuator.blocks.StateSpace = struct('A', actuator.A, 'B', actuator.B, 'C', actuator.C, ...
                                    'D', actuator.D, 'X0', 0);
actuator.blocks.ZeroPole = struct('Zeros', actuator.zeros, 'Poles', actuator.poles, ...
                                  'Gain', actuator.gain);
actuator.blocks.TransportDelay = struct('DelayTime', actuator.dead_time_s);
actuator.blocks.Gain = struct('Gain', 1 / actuator.reference_kpa);
actuator.blocks.BiquadFilter = struct('SOSMatrix', actuator.sos, ...
                                      'ScaleValues', ones(size(actuator.sos, 1) + 1, 1), ...
                                      'SampleTime', actuator.sample_time_s);
"""


def _matrix(values: Floats) -> str:
    return "[" + "; ...\n  ".join(_row(row) for row in values) + "]"


def _row(values: Iterable[float]) -> str:
    return " ".join(repr(float(value)) if value else "0" for value in values)


def _column(values: Floats) -> str:
    return "[" + "; ".join(repr(float(value)) for value in values) + "]"


def _complex_column(values: Complexes) -> str:
    parts = [
        repr(float(v.real))
        + (f"{'+' if v.imag > 0 else '-'}{abs(float(v.imag))!r}i" if v.imag else "")
        for v in values
    ]
    return "[" + "; ".join(parts) + "]"
