"""What repeated trials differ by among themselves: the noise that an estimate must answer to."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from spa_fo.identify.protocol import StepData


@dataclass(frozen=True)
class Noise:
    """Scatter of trials about the mean of their experiment, rad.

    Attributes
    ----------
    total : float
        Standard deviation of a sample.
    white : float
        Its part that changes from sample to sample, by successive differences (von Neumann 1941,
        doi:10.1214/aoms/1177731677).
    between : float
        The rest, common to neighbouring samples: trials differ in gain, offset and rate factor.
    common : float
        Standard deviation of the trials' mean deviations over time.
    points : int
        Points of each trial.
    repeated : bool
        False where no experiment has two trials: then the scatter is that of the fit's residuals.
    """

    total: float
    white: float
    between: float
    common: float
    points: int
    repeated: bool = True

    @property
    def design_effect(self) -> float:
        """How many samples of a trial are worth one independent sample (Kish 1965).

        The variance of a trial's mean, over what it would be if its samples were independent.
        """
        independent = self.total**2 / self.points
        return max(1.0, self.common**2 / independent) if self.total > 0 else 1.0


def trial_noise(data: StepData, residual_rad: float) -> Noise:
    """Measure the scatter within experiments, pooled.

    Parameters
    ----------
    data : StepData
        Step responses.
    residual_rad : float
        RMS residual of the fit, taken where no experiment has two trials.
    """
    squares = differences = means = 0.0
    freedom = 0
    for rows in data.groups.values():
        # Steps of several heights are alike in shape: their heights are no noise.
        u, angle = data.u[rows], data.angle_rad[rows]
        deviation = angle - np.outer(u, u @ angle / (u @ u))
        squares += float(np.sum(deviation**2))
        differences += float(np.sum(np.diff(deviation, axis=1) ** 2)) / 2.0
        means += float(np.sum(np.mean(deviation, axis=1) ** 2))
        freedom += rows.size - 1
    if freedom == 0:
        independent = residual_rad / float(np.sqrt(data.points))
        return Noise(residual_rad, residual_rad, 0.0, independent, data.points, repeated=False)
    total = squares / (freedom * data.points)
    white = min(total, differences / (freedom * (data.points - 1)))
    return Noise(
        total=float(np.sqrt(total)),
        white=float(np.sqrt(white)),
        between=float(np.sqrt(total - white)),
        common=float(np.sqrt(means / freedom)),
        points=data.points,
    )
