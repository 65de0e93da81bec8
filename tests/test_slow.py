from __future__ import annotations

from pathlib import Path

import pytest

from conftest import SLOW


@pytest.mark.parametrize("place", SLOW)
def test_what_is_called_slow_is_there(place: str) -> None:
    file, _, name = place.partition("::")
    assert f"def {name}" in (Path(__file__).parent / file).read_text(encoding="utf-8")
