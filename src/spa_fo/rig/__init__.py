"""From raw serial logs to trials: wire format, logs, calibration, campaign."""

from spa_fo.rig.calibration import Calibration, Drift
from spa_fo.rig.campaign import (
    CalibrationFile,
    Campaign,
    Experiment,
    PressureSensor,
    Provenance,
    TrialFile,
    read_campaign,
    read_description,
)
from spa_fo.rig.dwells import Dwell
from spa_fo.rig.log_format import Column, LogFormat
from spa_fo.rig.parse_report import Damage, FileReport, ParseReport
from spa_fo.rig.trial import Trial
from spa_fo.rig.trial_table import load_trials, write_trials
from spa_fo.rig.trials import CampaignData, read_trials

__all__ = [
    "Calibration",
    "CalibrationFile",
    "Campaign",
    "CampaignData",
    "Column",
    "Damage",
    "Drift",
    "Dwell",
    "Experiment",
    "FileReport",
    "LogFormat",
    "ParseReport",
    "PressureSensor",
    "Provenance",
    "Trial",
    "TrialFile",
    "load_trials",
    "read_campaign",
    "read_description",
    "read_trials",
    "write_trials",
]
