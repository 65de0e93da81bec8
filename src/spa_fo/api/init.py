"""From a folder of raw logs to a campaign: ``spa-fo init``."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from spa_fo.atomic import filling
from spa_fo.errors import BadInput
from spa_fo.rig.campaign import build_campaign
from spa_fo.rig.draft import WRITTEN, Draft, DraftExperiment, draft_campaign
from spa_fo.rig.draft_text import UNSURE, campaign_text
from spa_fo.rig.raw import read_bytes
from spa_fo.rig.trials import CampaignData, read_trials
from spa_fo.validation import load_yaml, package_schema, validate

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Initialised:
    """What was written.

    Attributes
    ----------
    folder : Path
        The campaign's.
    draft : Draft
        What was found in it.
    text : str
        campaign.yaml.
    """

    folder: Path
    draft: Draft
    text: str

    def __str__(self) -> str:
        draft = self.draft
        rows = [
            f"  {one.name}: {one.protocol}, {len(one.trials)} trial{'s' * (len(one.trials) > 1)}"
            for one in draft.experiments
        ]
        left = [f"  left out: {file}: {why}" for file, why in draft.left_out.items()]
        unsure = [
            f"  {line.strip().lstrip('# ')}" for line in self.text.splitlines() if UNSURE in line
        ][1:]
        title = f"{self.folder / WRITTEN[0]}: written, with checksums and a figure"
        heading = f"{len(unsure)} things are unsure; correct them in campaign.yaml:"
        return "\n".join([title, *rows, *left, heading, *unsure])


def init_campaign(folder: Path | str) -> Initialised:
    """Write campaign.yaml, SHA256SUMS and overview.png of the logs in a folder; replace nothing.

    Raises
    ------
    BadInput
        One of the first two is there already, or the logs make no campaign.
    """
    folder = Path(folder)
    for name in WRITTEN[:2]:
        if (folder / name).exists():
            raise BadInput(folder / name, "is there already; expected a folder of logs without it")
    draft = _readable(draft_campaign(folder))
    with filling(folder) as temporary:
        path = temporary / WRITTEN[0]
        text = campaign_text(draft)
        path.write_text(text, encoding="utf-8")
        data = _read(draft, path)
        (temporary / WRITTEN[1]).write_text(_sums(draft), encoding="utf-8")
        if not (folder / WRITTEN[2]).exists():
            _overview(data).savefig(temporary / WRITTEN[2], metadata={"Software": None})
    return Initialised(folder, draft, text)


def _readable(draft: Draft) -> Draft:
    """Leave out trials that the campaign's reader refuses, as a whole campaign would be."""
    left_out, kept = dict(draft.left_out), []
    for experiment in draft.experiments:
        trials = []
        for trial in experiment.trials:
            why = _refusal(draft, replace(experiment, trials=(trial,)))
            if why is None:
                trials.append(trial)
            else:
                left_out[trial.file] = why
        if trials:
            kept.append(replace(experiment, trials=tuple(trials)))
    if not kept:
        file, why = next(iter(left_out.items()))
        raise BadInput(draft.folder, f"holds no log that makes a trial; {file}: {why}")
    return replace(draft, experiments=tuple(kept), left_out=left_out)


def _refusal(draft: Draft, experiment: DraftExperiment) -> str | None:
    alone = replace(draft, experiments=(experiment,))
    with TemporaryDirectory() as temporary:
        path = Path(temporary) / WRITTEN[0]
        path.write_text(campaign_text(alone), encoding="utf-8")
        try:
            _read(alone, path)
        except BadInput as error:
            return error.expected
    return None


def _read(draft: Draft, path: Path) -> CampaignData:
    document = load_yaml(path)
    validate(document, package_schema("spa_fo.rig", "campaign.schema.yaml"), path)
    return read_trials(build_campaign(document, draft.folder))


def _sums(draft: Draft) -> str:
    return "".join(
        f"{hashlib.sha256(read_bytes(draft.folder / file, 'a log')).hexdigest()}  {file}\n"
        for file in draft.files
    )


def _overview(data: CampaignData) -> Figure:
    from spa_fo.report.campaign_figure import campaign_figure
    from spa_fo.report.style import mark_provenance

    figure = campaign_figure(data)
    mark_provenance(figure, "data as found, provenance not stated; units and protocols are guesses")
    return figure
