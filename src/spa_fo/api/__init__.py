"""The package's objects for a Python session: load, fit, predict, diagnose, export, plot, print.

Each is frozen, prints itself as text and, in a notebook, as HTML, and draws itself as matplotlib
figures. The commands are made of them. Whatever is wrong with a file raises
`spa_fo.errors.BadInput`, one clear line.
"""

from spa_fo.api.campaign import Campaign
from spa_fo.api.diagnosis import Diagnosis
from spa_fo.api.exported import ExportedModel
from spa_fo.api.fit import FitResult
from spa_fo.api.model import Model
from spa_fo.api.plan import Plan
from spa_fo.api.prediction import Prediction

__all__ = [
    "Campaign",
    "Diagnosis",
    "ExportedModel",
    "FitResult",
    "Model",
    "Plan",
    "Prediction",
]
