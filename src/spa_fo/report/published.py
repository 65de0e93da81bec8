"""What the workflow's steps left of each material, as the pages that show all of them take it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import pandas as pd

from spa_fo.report.provenance import joint_provenance_line, provenance_line
from spa_fo.rig import Campaign


@dataclass(frozen=True, kw_only=True)
class MeasuredMaterial:
    """One material, and what changed in it; where no angle was logged that is all there is.

    Attributes
    ----------
    name : str
        Its entry in config.yaml, and its folder in the results.
    campaign : Campaign
        What was measured.
    changed : Mapping or None
        As read from comparison.json; None where config.yaml names no reference.
    changed_page : str
        The comparison as Markdown.
    alone : bool
        Whether it is the only one of its material (see `told_apart`).
    """

    name: str
    campaign: Campaign
    changed: Mapping[str, Any] | None = None
    changed_page: str = ""
    alone: bool = True

    @property
    def label(self) -> str:
        """The material as people write it; with the entry's name, where others are of the same."""
        material = self.campaign.material
        return material if self.alone else f"{material} ({self.name})"

    @property
    def provenance(self) -> str:
        """The line that stands on everything made of it."""
        return provenance_line(self.campaign.provenance)


@dataclass(frozen=True, kw_only=True)
class PublishedMaterial(MeasuredMaterial):
    """A material that was identified and diagnosed, as the workflow's steps left it.

    Attributes
    ----------
    design : str or None
        The paper's actuator.
    fit, comparison, verdict : Mapping
        As read from fit.json, comparison.json and ablation.json; the last two may be None.
    ablation : pandas.DataFrame
        Rows of the ablation, may be empty.
    fit_report, parse_report : str
        As text and as Markdown.
    diagnosis : Mapping
        As read from diagnosis.json.
    diagnosis_page : str
        The diagnosis as Markdown.
    figures : tuple of str
        Names of the figures there are, without suffix.
    opening_png : bytes
        The picture that the diagnosis opens with.
    """

    design: str | None
    fit: Mapping[str, Any]
    comparison: Mapping[str, Any] | None
    verdict: Mapping[str, Any] | None
    ablation: pd.DataFrame
    fit_report: str
    parse_report: str
    diagnosis: Mapping[str, Any]
    diagnosis_page: str
    figures: tuple[str, ...]
    opening_png: bytes = b""


Material = TypeVar("Material", bound=MeasuredMaterial)


def identified(materials: Sequence[MeasuredMaterial]) -> list[PublishedMaterial]:
    """Return those that were identified and diagnosed."""
    return [material for material in materials if isinstance(material, PublishedMaterial)]


def told_apart(materials: Sequence[Material]) -> list[Material]:
    """Label campaigns of one material by their names, so that no row or curve stands for two."""
    count = Counter(material.campaign.material for material in materials)
    return [replace(m, alone=count[m.campaign.material] == 1) for m in materials]


def joint_provenance(materials: Sequence[MeasuredMaterial]) -> str:
    """Say where the data of several materials come from, in one line."""
    return joint_provenance_line(
        [material.label for material in materials], [m.provenance for m in materials]
    )
