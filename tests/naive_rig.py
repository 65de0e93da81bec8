"""Plain slow twins of the log-reading room, and a writer of small campaigns to read."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np
import yaml

BANNER = (
    "# spa-rig 1 board=mega2560 adc_bits=10 vref_mv=5000 rate_hz=50 "
    "columns=seq,t_us,cmd_kpa,p_adc,flex_adc"
)
CALIBRATION_BANNER = BANNER.rsplit("=", 1)[0] + "=seq,t_us,angle_deg,flex_adc"


def xor_checksum(body: bytes) -> int:
    """The XOR of every byte, one at a time."""
    value = 0
    for byte in body:
        value ^= byte
    return value


def data_line(*fields: object) -> bytes:
    body = ",".join(map(str, fields)).encode()
    return body + f"*{xor_checksum(body):02X}".encode()


def naive_valid_lines(data: bytes) -> list[bytes]:
    """Data lines of five columns whose checksum holds, by splitting alone (no clock)."""
    valid = []
    for line in data.replace(b"\r\n", b"\n").split(b"\n"):
        if line.count(b"*") != 1 or b"#" in line:
            continue
        body, digits = line.split(b"*")
        if digits == f"{xor_checksum(body):02X}".encode() and len(body.split(b",")) == 5:
            valid.append(line)
    return valid


def naive_monotone(values: list[float]) -> list[float]:
    """Non-decreasing least squares: merge neighbours that fall until none does."""
    blocks = [[value, 1.0] for value in values]
    merged = True
    while merged:
        merged = False
        for i in range(len(blocks) - 1):
            if blocks[i][0] > blocks[i + 1][0]:
                (a, m), (b, n) = blocks[i], blocks[i + 1]
                blocks[i : i + 2] = [[(a * m + b * n) / (m + n), m + n]]
                merged = True
                break
    return [value for value, size in blocks for _ in range(int(size))]


def naive_longest_increasing(values: list[float]) -> int:
    """The length of a longest strictly increasing subsequence, in O(n²)."""
    best = [1] * len(values)
    for j in range(len(values)):
        for i in range(j):
            if values[i] < values[j]:
                best[j] = max(best[j], best[i] + 1)
    return max(best, default=0)


def rows(
    n: int = 200, *, seed: int = 0, start_us: int = 1_000_012, level: float = 20.0, rise: int = 25
) -> list[bytes]:
    """Data lines of a step at 50 Hz with jitter: rest, then `level` from sample `rise` on."""
    rng = np.random.default_rng(seed)
    t_us = start_us + 20_000 * np.arange(n) + rng.integers(-40, 40, n)
    lines = []
    for i in range(n):
        high = i >= rise
        reach = 1.0 - np.exp(-(i - rise) / 15.0) if high else 0.0
        lines.append(
            data_line(
                i,
                int(t_us[i]) % 2**32,
                f"{level if high else 0.0:.2f}",
                102 + round(reach * 30) + int(rng.integers(-1, 2)),
                350 + round(reach * 90) + int(rng.integers(-1, 2)),
            )
        )
    return lines


def log(lines: list[bytes], banner: str = BANNER, end: bytes = b"\n") -> bytes:
    return end.join([banner.encode(), *lines]) + end


def log_without_pressure(seed: int, banner: str = BANNER) -> bytes:
    """A log of a board that measures no pressure."""
    kept = []
    for line in rows(seed=seed):
        seq, t_us, cmd, _, flex = line.split(b"*")[0].decode().split(",")
        kept.append(data_line(seq, t_us, cmd, flex))
    return log(kept, banner.replace("p_adc,", ""))


def calibration_log(
    *, offset: float = 0.0, slope: float = 4.0, hysteresis: float = 2.0, seed: int = 1
) -> bytes:
    """Dwells of 2 s at 0, 15, ... 90 deg, up and down; counts = 350 + slope·angle ± hysteresis."""
    rng = np.random.default_rng(seed)
    angles = [*range(0, 91, 15), *range(75, -1, -15)]
    lines = []
    for place, angle in enumerate(angles):
        way = hysteresis / 2 if 0 < place < 6 else -hysteresis / 2 if 6 < place < 12 else 0.0
        for _ in range(100):
            seq = len(lines)
            count = round(350 + offset + slope * angle + way + rng.normal(0, 1.0))
            lines.append(data_line(seq, 500_000 + 20_000 * seq, f"{angle:.1f}", count))
    return log(lines, CALIBRATION_BANNER)


def description(trials: int = 2) -> dict[str, object]:
    """A campaign.yaml of one step experiment."""
    return {
        "schema": "spa-fo/campaign/1",
        "name": "small",
        "material": "Dragon Skin 20",
        "provenance": {"kind": "synthetic", "source": "a test"},
        "log": {"format": "spa-rig"},
        "pressure_sensor": {
            "volts": [0.5, 4.5],
            "kpa": [0.0, 551.6],
            "vref_mv": 5000,
            "adc_max": 1023,
        },
        "input": {"reference_kpa": 30.0},
        "calibration": [
            {"file": "calibration/pre.log", "started_s": -600},
            {"file": "calibration/post.log", "started_s": 5400},
        ],
        "experiments": [
            {
                "name": "step_20",
                "setpoint_deg": 20,
                "protocol": "step",
                "trials": [
                    {"file": f"step_20/trial_{i:02d}.log", "order": i, "started_s": 60.0 * (i - 1)}
                    for i in range(1, trials + 1)
                ],
            }
        ],
    }


def write_checksums(folder: Path) -> None:
    files = sorted(
        path.relative_to(folder).as_posix()
        for path in folder.rglob("*")
        if path.is_file() and path.name not in ("SHA256SUMS", "campaign.yaml")
    )
    text = "".join(
        f"{hashlib.sha256((folder / name).read_bytes()).hexdigest()}  {name}\n" for name in files
    )
    (folder / "SHA256SUMS").write_text(text)


def write_campaign(
    folder: Path,
    document: dict[str, object] | None = None,
    files: dict[str, bytes] | None = None,
) -> Path:
    """Write the small campaign, with `files` over or beside its own, and its checksums."""
    contents = {
        "calibration/pre.log": calibration_log(),
        "calibration/post.log": calibration_log(offset=6.0, seed=2),
        "step_20/trial_01.log": log(rows(seed=1)),
        "step_20/trial_02.log": log(rows(seed=2)),
    } | (files or {})
    for name, data in contents.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)
    (folder / "campaign.yaml").write_text(
        yaml.safe_dump(document or description(), sort_keys=False)
    )
    write_checksums(folder)
    return folder
