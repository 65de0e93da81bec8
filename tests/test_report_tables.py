import csv
import io
from pathlib import Path

import pandas as pd
import pytest

from spa_fo.errors import BadInput
from spa_fo.report.tables import Table, write_table

TABLE = Table(
    rows=pd.DataFrame({"model": ["a_b", "50 % | x"], "RMS deg": [1.23456789012345, None]}),
    caption="RMS error & more",
    provenance="synthetic: virtual rig, seed 1",
    decimals={"RMS deg": ".2f"},
)


def test_csv_keeps_every_digit_and_the_provenance(tmp_path: Path) -> None:
    path, _, _ = write_table(TABLE, tmp_path / "t")
    rows = list(csv.DictReader(io.StringIO(path.read_text())))
    assert float(rows[0]["RMS deg"]) == 1.23456789012345
    assert {row["provenance"] for row in rows} == {TABLE.provenance}


def test_latex_is_escaped_and_has_booktabs(tmp_path: Path) -> None:
    text = write_table(TABLE, tmp_path / "t")[1].read_text()
    assert r"a\_b & 1.23 \\" in text
    assert r"50 \% | x & – \\" in text or r"50 \% | x & -- \\" in text
    assert r"\toprule" in text
    assert r"\caption{RMS error \& more (synthetic: virtual rig, seed 1)}" in text


def test_markdown_has_a_row_a_line_and_escapes_bars(tmp_path: Path) -> None:
    lines = write_table(TABLE, tmp_path / "t")[2].read_text().splitlines()
    body = [line for line in lines if line.startswith("|")]
    assert len(body) == 4
    assert "50 % \\| x" in body[3]
    assert lines[-1] == "_synthetic: virtual rig, seed 1_"


def test_an_unwritable_place_is_bad_input(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(BadInput, match="cannot be written"):
        write_table(TABLE, tmp_path / "file" / "t")
