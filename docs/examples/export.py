# ---
# jupyter:
#   kernelspec: {display_name: Python 3, language: python, name: python3}
# ---
# %% [markdown]
# # Use the model in python-control, Simulink or on a board
#
# Other tools know no fractional powers, so G(s) is replaced by a rational function. Its static gain is
# exact; everything else it misses is computed against the exact model and said.

# %%
from spa_fo import Campaign

model = Campaign.load("../../raw/fx_pro").fit().model
approximated = model.approximate()
approximated

# %%
approximated.plot()

# %% [markdown]
# With python-control: a closed loop with a PI controller.

# %%
import control
import numpy as np

actuator = model.to_control()
pi = control.tf([4.0, 3.0], [1.0, 0.0])
loop = control.feedback(control.series(control.ss(pi), actuator))
gain_margin, phase_margin, *_ = control.margin(control.series(control.ss(pi), actuator))
t, angle = control.step_response(loop, np.linspace(0.0, 10.0, 201))
print(f"phase margin {phase_margin:.1f}°, after 10 s at {angle[-1]:.3f} of the reference")

# %% [markdown]
# Oustaloup's filter for each power, which most of the literature uses:

# %%
print(model.approximate(method="oustaloup", order=5))

# %% [markdown]
# The discrete filter, for `scipy.signal.sosfilt` or a microcontroller:

# %%
approximated.filter.sos.round(6)

# %% [markdown]
# Files for others:

# %%
import tempfile
from pathlib import Path

folder = Path(tempfile.mkdtemp())
for to, name in (("python-control", "arm.py"), ("simulink", "arm.m"), ("csv", "arm.csv")):
    print(model.export(to, folder / name).name)
print(model.export("oustaloup", folder / "arm.json").name)
