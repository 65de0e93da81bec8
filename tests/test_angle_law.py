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


@pytest.mark.parametrize(
    ("signal", "off_kpa"), [("command", 0.3), ("pressure", 0.3), ("pressure", 0.0)]
)
def test_no_angle_is_expected_more_surely_than_the_zero_of_the_pressure_is_known(
    signal: str, off_kpa: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_case(document(protocol=RICH, model={"kind": "earlier", "off": 0.0}), tmp_path)
    reference, data = read(tmp_path / "earlier"), read(tmp_path / "campaign")
    moved = [replace(t, pressure_kpa=t.pressure_kpa + off_kpa) for t in data.trials]
    data = replace(data, trials=tuple(moved))
    plain = replace(fit_campaign(reference).model, signal=signal)
    unsure = know_angle(reference, data, plain)
    monkeypatch.setattr(angle_law, "SETTINGS", replace(SETTINGS, pressure_offset_kpa=0.0))
    sure = know_angle(reference, data, plain)
    more = [
        float(np.sqrt(one[1] ** 2 - other[1] ** 2)[-1])
        for one, other in zip(unsure.common, sure.common, strict=True)
    ]
    gain = np.degrees(static_gain(plain.transfer_function.as_array())) / plain.reference_kpa
    if signal == "command":  # is known
        assert max(more) == 0.0
    elif off_kpa:
        np.testing.assert_allclose(more, gain * off_kpa, rtol=0.5)
    else:  # both have been seen at rest
        assert max(more) < 0.5 * gain * 0.3
