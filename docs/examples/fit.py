# ---
# jupyter:
#   kernelspec: {display_name: Python 3, language: python, name: python3}
# ---
# %% [markdown]
# # Fit a model and read its uncertainty
#
# Each value has as many digits as its standard error justifies. The interval beside it is that of the
# profile likelihood: one parameter held, the others fitted again. An end marked `(open)` is where a
# bound of the search, not the data, ended it.

# %%
from spa_fo import Campaign

campaign = Campaign.load("../../raw/fx_pro")
fit = campaign.fit()
fit

# %% [markdown]
# The full report, as `spa-fo fit` prints it:

# %%
print(fit)

# %% [markdown]
# One parameter, and its numbers:

# %%
gain = fit.parameters["K"]
print("K =", gain.text(), gain.unit, "| 95 %:", gain.interval_text())
print("determined:", [name for name, one in fit.parameters.items() if one.determined])

# %%
fit.plot()

# %%
fit.plot("profiles")

# %% [markdown]
# The model's file keeps the uncertainty, the provenance and the sampling period:

# %%
import tempfile
from pathlib import Path

from spa_fo import Model

path = Path(tempfile.mkdtemp()) / "model.json"
fit.save(path)
model = Model.load(path)
model

# %%
model.plot()
