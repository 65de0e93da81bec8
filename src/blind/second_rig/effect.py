"""An effect: what it is called, which functional form it takes, and how large it is."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Scene:
    """The scales of a campaign that effects are drawn to.

    Attributes
    ----------
    top_kpa, top_input : float
        Largest command, as it is and over the reference.
    top_rad : float
        Largest angle of the bare body.
    length_s : float
        From the first trial's start to the end of the last.
    trials : int
        Their number.
    starts_s, lengths_s : tuple of float
        Campaign time at each trial's start, and its length.
    """

    top_kpa: float
    top_input: float
    top_rad: float
    length_s: float
    trials: int
    starts_s: tuple[float, ...] = ()
    lengths_s: tuple[float, ...] = ()


@dataclass(frozen=True)
class Effect:
    """One effect of a drawn form; of no consequence at amplitude 0.

    Attributes
    ----------
    id : str
        From effects.yaml, or a foreign name.
    form : str
        A short word for the functional form.
    unit : str
        What the amplitude means.
    limit : float
        The largest amplitude that is physically sensible.
    shape : mapping
        Drawn constants of the form.
    amplitude : float
        The size.
    series : ndarray
        Drawn numbers of those forms that happen at random.
    searched : bool
        Whether a larger amplitude need not be a larger change, so that a size must be searched for.
    """

    id: str
    form: str
    unit: str
    limit: float
    shape: Mapping[str, float]
    amplitude: float = 0.0
    series: Floats = field(default_factory=lambda: np.zeros(0))
    searched: bool = False

    def sized(self, amplitude: float) -> Effect:
        """Return the same effect at another amplitude."""
        return replace(self, amplitude=amplitude)

    def plain(self) -> dict[str, Any]:
        """Return form, amplitude and constants as plain data."""
        return {
            "form": self.form,
            "amplitude": self.amplitude,
            "amplitude_is": self.unit,
            "limit": self.limit,
            **{name: float(value) for name, value in self.shape.items()},
        }


Draw = Callable[[np.random.Generator, Scene], Effect]


def pick(rng: np.random.Generator, *options: str) -> str:
    """Draw one of the words."""
    return options[int(rng.integers(len(options)))]


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """Draw between low and high, evenly in the logarithm."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def sign(rng: np.random.Generator, positive: float = 0.5) -> float:
    """Draw +1 with the given probability, else -1."""
    return 1.0 if rng.random() < positive else -1.0
