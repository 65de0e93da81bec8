"""A campaign of the virtual rig -> a folder in the contract's format.

One seed, the same bytes: each file has its own random stream, keyed by its name, so a further
trial changes no other's draws; and everything continuous passes a converter, a 4 µs clock
or two decimals before it is written. Machines whose exp and tanh differ in the last digit write
the same campaign: scaling every voltage by 1 + 1e-8 leaves the committed bytes as they are.
"""

from __future__ import annotations

import hashlib
import shutil
import tempfile
import zlib
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from spa_fo.errors import BadInput
from spa_fo.virtual_rig.actuators import CampaignPlan, Experiment
from spa_fo.virtual_rig.arrays import Array
from spa_fo.virtual_rig.bench import Bench
from spa_fo.virtual_rig.clock import WRAP, BoardClock
from spa_fo.virtual_rig.wire import (
    CALIBRATION_COLUMNS,
    TRIAL_COLUMNS,
    Damage,
    banner,
    data_line,
)

_PRE_CALIBRATION_S = -600.0
_POST_CALIBRATION_S = 600.0  # after the last trial
_DWELL_S = 3.0
_MOVE_S = 2.0


@dataclass(frozen=True)
class PlannedTrial:
    """A trial with its place in the campaign."""

    experiment: Experiment
    trial: int
    order: int
    started_s: float

    @property
    def file(self) -> str:
        """Its log, relative to the campaign's folder."""
        return f"{self.experiment.name}/trial_{self.trial:02d}.log"


def schedule(plan: CampaignPlan, seed: int) -> list[PlannedTrial]:
    """List every trial of a campaign in the order it is run, with the rests between."""
    by_name = {experiment.name: experiment for experiment in plan.experiments}
    seen: Counter[str] = Counter()
    trials, started_s = [], 0.0
    for order, name in enumerate(plan.order, start=1):
        seen[name] += 1
        trial = PlannedTrial(by_name[name], seen[name], order, started_s)
        trials.append(trial)
        rest_s = plan.rest_s * stream(plan, seed, f"rest after {trial.file}").uniform(
            1.0, 4.0 / 3.0
        )
        started_s = round(started_s + trial.experiment.profile.duration_s + rest_s, 1)
    return trials


def campaign_files(plan: CampaignPlan, seed: int) -> dict[str, bytes]:
    """Run a campaign: every file of its folder by its relative name, checksums included."""
    trials = schedule(plan, seed)
    clock = _clock(plan, trials)
    bench = Bench(plan.specimen, _board_rate_hz(plan), _PRE_CALIBRATION_S)
    pre = _calibrate(plan, bench, clock, stream(plan, seed, "calibration/pre"))
    files = {"calibration/pre.log": pre}
    damages = _shared_out(plan.damage, len(trials), stream(plan, seed, "damage"))
    for trial, damage in zip(trials, damages, strict=True):
        bench.rest(trial.started_s)
        rng = stream(plan, seed, trial.file)
        files[trial.file], clock = _record(plan, bench, clock, trial, damage, rng)
    end_s = trials[-1].started_s + trials[-1].experiment.profile.duration_s
    post_s = round(end_s + _POST_CALIBRATION_S, 1)
    bench.rest(post_s)
    post = _calibrate(plan, bench, clock, stream(plan, seed, "calibration/post"))
    files["calibration/post.log"] = post
    files["campaign.yaml"] = _description(plan, seed, trials, post_s).encode("ascii")
    sums = [f"{hashlib.sha256(files[name]).hexdigest()}  {name}\n" for name in sorted(files)]
    files["SHA256SUMS"] = "".join(sums).encode("ascii")
    return files


def _board_rate_hz(plan: CampaignPlan) -> float:
    """Give the sampling rate by campaign time: the board samples by its own crystal."""
    return plan.rate_hz * (1.0 + plan.clock_error_ppm * 1e-6)


def write_campaign(plan: CampaignPlan, seed: int, folder: Path) -> None:
    """Run a campaign and write its folder, whole or not at all.

    Raises
    ------
    BadInput
        The folder exists already (measurements are never overwritten), or cannot be written.
    """
    if folder.exists():
        raise BadInput(folder, "exists already; expected a new folder, logs are not overwritten")
    write_folder(campaign_files(plan, seed), folder)


def write_folder(files: Mapping[str, bytes], folder: Path) -> None:
    """Write a new folder of files given by their relative names, whole or not at all.

    Raises
    ------
    BadInput
        The folder exists already, or cannot be written.
    """
    if folder.exists():
        raise BadInput(folder, "exists already; expected a new folder, logs are not overwritten")
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=f".{folder.name}.", dir=folder.parent) as scratch:
            whole = Path(scratch) / folder.name
            for name, data in files.items():
                path = whole / name
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_bytes(data)
            shutil.move(whole, folder)
    except OSError as error:
        raise BadInput(folder, f"cannot be written: {error.strerror or error}") from error


def stream(plan: CampaignPlan, seed: int, name: str) -> np.random.Generator:
    """Open the random stream of one file of a campaign."""
    key = zlib.crc32(f"{plan.name}/{name}".encode())
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence(seed, spawn_key=(key,))))


def _clock(plan: CampaignPlan, trials: list[PlannedTrial]) -> BoardClock:
    """Give a board powered on so long enough ago that its micros() wraps as planned."""
    if plan.wrap is None:
        return BoardClock(_PRE_CALIBRATION_S - 60.0, plan.clock_error_ppm)
    name, number, second = plan.wrap
    trial = next(t for t in trials if (t.experiment.name, t.trial) == (name, number))
    wrap_s = WRAP * 1e-6 / (1.0 + plan.clock_error_ppm * 1e-6)
    return BoardClock(trial.started_s + second - wrap_s, plan.clock_error_ppm)


def _shared_out(damage: Damage, trials: int, rng: np.random.Generator) -> list[Damage]:
    """Deal the campaign's damages out to its trials at random."""

    def deal(count: int) -> NDArray[np.int64]:
        return np.bincount(rng.integers(trials, size=count), minlength=trials)

    flipped, cut, doubled = deal(damage.flipped), deal(damage.cut), deal(damage.doubled)
    glued, lost = deal(damage.glued), deal(damage.lost)
    return [
        Damage(int(flipped[i]), int(cut[i]), int(doubled[i]), int(glued[i]), int(lost[i]))
        for i in range(trials)
    ]


def _record(
    plan: CampaignPlan,
    bench: Bench,
    clock: BoardClock,
    trial: PlannedTrial,
    damage: Damage,
    rng: np.random.Generator,
) -> tuple[bytes, BoardClock]:
    """Run one trial; returns its log and the clock after it."""
    bench.begin_trial(rng)
    command = trial.experiment.profile.sampled(plan.rate_hz)
    time, pressure, flex = bench.drive(command, rng)
    rows = zip(command.tolist(), pressure.tolist(), flex.tolist(), strict=True)
    fields = [(f"{kpa:.2f}", p, angle) for kpa, p, angle in rows]

    lines = [_banner(TRIAL_COLUMNS, plan)]
    reset = plan.reset
    if reset is None or (reset.experiment, reset.trial) != (trial.experiment.name, trial.trial):
        lines += _rows(clock.micros(time, rng), fields)
        spared = frozenset({0})
    else:
        before = time < trial.started_s + reset.after_s
        after = time >= trial.started_s + reset.after_s + reset.silent_s
        lines += _rows(clock.micros(time[before], rng), fields[: int(before.sum())])
        clock = clock.reset_at(trial.started_s + reset.after_s)
        spared = frozenset({0, len(lines)})
        lines.append(_banner(TRIAL_COLUMNS, plan))
        lines += _rows(clock.micros(time[after], rng), fields[-int(after.sum()) :])
    return damage.apply(lines, plan.line_end, rng, spared), clock


def _banner(columns: str, plan: CampaignPlan) -> bytes:
    return banner(columns, plan.rate_hz, converter=plan.specimen.acquisition.converter)


def _calibrate(
    plan: CampaignPlan, bench: Bench, clock: BoardClock, rng: np.random.Generator
) -> bytes:
    """Bend the sensor by hand in the fixture: a move, unlogged, then a dwell at each angle."""
    angles, still = _fixture_angles(plan)
    time, flex = bench.hold_in_fixture(angles, rng)
    fields = list(zip(angles[still].tolist(), flex[still].tolist(), strict=True))
    lines = [_banner(CALIBRATION_COLUMNS, plan)]
    lines += _rows(
        clock.micros(time[still], rng), [(f"{angle:.1f}", count) for angle, count in fields]
    )
    return b"".join(line + plan.line_end for line in lines)


def _fixture_angles(plan: CampaignPlan) -> tuple[Array, NDArray[np.bool_]]:
    """Give the fixture's angle at each sample of a calibration, and where it stands still."""
    dwell, move = round(_DWELL_S * plan.rate_hz), round(_MOVE_S * plan.rate_hz)
    angles = np.array(plan.calibration_deg, dtype=float)
    starts = np.concatenate([angles[:1], angles[:-1]])
    moves = np.linspace(starts, angles, move, endpoint=False, axis=1)
    dwells = np.repeat(angles[:, None], dwell, axis=1)
    still = np.tile(np.arange(move + dwell) >= move, angles.size)
    return np.hstack([moves, dwells]).ravel(), still


def _rows(stamps: NDArray[np.int64], fields: Sequence[tuple[object, ...]]) -> list[bytes]:
    return [
        data_line(seq, stamp, *values)
        for seq, (stamp, values) in enumerate(zip(stamps.tolist(), fields, strict=True))
    ]


def _description(plan: CampaignPlan, seed: int, trials: list[PlannedTrial], post_s: float) -> str:
    return "".join(f"{line}\n" for line in _description_lines(plan, seed, trials, post_s))


def _description_lines(
    plan: CampaignPlan, seed: int, trials: list[PlannedTrial], post_s: float
) -> Iterator[str]:
    yield "schema: spa-fo/campaign/1"
    yield f"name: {plan.name}"
    yield f"material: {plan.material}"
    yield (
        f'provenance: {{kind: synthetic, source: "virtual rig, seed {seed}", '
        'note: "stand-in for measurements that were never published; '
        'how far the model misses is by construction"}'
    )
    yield "log: {format: spa-rig}"
    sensor = plan.specimen.acquisition.pressure_sensor
    converter = plan.specimen.acquisition.converter
    yield (
        f"pressure_sensor: {{volts: {list(sensor.volts_at_ends)}, kpa: {list(sensor.kpa_at_ends)}, "
        f"vref_mv: {converter.reference_volt * 1000:.0f}, adc_max: {converter.maximum}}}"
    )
    yield f"input: {{reference_kpa: {plan.specimen.actuator.reference_kpa}}}"
    yield "calibration:"
    yield f"  - {{file: calibration/pre.log, started_s: {_PRE_CALIBRATION_S}}}"
    yield f"  - {{file: calibration/post.log, started_s: {post_s}}}"
    yield "experiments:"
    for experiment in plan.experiments:
        setpoint = "null" if experiment.setpoint_deg is None else f"{experiment.setpoint_deg:g}"
        yield f"  - name: {experiment.name}"
        yield f"    setpoint_deg: {setpoint}"
        yield f"    protocol: {experiment.profile.protocol}"
        yield "    trials:"
        for trial in trials:
            if trial.experiment is experiment:
                yield (
                    f"      - {{file: {trial.file}, order: {trial.order}, "
                    f"started_s: {trial.started_s}}}"
                )
