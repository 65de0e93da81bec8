# ---
# jupyter:
#   kernelspec: {display_name: Python 3, language: python, name: python3}
# ---
# %% [markdown]
# # Load a campaign and look at it
#
# A campaign is a folder: `campaign.yaml`, and the raw logs as they came over the wire. Loading checks
# the bytes against `SHA256SUMS`, parses every line, and turns flex counts into angles.

# %%
from spa_fo import Campaign

campaign = Campaign.load("../../raw/dragon_skin_20")
campaign

# %% [markdown]
# The same as text, for a terminal:

# %%
print(campaign)

# %% [markdown]
# What was left out of each log, and why; and every sample as a table.

# %%
for file in campaign.parse_report.files:
    if file.damaged_lines:
        print(f"{file.file}: {file.why()}")

# %%
campaign.table().groupby("experiment")["angle_deg"].describe().round(2)

# %%
campaign.plot()

# %%
campaign.plot("calibration")
