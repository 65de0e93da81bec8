"""The second rig's campaigns: what they hold, that they are read, and what is told of them."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from blind.second_rig import EFFECTS, FOREIGN, write_case
from naive_second_rig import document
from spa_fo.rig import CampaignData, read_campaign, read_trials

PROTOCOLS = ("up_steps", "releases", "rich", "everything", "single")
SHORT = document(seed=6, protocol={"name": "releases", "repeats": 1}, sampling={"rate_hz": 20.0})
TRUTH = {
    "noise_floor_deg", "sizes_reached", "joint_size", "model_error_deg", "form", "parameters",
    "core", "protocol",
}  # fmt: skip


def read(folder: Path) -> CampaignData:
    return read_trials(read_campaign(folder))


def length_s(data: CampaignData) -> float:
    return sum(float(trial.t_s[-1]) for trial in data.trials)


def digest(folder: Path) -> dict[str, str]:
    return {
        path.relative_to(folder).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


@pytest.mark.parametrize(
    "asked",
    [
        document(effects=["creep"], sizes=[3.0], kind="closed"),
        document(seed=2, model={"kind": "off"}, calibration={"kind": "none"}),
        document(seed=3, model={"kind": "earlier"}, effects=["sensor_slip"], sizes=[3.0]),
    ],
)
def test_same_document_same_bytes(asked: dict[str, Any], tmp_path: Path) -> None:
    truths = [write_case(asked, tmp_path / name) for name in ("a", "b")]
    assert truths[0] == truths[1]
    assert json.loads(json.dumps(truths[0])) == truths[0]
    assert digest(tmp_path / "a") == digest(tmp_path / "b")
    other = write_case({**asked, "seed": 99}, tmp_path / "c")
    assert other["core"] != truths[0]["core"]


@pytest.mark.parametrize("name", PROTOCOLS)
@pytest.mark.parametrize("repeats", [1, 8])
def test_each_class_of_protocol_is_read_and_keeps_its_length(
    name: str, repeats: int, tmp_path: Path
) -> None:
    for seed in (11, 12)[: 1 + (name == "single")]:
        folder = tmp_path / str(seed)
        order = "blocked" if repeats == 1 else "interleaved"
        asked = document(
            seed=seed,
            protocol={"name": name, "repeats": repeats, "order": order},
            sampling={"rate_hz": 25.0},
        )
        truth = write_case(asked, folder)
        assert set(truth) == TRUTH
        data = read(folder / "campaign")
        assert length_s(data) <= 480.0
        largest = max(trial.angle_deg.max() for trial in data.trials)
        assert 49.0 < largest < 77.0
        kinds = {trial.protocol for trial in data.trials}
        if name == "up_steps":
            assert kinds == {"step"}
        elif name == "releases":
            assert kinds == {"step_release"}
        elif name != "single":
            assert kinds >= {"step_release", "staircase", "triangle", "hold"}
        if name in ("up_steps", "releases"):
            assert len(data.trials) == 2 * repeats
        if name == "single":
            assert all(trial.trial == 1 for trial in data.trials)
        later = read(folder / "later")
        assert later.campaign.continues == data.campaign.name
        assert len(later.trials) >= 5
        assert len({trial.experiment for trial in later.trials}) >= 3
        assert length_s(later) <= 120.0
        assert min(t.started_s for t in later.trials) > max(t.started_s for t in data.trials)
        first = min(data.calibrations, key=lambda item: item.started_s)
        assert later.calibration is not None
        assert np.array_equal(later.calibration.counts, first.counts)


def test_csv_logs_of_every_make_are_read(tmp_path: Path) -> None:
    seen: dict[str, set[str]] = {"delimiter": set(), "time": set(), "angle": set(), "header": set()}
    for seed in range(12):
        asked = document(
            seed=seed,
            calibration={"kind": "none"},
            protocol={"name": "up_steps", "repeats": 1},
            sampling={"damaged": 0.02, "missing": 0.02},
        )
        write_case(asked, tmp_path / str(seed))
        data = read(tmp_path / str(seed) / "campaign")
        log = data.campaign.log
        assert log.columns is not None
        seen["delimiter"].add(log.delimiter)
        seen["header"].add(str(log.header))
        seen["time"].add(log.columns["time"].unit)
        seen["angle"].add(log.columns["angle"].unit)
        for trial in data.trials:
            assert trial.command_kpa is not None
            assert trial.pressure_kpa is not None
            assert trial.pressure_kpa[-1] == pytest.approx(trial.command_kpa[-1], abs=0.2)
        assert sum(report.damaged_lines for report in data.report.files) > 0
    assert len(seen["delimiter"]) >= 4
    assert seen["time"] == {"s", "ms", "us"}
    assert seen["angle"] == {"deg", "rad"}
    assert seen["header"] == {"True", "False"}


@pytest.mark.parametrize("bits", [8, 10, 12, 16])
@pytest.mark.parametrize("kind", ["before", "before_and_after"])
def test_flex_counts_of_any_converter_are_read(bits: int, kind: str, tmp_path: Path) -> None:
    formats = set()
    for seed in (1, 2) if bits == 12 else (2,):
        asked = document(
            seed=seed,
            protocol={"name": "up_steps", "repeats": 1},
            converter={"bits": bits},
            calibration={"kind": kind, "directions": 1 + seed % 2},
            pressure={"measured": seed != 1, "resolution_kpa": 0.3},
            noise={"colour": "one_over_f", "correlation_s": None},
        )
        write_case(asked, tmp_path / str(seed))
        data = read(tmp_path / str(seed) / "campaign")
        formats.add(data.campaign.log.format)
        assert len(data.calibrations) == (2 if kind == "before_and_after" else 1)
        assert max(np.mean(trial.outside_calibration) for trial in data.trials) < 0.01
        for trial in data.trials:
            assert (trial.pressure_kpa is None) == (seed == 1)
            if trial.pressure_kpa is not None:
                assert trial.command_kpa is not None
                late = np.abs(trial.pressure_kpa - trial.command_kpa)
                assert np.median(late) <= 0.3
    assert "spa-rig" in formats


@pytest.mark.parametrize("kind", ["own", "earlier", "off"])
def test_the_model_asked_for_is_given(kind: str, tmp_path: Path) -> None:
    asked = document(seed=4, model={"kind": kind, "off": 0.01}, effects=["stiffening"], sizes=[5.0])
    truth = write_case(asked, tmp_path)
    assert (tmp_path / "model.json").exists() == (kind == "off")
    assert (tmp_path / "earlier").exists() == (kind == "earlier")
    assert (truth["model_error_deg"] is not None) == (kind == "off")
    if kind == "off":
        model = json.loads((tmp_path / "model.json").read_text())
        ratio = model["transfer_function"]["a0"] / truth["core"]["a0"]
        assert abs(ratio - 1.0) == pytest.approx(0.01)
    if kind == "earlier":
        data = read(tmp_path / "earlier")
        assert 4 <= len(data.trials) <= 6
        assert data.campaign.continues is None
        # Before the effect each trial settles where the bare core does.
        core, gain = truth["core"], truth["core"]["b0"] / truth["core"]["a0"]
        assert core["alpha2"] > core["alpha1"]
        for trial in data.trials:
            assert trial.command_kpa is not None
            held = trial.command_kpa == trial.command_kpa.max()
            last = np.flatnonzero(held)[-50:]
            level = trial.command_kpa.max() / data.campaign.reference_kpa
            settled = np.rad2deg(gain * level)
            assert trial.angle_deg[last].mean() == pytest.approx(settled, abs=3.0)


def test_sizes_are_told_alone_and_together(tmp_path: Path) -> None:
    asked = document(seed=5, kind="pair", effects=["leak", "sensor_lag"], sizes=[2.0, 4.0])
    truth = write_case(asked, tmp_path)
    assert truth["sizes_reached"] == pytest.approx([2.0, 4.0], rel=0.03)
    assert truth["joint_size"] > 2.0
    assert set(truth["parameters"]) == {"leak", "sensor_lag"}
    assert truth["form"].count("+") == 1


@pytest.fixture(scope="module")
def bare(tmp_path_factory: pytest.TempPathFactory) -> tuple[dict[str, Any], CampaignData]:
    folder = tmp_path_factory.mktemp("bare")
    return write_case(SHORT, folder), read(folder / "campaign")


@pytest.mark.parametrize("name", [*EFFECTS, *FOREIGN])
def test_every_effect_makes_a_campaign_that_is_read(
    name: str, bare: tuple[dict[str, Any], CampaignData], tmp_path: Path
) -> None:
    kind = "closed" if name in EFFECTS else "alien"
    asked = {**SHORT, "kind": kind, "effects": [name], "sizes": [6.0]}
    truth = write_case(asked, tmp_path)
    assert truth["sizes_reached"][0] > 1.0
    assert truth["noise_floor_deg"] == bare[0]["noise_floor_deg"]
    data, without = read(tmp_path / "campaign"), bare[1]
    read(tmp_path / "later")
    assert max(trial.angle_deg.max() for trial in data.trials) < 90.0
    change = [
        np.mean((a.angle_deg - np.interp(a.t_s, b.t_s, b.angle_deg)) ** 2)
        for a, b in zip(data.trials, without.trials, strict=True)
    ]
    assert np.sqrt(np.mean(change)) > 0.7 * truth["noise_floor_deg"]


def test_losses_are_as_many_as_asked(tmp_path: Path) -> None:
    asked = document(seed=8, sampling={"missing": 0.03, "damaged": 0.02, "jitter": 0.1})
    write_case(asked, tmp_path)
    data = read(tmp_path / "campaign")
    steps = np.concatenate([np.diff(trial.t_s) for trial in data.trials]) * 50.0
    lost = float(np.sum(np.rint(steps) - 1.0) / np.sum(np.rint(steps)))
    assert lost == pytest.approx(0.05, abs=0.012)
    near = steps[np.abs(steps - 1.0) < 0.5]
    assert near.std() == pytest.approx(0.1 * np.sqrt(2.0), rel=0.15)


def test_what_is_no_case_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="schema"):
        write_case({**document(), "schema": "other/1"}, tmp_path)
    with pytest.raises(ValueError, match="not of this rig"):
        write_case(document(effects=["gremlins"], sizes=[1.0]), tmp_path)
