"""The simulator with effects: command -> pressure -> angle -> reading, any number of them together.

One memory runs through a whole campaign, and through a later one that continues it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from spa_fo.arrays import Bools, Floats, Integers
from spa_fo.plant.branches import Branches, begun, came_before
from spa_fo.plant.effects.actuator import move
from spa_fo.plant.effects.channel_latency import read_earlier, smeared
from spa_fo.plant.effects.drive_backlash import resting_kpa
from spa_fo.plant.effects.hysteresis import STOPS
from spa_fo.plant.effects.library import LIBRARY
from spa_fo.plant.effects.own import acting
from spa_fo.plant.effects.sensor_slip import slipped
from spa_fo.plant.grid import CampaignGrid
from spa_fo.plant.grid_steps import rest_levels
from spa_fo.plant.memory import STEPS_S, Contour, contour_for, kept_or_chosen, rises
from spa_fo.plant.specimen import Memory, Mounting
from spa_fo.plant.stages import felt_angle, logged_angle, moving_pressure, true_pressure

_LATENCY = LIBRARY["channel_latency"].slots
_SLIP = LIBRARY["sensor_slip"].slots
_PLAY = LIBRARY["drive_backlash"].slots
_GRAVITY = LIBRARY["gravity_load"].slots
_REMEMBERED = 8  # loads of a chain
_HUNG = rest_levels(3600.0)  # for which a specimen without a past has hung under its weight


@dataclass(frozen=True)
class Usual:
    """What a plain model is known to miss of the true angle: its sensor reads that, too.

    Attributes
    ----------
    angle_deg : (steps,) array
        At the end of each step.
    gain : float
        Static gain of the coefficients that it was learned with; it grows as theirs does.
    begins_deg : float
        Before the first step.
    """

    angle_deg: Floats
    gain: float
    begins_deg: float = 0.0

    def of(self, x: Floats) -> Floats:
        """Give it for some coefficients, deg."""
        return static_gain(x) / self.gain * self.angle_deg


def static_gain(x: Floats) -> float:
    """Bending (rad) that one of u settles at: b0 / a0 of alpha2, alpha1, a1, a0, b0."""
    return float(x[4] / x[3])


@dataclass(frozen=True)
class Chain:
    """A campaign ready to be simulated many times.

    Attributes
    ----------
    grid : CampaignGrid
        The campaign.
    input_kpa : (cells,) array
        What enters: the command, or a pressure (then no drive effect acts).
    is_pressure : bool
        Which of the two it is.
    reference_kpa : float
        Pressure at which u = 1.
    contour : Contour
        Of the fractional memory, for coefficients near those that it was chosen for.
    memory : Memory
        What the specimen remembers at the start.
    mounting : Mounting
        How the sensor came from its first calibration.
    usual : Usual or None
        What is known to be missed of the true angle, without a reason.
    vented : (trials,) bool array or None
        Which trials began at rest, whatever pressure was known at their first row; None where that
        is what they rested under before.
    let_go : bool
        Whether all did, whatever a pump with play had left.
    branches : mapping
        Of loops of the sensor that logs begin on.
    """

    grid: CampaignGrid
    input_kpa: Floats
    is_pressure: bool
    reference_kpa: float
    contour: Contour
    memory: Memory = field(default_factory=Memory)
    mounting: Mounting = field(default_factory=Mounting)
    usual: Usual | None = None
    vented: Bools | None = None
    let_go: bool = False
    branches: Branches = field(default_factory=dict)

    def mounted(self, mounting: Mounting) -> Chain:
        """Return the chain with a sensor that comes from this calibration."""
        return self._of(replace(self.memory, film=mounting.film), mounting)

    def hung(self, x: Floats, effects: Floats) -> Chain:
        """Return the chain with a specimen without a past at rest under a weight, if there is one.

        Actuator and sensor have come to rest before the first log begins.
        """
        at_rest, memory = effects[_GRAVITY][-1], self.memory
        rests = memory.rests_deg != 0.0 or not math.isnan(memory.ends_s)
        if rests or math.isnan(at_rest) or at_rest == 0.0:
            return self
        level, c, memory = _HUNG, kept_or_chosen(self.contour, x), memory.copy()
        nothing, time_s = np.zeros(level.size), np.full(level.size, self.grid.middle_s[0])
        state = memory.modes, memory.creep, memory.stops, memory.virgin
        contour = c.nodes, c.angles, c.weights, c.keep, c.gain, c.tilt
        angle_deg = np.degrees(
            move(nothing, nothing, nothing, level, level, time_s, x, effects, *contour, *state)
        )
        self.read(angle_deg, effects, memory.film, level)
        return self._of(replace(memory, rests_deg=float(angle_deg[-1])), self.mounting)

    def _of(self, memory: Memory, mounting: Mounting) -> Chain:
        """Return the chain of another specimen, driven alike: what is known of the load stays."""
        made = replace(self, memory=memory, mounting=mounting)
        known = "_known_load" if self.is_pressure else "_loads"
        made.__dict__[known] = getattr(self, known)
        return made

    def pressure(self, effects: Floats, play: Floats) -> Floats:
        """Give the true pressure on the cells, kPa."""
        if self.is_pressure:
            return self.input_kpa
        return true_pressure(self.input_kpa, self.grid.cell_starts, effects, play)

    def run(self, x: Floats, effects: Floats) -> tuple[Floats, Memory]:
        """Simulate all trials.

        Parameters
        ----------
        x : (5,) array
            alpha2, alpha1, a1, a0, b0.
        effects : array
            Parameters of all effects in the library's order, NaN where absent.

        Returns
        -------
        angle_deg : (n,) array
            The reading at each averaged sample of the grid.
        memory : Memory
            At the end of the last trial.
        """
        chain = self.hung(x, effects)
        reading, memory = chain.readings(x, effects)
        return chain.observed(reading, effects), memory

    def readings(self, x: Floats, effects: Floats) -> tuple[Floats, Memory]:
        """Simulate all trials; the reading (deg) at the end of each step."""
        angle, memory = self.angles(x, effects)
        reading = self.read(angle, effects, memory.film)
        if self.branches:
            continues = not math.isnan(self.memory.ends_s)
            before = came_before(self.input_kpa, self.grid.cell_starts, continues)
            reading += begun(self.grid, self.branches, before, angle, effects)
        return reading, memory

    def angles(self, x: Floats, effects: Floats) -> tuple[Floats, Memory]:
        """Simulate all trials; the true angle (deg) at the end of each step, the film untouched."""
        memory = self.hung(x, effects).memory.copy()
        return self._moved(self._load(effects, memory.play_kpa), x, effects, memory)

    def _moved(
        self,
        load: Floats,
        x: Floats,
        effects: Floats,
        memory: Memory,
        steps: slice = slice(None),
        held: Floats | None = None,
        rise: Floats | None = None,
    ) -> tuple[Floats, Memory]:
        """Angle in some steps under the mean of u over each, `memory` carried on in place.

        To u, which has its `rise` within each step, comes what is `held` there.
        """
        width, centre, kept, _, vented, *_ = effects[_PLAY]
        if not (math.isnan(width) or self.is_pressure or self.let_go):
            load[self.grid.cells[steps] == 0] = (
                resting_kpa(width, centre, kept, vented) / self.reference_kpa
            )
        if held is not None:
            load = load + held
        if any(acting(effects, "actuator")):
            load, rise = self._pushed(load, x, effects, memory, steps), None
        angle = self._move(load, x, effects, memory, steps, rise)
        return angle, replace(memory, ends_s=self.grid.ends_s, rests_deg=0.0)

    def _pushed(
        self, load: Floats, x: Floats, effects: Floats, memory: Memory, steps: slice
    ) -> Floats:
        """Give the load with what effects of a campaign's own make of it."""
        kpa = self.reference_kpa
        before = math.degrees(memory.stops[STOPS] + memory.creep.sum())

        def angle(pressure: Floats) -> Floats:
            return self._move(pressure / kpa, x, effects, memory.copy(), steps)

        return moving_pressure(kpa * load, self.grid.level[steps], effects, before, angle) / kpa

    def _move(
        self,
        load: Floats,
        x: Floats,
        effects: Floats,
        memory: Memory,
        steps: slice,
        rise: Floats | None = None,
    ) -> Floats:
        """Move the actuator; the memory is carried on in place."""
        c = kept_or_chosen(self.contour, x)
        level = self.grid.level[steps]
        usual = np.zeros(level.size) if self.usual is None else self.usual.of(x)[steps]
        angle = move(
            load,
            rises(load, level) if rise is None else rise,
            np.radians(usual),
            level,
            self.grid.fading[steps],
            self.grid.middle_s[steps],
            x,
            effects,
            c.nodes,
            c.angles,
            c.weights,
            c.keep,
            c.gain,
            c.tilt,
            memory.modes,
            memory.creep,
            memory.stops,
            memory.virgin,
        )
        return np.degrees(angle)

    def read(
        self, angle_deg: Floats, effects: Floats, film: Floats, level: Integers | None = None
    ) -> Floats:
        """Read true angles at the ends of steps, the grid's or those of `level`.

        The state `film` is carried on in place.
        """
        level = self.grid.level if level is None else level
        return felt_angle(angle_deg, level, effects, film)

    def _load(self, effects: Floats, play: Floats) -> Floats:
        """Mean of u over each step, `play` carried on in place.

        It is remembered: most changes of parameters leave the drive as it is.
        """
        if self.is_pressure:
            return self._known_load
        key = effects[LIBRARY.of_stage("drive")].tobytes() + play.tobytes()
        found = self._loads.get(key)  # threads that share the chain may clear it meanwhile
        if found is None:
            if len(self._loads) >= _REMEMBERED:
                self._loads.clear()
            load = self.grid.step_means(self.pressure(effects, play)) / self.reference_kpa
            found = self._loads[key] = load, play.copy()
        load, play[:] = found
        return load.copy()

    @cached_property
    def _loads(self) -> dict[bytes, tuple[Floats, Floats]]:
        """Loads that are remembered, each with where it leaves a pump with play."""
        return {}

    @cached_property
    def _known_load(self) -> Floats:
        """Mean of u over each step; a trial begins as it has rested before."""
        grid = self.grid
        load = grid.step_means(self.input_kpa)
        begins = self.input_kpa[grid.cell_starts[:-1]]
        if self.vented is not None:
            begins = np.where(self.vented, 0.0, begins)
        rested = grid.step_starts[:-1] + grid.trial_steps
        for first, end, kpa in zip(rested[:-1], grid.step_starts[1:-1], begins[1:], strict=True):
            load[first:end] = kpa
        return load / self.reference_kpa

    def observed(self, reading: Floats, effects: Floats) -> Floats:
        """Take the reading at the grid's averaged samples, by each log's own zero if it has one."""
        grid = self.grid
        at = grid.sample_step, grid.sample_share, grid.sample_trial
        held_s = None if log_delays(effects) is None else grid.held_s
        return grid.zeroed(self.logged(reading, effects, *at, held_s))

    def logged(
        self,
        reading: Floats,
        effects: Floats,
        step: Integers,
        share: Floats,
        trial: Integers,
        held_s: Floats | None = None,
    ) -> Floats:
        """Take the reading at any samples; the log's delay and the slip act here.

        A specimen that hangs under a weight has to hang in this chain, too (`hung`).

        Parameters
        ----------
        reading : (steps,) array
            From `readings`, deg.
        effects : array
            Parameters of all effects, NaN where absent.
        step, share, trial : (n,) arrays
            Each sample's step, where in it the sample lies (0 to 1), and its trial as an index
            into the grid's.
        held_s : (n,) array, optional
            How long after the middle of its hold each sample was logged, where a log that is late
            holds its readings: a delay is that of the middle.
        """
        grid = self.grid
        # A film may read other than 0 at rest, and an actuator rest elsewhere.
        usual = 0.0 if self.usual is None else self.usual.begins_deg
        rest = np.full(1, usual + self.memory.rests_deg)
        at_rest = self.read(rest, effects, self.memory.film.copy(), grid.level[:1])
        before = np.concatenate([at_rest, reading[:-1]])
        delays = log_delays(effects)
        if delays is None:
            y = (1.0 - share) * before[step] + share * reading[step]
        else:
            at = (grid.level, grid.step_starts, step, share, trial)
            since = np.zeros(step.size) if held_s is None else held_s
            lates = np.maximum(np.add.outer(delays, since), 0.0)
            y = np.mean([read_earlier(before, reading, *at, late) for late in lates], axis=0)
        y = self.mounting.logged_deg(y)
        walk, zero = effects[_SLIP]
        if not math.isnan(walk):
            y = y + slipped(grid.orders, walk, zero)[trial]
        if any(acting(effects, "acquisition")):
            starts_s = np.array([one.started_s for one in grid.trials])
            at_s = grid.middle_s[step] + (share - 0.5) * STEPS_S[grid.level[step]]
            y = logged_angle(y, at_s - starts_s[trial], trial, effects)
        return self._misread(np.asarray(y), trial)

    def _misread(self, reading: Floats, trial: Integers) -> Floats:
        """Give what a law without a name makes of what is logged: nothing here."""
        return reading


def log_delays(effects: Floats) -> Floats | None:
    """Delays (s) that the log reads an angle with, each as often as the others; None without."""
    delay, window = effects[_LATENCY]
    return None if math.isnan(delay) else smeared(delay, window)


def chain_for(
    grid: CampaignGrid,
    x: Floats,
    reference_kpa: float,
    pressure_kpa: Floats | None = None,
    memory: Memory | None = None,
) -> Chain:
    """Prepare a campaign for simulations with coefficients near `x`.

    Parameters
    ----------
    grid : CampaignGrid
        The campaign.
    x : (5,) array
        alpha2, alpha1, a1, a0, b0: they choose the contour.
    reference_kpa : float
        Pressure at which u = 1.
    pressure_kpa : (cells,) array, optional
        True pressure on the cells, in place of the command and the drive.
    memory : Memory, optional
        Of a specimen with a past.

    Raises
    ------
    ValueError
        There is neither a command nor `pressure_kpa`.
    """
    driven = grid.command_kpa if pressure_kpa is None else pressure_kpa
    if driven is None:
        raise ValueError("the campaign holds no command")
    return Chain(
        grid, driven, pressure_kpa is not None, reference_kpa, contour_for(x), memory or Memory()
    )
