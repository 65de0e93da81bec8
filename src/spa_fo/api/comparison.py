"""What changed between two campaigns of one actuator."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from spa_fo.api.model import Model
from spa_fo.api.show import card, text_table
from spa_fo.compare import Comparison as Compared
from spa_fo.compare import compare_pressure
from spa_fo.errors import BadInput
from spa_fo.gap.decide.examine import silent
from spa_fo.gap.diagnose import check_effects
from spa_fo.plant.effects.own import use_effects_of
from spa_fo.rig import read_campaign, read_trials

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_COLUMNS = ("what changed", "probability")
_MOST = 6


@dataclass(frozen=True)
class Comparison:
    """What a comparison found.

    Attributes
    ----------
    result : spa_fo.compare.Comparison
        With the curves.
    """

    result: Compared

    @classmethod
    def of_pressure(
        cls,
        reference: Path | str,
        campaign: Path | str,
        *,
        exclude: Sequence[str] = (),
        seed: int = 1,
        progress: Callable[[str], None] = silent,
    ) -> Comparison:
        """Compare two campaign folders by command and measured pressure alone.

        For logs without an angle; where there is one, it is not looked at. What changed can then be
        the drive, or nothing that is seen.

        Parameters
        ----------
        reference, campaign : path
            The earlier and the later one.
        exclude : sequence of str
            Effects to take out of the library.
        seed : int
            Of the held-out trials.
        progress : callable
            Told each step in words.

        Raises
        ------
        BadInput
            A campaign is unusable, or an effect is unknown.
        """
        before, after = (
            read_trials(read_campaign(each, angle=False), protocols="free")
            for each in (reference, campaign)
        )
        use_effects_of(after.campaign.folder)
        check_effects(exclude)
        return cls(compare_pressure(before, after, excluded=exclude, seed=seed, progress=progress))

    @property
    def document(self) -> Mapping[str, Any]:
        """As in comparison.json."""
        return self.result.to_dict()

    @property
    def kind(self) -> str:
        """nothing_changed, cause, ambiguous or unknown."""
        return self.result.kind

    @property
    def causes(self) -> tuple[tuple[str, ...], ...]:
        """Explanations of the change that stand, each a set of effects."""
        return self.result.change.sets

    @property
    def model(self) -> Model:
        """The reference's model with the change in it.

        Raises
        ------
        BadInput
            No angle was logged: there is none.
        """
        if self.result.model is None:
            raise BadInput(
                self.result.data.campaign.folder, "holds no angle; expected one to model"
            )
        return Model(self.result.model)

    def save(self, folder: Path | str) -> tuple[Path, ...]:
        """Write comparison.md, comparison.json, augmented_model.json and the figures, or none.

        Returns
        -------
        tuple of Path
            Figures and page, the page last.

        Raises
        ------
        BadInput
            A file cannot be written.
        """
        from spa_fo.report.change import write_comparison

        return write_comparison(self.result, folder)

    def plot(self, what: str = "measured") -> Figure:
        """Draw one of the page's figures.

        Parameters
        ----------
        what : {"measured", "change"}
            Both campaigns over each other; what is left without what is missed in both.

        Raises
        ------
        BadInput
            There is no such figure.
        """
        from spa_fo.api.figures import chosen
        from spa_fo.report.change import change_figure, measured_figure, provenance_of

        draw = {
            "measured": lambda: measured_figure(self.result),
            "change": lambda: change_figure(self.result),
        }
        return chosen(draw, what, provenance_of(self.result))

    def headline(self) -> tuple[str, str]:
        """Say what changed, and what that rests on, a line each."""
        from spa_fo.report.change import answer

        return answer(self.result)

    def _title(self) -> str:
        names = self.result.data.campaign.name, self.result.reference.campaign.name
        return f"What changed in {names[0]} since {names[1]}"

    def _rows(self) -> list[list[str]]:
        from spa_fo.report.causes import percent
        from spa_fo.report.effect_words import phrase

        causes = self.result.change.causes[:_MOST]
        names = [phrase(c.set) if c.set != ("none",) else "nothing" for c in causes]
        return [[name, percent(c.probability)] for name, c in zip(names, causes, strict=True)]

    def __str__(self) -> str:
        table = text_table(_COLUMNS, self._rows())
        return "\n".join([self._title(), *self.headline(), "", table])

    def _repr_html_(self) -> str:
        return card(self._title(), self.headline(), _COLUMNS, self._rows(), [])
