"""Campaigns of a linear actuator with one law at one place, for tests."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

import campaigns
from spa_fo import simulate
from spa_fo.plant import PARAMETERS, Model, TransferFunction, write_model
from spa_fo.plant.chain import chain_for
from spa_fo.plant.effects.library import absent
from spa_fo.plant.grid import campaign_grid
from spa_fo.plant.law import Law
from spa_fo.plant.lawful import with_law
from spa_fo.rig import CampaignData, read_campaign, read_trials

X = np.array([campaigns.TRUTH[name] for name in PARAMETERS])
RATE_HZ = 25.0
LEVELS = {
    "step_low": ((0.0, 1.0), (15.0, 9.0), (0.0, 5.0)),
    "step_high": ((0.0, 1.0), (45.0, 9.0), (0.0, 5.0)),
    "stairs": ((0.0, 1.0), (10.0, 6.0), (22.0, 6.0), (34.0, 6.0), (46.0, 6.0), (18.0, 6.0)),
}


def command(levels: tuple[tuple[float, float], ...]) -> np.ndarray:
    return np.concatenate([np.full(round(s * RATE_HZ), kpa) for kpa, s in levels])


def write(
    folder: Path, law: Law | Callable[[np.ndarray], np.ndarray] | None, trials: int = 3
) -> CampaignData:
    """Write a campaign, trials interleaved; a function acts on the pressure, a law where it says.

    Each trial has a gain and a rest angle of its own, and noise.
    """
    experiments = []
    rng = np.random.default_rng(5)
    for place, (name, levels) in enumerate(LEVELS.items()):
        entries = []
        for trial in range(trials):
            order = trial * len(LEVELS) + place + 1
            file = f"{name}/trial_{trial + 1:02d}.csv"
            u = command(levels)
            bent = law(u) if callable(law) else u
            t = np.arange(u.size) / RATE_HZ
            angle = np.degrees(simulate(t, bent / campaigns.REFERENCE_KPA, *X, hold="zero"))
            _log(folder / file, t, u, angle)
            entries.append({"file": file, "order": order, "started_s": 90.0 * (order - 1)})
        protocol = "staircase" if name == "stairs" else "step_release"
        experiments.append(
            {"name": name, "setpoint_deg": None, "protocol": protocol, "trials": entries}
        )
    document = campaigns.document(folder.name, experiments)
    campaigns.write_yaml(folder, document)
    campaigns.write_sums(folder)
    data = read_trials(read_campaign(folder))
    if isinstance(law, Law):
        data = _through(data, law)
    scattered = []
    for trial in data.trials:
        gain, rest = 1.0 + 0.005 * rng.normal(), 0.1 * rng.normal()
        noise = rng.normal(0.0, campaigns.NOISE_DEG, trial.t_s.size)
        angle = gain * trial.angle_deg + rest + noise
        scattered.append(replace(trial, angle_deg=angle))
        file = folder / trial.experiment / f"trial_{trial.trial:02d}.csv"
        _log(file, trial.t_s, trial.command_kpa, angle)
    campaigns.write_sums(folder)
    return replace(data, trials=tuple(scattered))


def _log(path: Path, t_s: np.ndarray, u: np.ndarray, angle: np.ndarray) -> None:
    rows = [f"{a:.4f},{b:.2f},{c:.4f}" for a, b, c in zip(t_s, u, angle, strict=True)]
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("t,command,angle\n" + "\n".join(rows) + "\n")


def _through(data: CampaignData, law: Law) -> CampaignData:
    """Run a law's chain on fine steps through all trials."""
    grid = campaign_grid(data.trials, longest=0)
    chain = with_law(chain_for(grid, X, campaigns.REFERENCE_KPA), law)
    reading, _ = chain.readings(X, absent())
    place = {trial.order: i for i, trial in enumerate(grid.trials)}
    trials = []
    for trial in data.trials:
        i = place[trial.order]
        step, share = grid.locate(i, trial.t_s)
        angle = chain.logged(reading, absent(), step, share, np.full(step.size, i))
        trials.append(replace(trial, angle_deg=angle))
    return replace(data, trials=tuple(trials))


def write_plain(path: Path, campaign: str = "elsewhere") -> Path:
    """Write the plain model that the campaigns are of, as if it were identified elsewhere."""
    model = Model(campaign, "test rubber", TransferFunction(*X), campaigns.REFERENCE_KPA)
    write_model(path, model)
    return path
