"""The next experiment."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from spa_fo.api.campaign import Campaign
from spa_fo.api.show import card
from spa_fo.gap.decide.nominal import driven_by_pressure
from spa_fo.gap.plan.advice import Advice, plan_campaign
from spa_fo.gap.plan.profiles import Profile, write_profile
from spa_fo.gap.plan.rivals import Standing

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def plan_next(
    campaign: Campaign,
    standing: Standing,
    max_duration_s: float | None = None,
    max_pressure_kpa: float | None = None,
) -> Plan:
    """Plan what follows a diagnosis; see `spa_fo.gap.plan.advice.plan_campaign`."""
    data = campaign.data
    if not data.campaign.command_is_pressure:  # a profile is one of pressures
        data = driven_by_pressure(data)
    advice = plan_campaign(data, standing, max_duration_s, max_pressure_kpa)
    return Plan(advice, campaign)


@dataclass(frozen=True)
class Plan:
    """A command profile to run next, and why.

    Attributes
    ----------
    advice : spa_fo.gap.plan.advice.Advice
        The profile, its purpose, the scores of all profiles.
    campaign : Campaign
        What it goes on from.
    """

    advice: Advice
    campaign: Campaign

    @property
    def profile(self) -> Profile:
        """The command, each row held until the next."""
        return self.advice.profile

    def save(self, path: Path | str) -> None:
        """Write the profile as csv, for ``spa-fo record --profile``."""
        write_profile(path, self.advice.profile, self.advice.purpose)

    def plot(self) -> Figure:
        """Draw the command over time."""
        from spa_fo.api.figures import marked
        from spa_fo.report.campaign_figure import profile_figure

        figure = profile_figure(self.profile, self.advice.purpose)
        return marked(figure, self.campaign.provenance)

    def __str__(self) -> str:
        return str(self.advice)

    def _repr_html_(self) -> str:
        return card(
            f"Next experiment for {self.campaign.name}",
            [self.advice.text, f"purpose: {self.advice.purpose}"],
            muted=self.campaign.provenance,
        )
