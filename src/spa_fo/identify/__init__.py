"""From trials to a model: protocol, swarm, optimum, uncertainty, ablation."""

from spa_fo.identify.ablation import AblationOptions, ablate
from spa_fo.identify.ablation_verdict import AblationVerdict, ablation_verdict
from spa_fo.identify.bounds import (
    Bounds,
    free_bounds,
    own_bounds,
    printed_bounds,
    widened_bounds,
)
from spa_fo.identify.fit_campaign import NoGain, campaign_steps, fit_campaign
from spa_fo.identify.polish import Draws, Fits, Optimum, fit_many, fit_optimum
from spa_fo.identify.predict import predict_campaign, predict_trial
from spa_fo.identify.protocol import StepData, paper_selection, step_data
from spa_fo.identify.result import FitResult
from spa_fo.identify.swarm import SwarmResult, paper_swarm, swarm_on_map
from spa_fo.identify.uncertainty import Uncertainty, assess
from spa_fo.identify.whole_log import LogData, fit_whole_logs, log_data

__all__ = [
    "AblationOptions",
    "AblationVerdict",
    "Bounds",
    "Draws",
    "FitResult",
    "Fits",
    "LogData",
    "NoGain",
    "Optimum",
    "StepData",
    "SwarmResult",
    "Uncertainty",
    "ablate",
    "ablation_verdict",
    "assess",
    "campaign_steps",
    "fit_campaign",
    "fit_many",
    "fit_optimum",
    "fit_whole_logs",
    "free_bounds",
    "log_data",
    "own_bounds",
    "paper_selection",
    "paper_swarm",
    "predict_campaign",
    "predict_trial",
    "printed_bounds",
    "step_data",
    "swarm_on_map",
    "widened_bounds",
]
