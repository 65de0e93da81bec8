"""The model that is judged, and what a diagnosis is worth on trials nobody has seen."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from blind.judge.records import Realised
from spa_fo.identify import fit_campaign, predict_campaign
from spa_fo.plant import Model, read_model, write_model
from spa_fo.rig import CampaignData, read_campaign, read_trials


def campaign_data(folder: Path) -> CampaignData:
    """Read a campaign's trials."""
    return read_trials(read_campaign(folder))


def fitted_model(data: CampaignData, seed: int) -> Model:
    """Identify the plain model of a campaign."""
    return fit_campaign(data, seed=seed, bootstrap=None).model


def judged_model(case: Path, out: Path, seed: int) -> Path:
    """Name the file of a case's plain model, made in `out` where the case hands none out.

    It is identified on the campaign before the effect where there is one, else on the campaign
    that is diagnosed itself.

    Raises
    ------
    BadInput
        A file cannot be read or used.
    """
    given, made = case / "model.json", out / "model.json"
    if given.is_file():
        return given
    if not made.is_file():
        write_model(made, plain_model(case, seed))
    return made


def plain_model(case: Path, seed: int) -> Model:
    """Read the model that a case hands out, or identify it as `judged_model` says."""
    given, earlier = case / "model.json", case / "earlier"
    if given.is_file():
        return read_model(given)
    return fitted_model(campaign_data(earlier if earlier.is_dir() else case / "campaign"), seed)


def rmse_deg(model: Model, data: CampaignData, source: Path | str = "model") -> float:
    """RMS error of a model over all samples of all trials, deg; `source` is for messages."""
    table = predict_campaign(model, data, source)
    return float(np.sqrt(np.mean((table["angle_deg"] - table["predicted_deg"]) ** 2)))


def realise(case: Path, out: Path, seed: int) -> Realised | None:
    """Run three models on the unseen trials of a case, where the diagnosis claims a shrink.

    Parameters
    ----------
    case : Path
        Folder of the case: ``campaign/`` is what the diagnosis saw, ``later/`` what it did not.
    out : Path
        Folder of the diagnosis.
    seed : int
        Of the third, the plain model identified again on ``campaign/``.

    Returns
    -------
    Realised or None
        None where nothing is claimed.

    Raises
    ------
    BadInput
        A file cannot be read or used.
    """
    if json.loads((out / "diagnosis.json").read_text(encoding="utf-8")).get("shrink") is None:
        return None
    unseen = campaign_data(case / "later")
    given, augmented = judged_model(case, out, seed), out / "augmented_model.json"
    plain = read_model(given)
    refitted = plain if _is_own(case) else fitted_model(campaign_data(case / "campaign"), seed)
    return Realised(
        before_deg=rmse_deg(plain, unseen, given),
        after_deg=rmse_deg(read_model(augmented), unseen, augmented),
        refit_deg=rmse_deg(refitted, unseen),
    )


def _is_own(case: Path) -> bool:
    """Whether the judged model is the one identified on the campaign itself."""
    return not (case / "model.json").is_file() and not (case / "earlier").is_dir()
