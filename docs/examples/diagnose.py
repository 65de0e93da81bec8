# ---
# jupyter:
#   kernelspec: {display_name: Python 3, language: python, name: python3}
# ---
# %% [markdown]
# # Ask why model and actuator disagree, and what to measure next
#
# The campaign here is a small one, written by the virtual rig for this page: an actuator that stiffens
# as it bends, eight trials.

# %%
import tempfile
from dataclasses import replace
from pathlib import Path

from spa_fo import Campaign, Diagnosis
from spa_fo.virtual_rig.actuator import SoftActuator
from spa_fo.virtual_rig.actuators import DRAGON_SKIN_20, DRAGON_SKIN_20_CORE, REFERENCE_KPA
from spa_fo.virtual_rig.bench import Scatter, Specimen
from spa_fo.virtual_rig.campaign_writer import write_campaign
from spa_fo.virtual_rig.first_forms import Stiffening
from spa_fo.virtual_rig.flex_sensor import FlexSensor
from spa_fo.virtual_rig.syringe_pump import SyringePump

stiffening = SoftActuator(DRAGON_SKIN_20_CORE, REFERENCE_KPA, stiffening=Stiffening(lock_deg=130.0))
plan = replace(
    DRAGON_SKIN_20,
    name="bench",
    specimen=Specimen(
        pump=SyringePump(),
        actuator=stiffening,
        sensor=FlexSensor(),
        scatter=Scatter(gain=0.004, offset_deg=0.15, rate=0.005),
    ),
    experiments=tuple(e for e in DRAGON_SKIN_20.experiments if e.name != "hold_45"),
    order=(*("step_30", "step_60") * 3, "triangle", "staircase"),
    reset=None,
    wrap=None,
)
folder = Path(tempfile.mkdtemp())
write_campaign(plan, 1, folder / "bench")
campaign = Campaign.load(folder / "bench")
campaign

# %% [markdown]
# First the plain model, then the diagnosis. To keep this page quick, the library of effects is cut
# down to five; leave `exclude` away for all.

# %%
from spa_fo.plant.effects.library import IDS

kept = {"stiffening", "contact_stop", "creep", "hysteresis", "parameter_shift"}
model = campaign.fit().model
diagnosis = model.diagnose(campaign, exclude=[name for name in IDS if name not in kept])
diagnosis

# %%
diagnosis.plot("before_after")

# %%
diagnosis.plot("ladder")

# %% [markdown]
# The augmented model holds the explanation, and predicts like any other:

# %%
diagnosis.model.predict(campaign)

# %% [markdown]
# Save it all, load it again, and plan the next experiment.

# %%
diagnosis.save(folder / "diagnosis")
again = Diagnosis.load(folder / "diagnosis")
print(again)

# %%
plan = again.plan(campaign, max_duration_s=60)
plan

# %%
print(plan)
plan.save(folder / "next.csv")
plan.plot()
