"""Records of the blind benchmark: the truth about a case, the answer given, what came of it."""

from __future__ import annotations

from dataclasses import dataclass

from spa_fo.plant.effects.library import LIBRARY

Ids = frozenset[str]

NONE: Ids = frozenset({"none"})
UNKNOWN: Ids = frozenset({"unknown"})
SHIFT: Ids = frozenset({"parameter_shift"})
KINDS = ("closed", "further", "no_effect", "withheld", "alien", "pair", "several")
ALONE = ("closed", "further")
"""Kinds of one effect of the library: the contract's, and those beyond it."""
TOGETHER = ("pair", "several")
"""Kinds of more than one effect."""

VERDICTS = ("no_gap", "cause", "ambiguous", "unknown")
ERROR = "error"
"""Verdict of a diagnosis that ended in an error: an answer too."""

_RICH = ("rich", "everything")


@dataclass(frozen=True)
class Surroundings:
    """The bench around the actuator, as the case document asked for it.

    Attributes
    ----------
    noise_colour : {"exponential", "one_over_f"}
    coloured_deg : float
        Standard deviation of the coloured noise.
    correlation_s : float or None
        Its correlation time; None for 1/f noise.
    gain, time_scale : float
        Relative scatter from trial to trial.
    rest_deg : float
        Scatter of the rest angle.
    calibration : {"none", "before", "before_and_after"}
    fixture_deg : float
        Error of a calibration dwell's angle.
    rate_hz : float
    bits : int
        Of the converter.
    pressure : bool
        Whether it is measured.
    """

    noise_colour: str
    coloured_deg: float
    correlation_s: float | None
    gain: float
    time_scale: float
    rest_deg: float
    calibration: str
    fixture_deg: float
    rate_hz: float
    bits: int
    pressure: bool


@dataclass(frozen=True)
class Truth:
    """What is true of a case.

    Attributes
    ----------
    case : str
        Its name.
    rig : str
        Which made it.
    kind : str
        One of `KINDS`: as asked, but for ``further``, which is asked as ``closed``.
    effects : frozenset of str
        What is at work.
    equivalents : frozenset of str
        What would be a fair answer as well where the library lacks the effect; recorded with the
        case, before any diagnosis.
    size : float or None
        RMS change of the angle in multiples of the noise floor: as asked where it was reached,
        else the power of two below what was; None without an effect and with more
        than one.
    noise_floor_deg : float
        By which repeated trials of the specimen differ.
    protocol : str
        ``up_steps``, ``releases``, ``rich``, ``everything`` or ``single``.
    repeats : int
        Trials an experiment.
    order : {"interleaved", "blocked"}
    model : {"own", "earlier", "off"}
        Where the judged model is from: identified on the case's campaign, on an earlier one, or
        handed out with coefficients that are a little off.
    surroundings : Surroundings
    model_error_deg : float or None
        RMS error of a model that is off; None for the others.
    short : bool
        Whether an effect could not be made as large as asked.
    """

    case: str
    rig: str
    kind: str
    effects: Ids
    equivalents: Ids
    size: float | None
    noise_floor_deg: float
    protocol: str
    repeats: int
    order: str
    model: str
    surroundings: Surroundings
    model_error_deg: float | None = None
    short: bool = False

    @property
    def is_missing(self) -> bool:
        """Whether the library lacks the effect."""
        return self.kind in ("withheld", "alien")

    @property
    def is_rich(self) -> bool:
        """Whether its protocol shows enough for an effect to be named."""
        return self.protocol in _RICH and self.repeats >= 2

    @property
    def is_shifted(self) -> bool:
        """Whether the judged model is off, which is a shift of the parameters."""
        return self.model == "off"

    @property
    def stages(self) -> frozenset[str]:
        """Stages of the effects that the library knows."""
        return frozenset(LIBRARY[name].stage for name in self.effects if name in LIBRARY)

    def is_exactly(self, named: Ids) -> bool:
        """Say whether this is what is at work; a shift beside it may be named where there is one.

        Without an effect the shift of a model that is off may stand alone.
        """
        return named == self.effects or (self.is_shifted and named == self.effects | SHIFT)

    def fair(self, named: Ids) -> bool:
        """Say whether all that is named is at work, or a recorded equivalent of it.

        Beside such a name, or where nothing else is wrong, a model that is off may be said to be
        so.
        """
        right = self.effects | self.equivalents
        said_beside = self.is_shifted and (not self.effects or bool(named & right))
        return bool(named) and named <= (right | SHIFT if said_beside else right)


@dataclass(frozen=True)
class Claim:
    """The shrink that a diagnosis claims, with its 95 % interval."""

    fraction_closed: float
    low: float
    high: float


@dataclass(frozen=True)
class Answer:
    """What a diagnosis says.

    Attributes
    ----------
    verdict : str
        One of `VERDICTS`, or `ERROR`.
    sets : tuple of frozensets of str
        The verdict's sets.
    top : frozenset of str
        Most probable explanation; the first of equals; empty after an error.
    probability : float or None
        Of `top`; None after an error.
    stage : str or None
        Stage with the largest share of the gap; None where all shares are zero or none is known.
    claim : Claim or None
    message : str
        Of the error.
    """

    verdict: str
    sets: tuple[Ids, ...]
    top: Ids
    probability: float | None
    stage: str | None
    claim: Claim | None = None
    message: str = ""

    @property
    def names(self) -> bool:
        """Whether it offers its sets as the explanation, not as a part of one."""
        return self.verdict in ("cause", "ambiguous")


def failed(message: str) -> Answer:
    """Make the answer of a diagnosis that ended in an error."""
    return Answer(ERROR, (), frozenset(), None, None, message=message)


@dataclass(frozen=True)
class Realised:
    """RMS error on trials nobody has seen: plain model, augmented model, refitted plain model."""

    before_deg: float
    after_deg: float
    refit_deg: float


@dataclass(frozen=True)
class Outcome:
    """One case with its answer, and its unseen trials or why nothing could be said on them."""

    truth: Truth
    answer: Answer
    realised: Realised | None = None
    refused: str = ""
