"""What a reference lets expect of an angle, and how surely."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from blind.first_rig import write_case
from blind_documents import document, read
from spa_fo.compare import angle_law
from spa_fo.compare.angle_law import know_angle
from spa_fo.gap.settings import SETTINGS
from spa_fo.identify import fit_campaign
from spa_fo.plant.chain import static_gain

RICH = {"name": "rich", "repeats": 2}


@pytest.mark.parametrize("signal", ["command", "pressure"])
def test_no_angle_is_expected_more_surely_than_the_pressure_is_measured(
    signal: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_case(document(protocol=RICH, model={"kind": "earlier", "off": 0.0}), tmp_path)
    reference, data = read(tmp_path / "earlier"), read(tmp_path / "campaign")
    plain = replace(fit_campaign(reference).model, signal=signal)
    unsure = know_angle(reference, data, plain)
    exact = replace(SETTINGS, pressure_offset_kpa=0.0, pressure_gain=0.0)
    monkeypatch.setattr(angle_law, "SETTINGS", exact)
    sure = know_angle(reference, data, plain)
    more = [
        np.sqrt(one[1] ** 2 - other[1] ** 2)
        for one, other in zip(unsure.common, sure.common, strict=True)
    ]
    if signal == "command":  # is known
        assert max(float(each.max()) for each in more) == 0.0
        return
    gain = np.degrees(static_gain(plain.transfer_function.as_array())) / plain.reference_kpa
    held = [trial.pressure_kpa[-1] for trial in data.trials]
    expected = [
        gain * np.hypot(SETTINGS.pressure_offset_kpa, SETTINGS.pressure_gain * kpa) for kpa in held
    ]
    np.testing.assert_allclose([each[-1] for each in more], expected, rtol=0.5)
