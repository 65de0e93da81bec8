"""Readings that go off for a sample or two and come back: a lost frame, a byte, a loose contact.

They say nothing of an actuator, and as nothing else is so far off a few would decide how a fit
ends. What is read about them stands for them.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.ndimage import median_filter, uniform_filter1d
from scipy.stats import norm

from spa_fo.arrays import Bools, Floats
from spa_fo.rig import CampaignData, Trial

# Samples about one, of which two may be off, and those that say how it moves; times noise, and what
# moves from sample to sample, that none is off; s and samples after a jump of the input, a share of
# its range, within which an actuator may swing as fast as it is sampled; shares of samples that say
# how large noise is, of which those that are off are no more, and times the first that it may be.
# All assumed.
_ABOUT, _FAR = 5, 11
_SIDE, _BESIDE = 3, 3  # samples whose median stands for a side, and how far its middle is away
_LONG = 55  # samples, of which a ramp that is as good as a jump is less than half. Assumed.
_NOISES, _MOTIONS = 8.0, 3.0
_AFTER_S, _AFTER, _JUMP = 1.0, 10, 0.02
_SAY, _HEAVIER = np.array([0.5, 0.95]), 4.0
_NORMAL = norm.ppf(0.5 + 0.5 * _SAY)  # what these shares of a normal variable stay within


def without_dropouts(data: CampaignData) -> CampaignData:
    """Let each reading that is a dropout be the median of those about it."""
    trials = [
        replace(trial, angle_deg=mended(trial.angle_deg, *_swings(trial))) for trial in data.trials
    ]
    return replace(data, trials=tuple(trials))


def dropout_finding(data: CampaignData) -> tuple[str, ...]:
    """Say how many readings of a campaign are dropouts, and what became of them; else nothing."""
    pairs = zip(data.trials, without_dropouts(data).trials, strict=True)
    off = [int(np.count_nonzero(raw.angle_deg != sound.angle_deg)) for raw, sound in pairs]
    if not any(off):
        return ()
    return (
        "Readings that go off for a sample or two and come back are taken for the median of those "
        f"about them: {sum(off)} of {sum(trial.t_s.size for trial in data.trials)}.",
    )


def mended(angle_deg: Floats, swings: Bools | None = None, pulses: Bools | None = None) -> Floats:
    """Replace single samples, or two in a row, that are far off all others near them.

    That is by eight times the noise, and by three times what the angle moves from one sample to the
    next: neither a turn nor an edge is a dropout.

    Parameters
    ----------
    angle_deg : (n,) array
        What was read.
    swings : (n,) bool array, optional
        Where the angle may move as fast itself. It comes back from a dropout to where it was; so
        it does after a pulse of the input.
    pulses : (n,) bool array, optional
        Where the input may have had one.

    Returns
    -------
    (n,) array
        The same, but for dropouts.
    """
    if angle_deg.size < _FAR:
        return angle_deg
    about = np.asarray(median_filter(angle_deg, _ABOUT, mode="mirror"))
    off = np.abs(angle_deg - about)
    steps = np.abs(np.diff(angle_deg))
    moving = uniform_filter1d(steps, _FAR, mode="mirror")
    moving = np.append(moving, moving[-1])
    own_steps = steps[steps > 0.0]
    finest = float(own_steps.min()) if own_steps.size else 0.0  # of a converter
    # The noise of a converter that jumps between two readings has a tail.
    middle, tail = np.quantile(off, _SAY) / _NORMAL
    noise = max(middle, min(tail, _HEAVIER * middle), finest)
    dropped = (off > _NOISES * noise) & (off > _MOTIONS * moving)
    dropped[[0, -1]] = False  # nothing says that it comes back
    if swings is not None:
        back = off > _MOTIONS * _moved_across(angle_deg)
        dropped &= ~swings | (back if pulses is None else back & ~pulses)
    return np.where(dropped, about, angle_deg)


def _moved_across(angle_deg: Floats) -> Floats:
    """Say by how much the medians of the samples before and after each one are apart."""
    medians = np.asarray(median_filter(angle_deg, _SIDE, mode="nearest"))
    away = np.arange(angle_deg.size)[:, None] + np.array([-_BESIDE, _BESIDE])
    before, after = medians[np.clip(away, 0, angle_deg.size - 1)].T
    return np.asarray(np.abs(after - before))


def _swings(trial: Trial) -> tuple[Bools, Bools]:
    """Say where the input has jumped just before, and where it jumps more than once about there."""
    drive = trial.pressure_kpa if trial.command_kpa is None else trial.command_kpa
    if drive is None or drive.size < _FAR:
        none = np.zeros(trial.t_s.size, dtype=bool)
        return none, none
    change = np.abs(np.diff(drive))
    # A sine at a low rate moves as far from row to row, and goes on.
    sloped = median_filter(change, _LONG, mode="nearest")
    jumps = np.flatnonzero((change > _JUMP * np.ptp(drive)) & (change > _MOTIONS * sloped))
    after_s = min(_AFTER_S, _AFTER * float(np.median(np.diff(trial.t_s))))
    begins = np.append(-np.inf, trial.t_s[jumps])
    since = trial.t_s - begins[np.searchsorted(trial.t_s[jumps], trial.t_s, side="right")]
    about = _AFTER + _BESIDE + _SIDE  # rows in which a pulse would show
    at = np.arange(trial.t_s.size)
    often = np.searchsorted(jumps, at + about) - np.searchsorted(jumps, at - about) > 1
    return np.asarray(since < after_s), np.asarray(often)
