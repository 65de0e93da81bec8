# ---
# jupyter:
#   kernelspec: {display_name: Python 3, language: python, name: python3}
# ---
# %% [markdown]
# # Predict trials that were not fitted
#
# The model is identified on the up-steps. The releases, the staircase, the triangle and the long hold
# took no part: what it misses there is what a user of the model would miss.

# %%
from spa_fo import Campaign

campaign = Campaign.load("../../raw/fx_pro")
model = campaign.fit().model
prediction = model.predict(campaign)
prediction

# %%
prediction.plot()

# %% [markdown]
# The table holds every sample, as `spa-fo predict` writes it.

# %%
prediction.table.head()

# %% [markdown]
# A step of any height, exact to some 1e-13:

# %%
import numpy as np

model.step(np.array([0.5, 1.0, 2.0, 5.0, 20.0]), pressure_kpa=20.0).round(2)
