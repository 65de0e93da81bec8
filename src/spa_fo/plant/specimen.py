"""What an actuator and its sensor bring along: what it remembers, and how the sensor came to it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spa_fo.arrays import Floats
from spa_fo.plant.effects.hysteresis import STOPS
from spa_fo.plant.effects.mullins_softening import MULLINS_LEVELS
from spa_fo.plant.effects.shared import CREEP_TIMES_S
from spa_fo.plant.memory import MODES
from spa_fo.plant.monotone import monotone_at, monotone_slopes

FILM = 5 + CREEP_TIMES_S.size
"""Numbers in the state of a sensor's film."""


def _film(values: Any) -> Floats:
    """Read the state of a film, also one that was written before lags had a tail."""
    film = np.asarray(values, dtype=np.float64)
    return np.append(film, 0.0) if film.shape == (FILM - 1,) else film


@dataclass(frozen=True)
class Memory:
    """What a specimen remembers: a virgin one by default.

    Attributes
    ----------
    modes : (MODES,) complex array
        Fractional memory.
    creep, stops, virgin, film : arrays
        Creep elements (rad), friction stops and last angle, virgin share by level, sensor film.
    play_kpa : (2,) array
        Position of a pump with play.
    ends_s : float
        Campaign time it holds for; NaN for a virgin specimen.
    rests_deg : float
        Angle at which a virgin specimen rests before its first log.
    """

    modes: NDArray[np.complex128] = field(default_factory=lambda: np.zeros(MODES, complex))
    creep: Floats = field(default_factory=lambda: np.zeros(CREEP_TIMES_S.size))
    stops: Floats = field(default_factory=lambda: np.zeros(STOPS + 1))
    virgin: Floats = field(default_factory=lambda: np.ones(MULLINS_LEVELS))
    film: Floats = field(default_factory=lambda: np.zeros(FILM))
    play_kpa: Floats = field(default_factory=lambda: np.zeros(2))
    ends_s: float = math.nan
    rests_deg: float = 0.0

    def copy(self) -> Memory:
        """Return one whose arrays may change."""
        return replace(
            self,
            **{
                name: getattr(self, name).copy()
                for name in ("modes", "creep", "stops", "virgin", "film", "play_kpa")
            },
        )

    def to_dict(self) -> dict[str, Any]:
        """Return lists and numbers, ready for JSON."""
        return {
            "modes": [[z.real, z.imag] for z in self.modes.tolist()],
            **{
                name: getattr(self, name).tolist()
                for name in ("creep", "stops", "virgin", "film", "play_kpa")
            },
            "ends_s": None if math.isnan(self.ends_s) else self.ends_s,
        }

    @classmethod
    def from_dict(cls, document: dict[str, Any]) -> Memory:
        """Read what `to_dict` wrote.

        Raises
        ------
        KeyError, TypeError, ValueError
            Something else was written.
        """
        fresh = cls()
        pairs = np.asarray(document["modes"], dtype=np.float64)
        if pairs.shape != (MODES, 2):
            raise ValueError(f"modes: expected {MODES} pairs of numbers")
        arrays: dict[str, Any] = {"modes": pairs[:, 0] + 1j * pairs[:, 1]}
        for name in ("creep", "stops", "virgin", "play_kpa"):
            arrays[name] = np.asarray(document[name], dtype=np.float64)
        arrays["film"] = _film(document["film"])
        for name, value in arrays.items():
            if value.shape != getattr(fresh, name).shape:
                raise ValueError(f"{name}: expected {getattr(fresh, name).size} values")
        ends_s = document["ends_s"]
        return cls(**arrays, ends_s=math.nan if ends_s is None else float(ends_s))


@dataclass(frozen=True)
class Mounting:
    """How the sensor comes from its first calibration.

    Attributes
    ----------
    film : array
        State of the film; a fresh one by default.
    known_deg, bias_deg : (k,) arrays
        What a sensor with hysteresis or creep read too much at the known angles, rising, which
        the calibrated curve has taken up.
    """

    film: Floats = field(default_factory=lambda: np.zeros(FILM))
    known_deg: Floats = field(default_factory=lambda: np.zeros(1))
    bias_deg: Floats = field(default_factory=lambda: np.zeros(1))

    @property
    def is_biased(self) -> bool:
        """Whether the calibration took anything up."""
        return bool(self.bias_deg.any())

    def logged_deg(self, reading_deg: Floats) -> Floats:
        """Give the angles that the calibrated curve makes of readings, same shape.

        The curve goes through what was read at the known angles as a calibration's does: a
        monotone cubic, straight on beyond its ends.
        """
        if not self.is_biased:
            return reading_deg
        read, slopes = self._curve
        return np.asarray(monotone_at(read, self.known_deg, slopes, reading_deg))

    @cached_property
    def _curve(self) -> tuple[Floats, Floats]:
        """Readings at the known angles, rising, and the curve's slopes there."""
        read = np.maximum.accumulate(self.known_deg + self.bias_deg)
        read = read + 1e-6 * np.arange(read.size)  # a reading that never falls back
        return read, np.asarray(monotone_slopes(read, self.known_deg))

    def to_dict(self) -> dict[str, list[float]]:
        """Return lists, ready for JSON."""
        return {name: getattr(self, name).tolist() for name in ("film", "known_deg", "bias_deg")}

    @classmethod
    def from_dict(cls, document: dict[str, Any]) -> Mounting:
        """Read what `to_dict` wrote.

        Raises
        ------
        KeyError, TypeError, ValueError
            Something else was written.
        """
        film = _film(document["film"])
        known, bias = (
            np.asarray(document[name], dtype=np.float64) for name in ("known_deg", "bias_deg")
        )
        if film.shape != (FILM,) or known.shape != bias.shape or known.ndim != 1:
            raise ValueError("film, known_deg and bias_deg do not belong together")
        return cls(film, known, bias)
