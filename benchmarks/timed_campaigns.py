"""The campaigns that `side_by_side.py` times, each with its model, in a folder.

python benchmarks/timed_campaigns.py FOLDER
"""

from __future__ import annotations

import argparse
import shutil
import sys
import tempfile
from pathlib import Path

from blind.first_rig import write_case
from spa_fo.identify import fit_campaign
from spa_fo.plant import write_model
from spa_fo.rig import read_campaign, read_trials

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "tests"))
from blind_documents import document  # noqa: E402

COMMITTED = "dragon_skin_20"


def committed(folder: Path) -> None:
    """Copy a committed campaign, and identify its model."""
    shutil.copytree(ROOT / "raw" / COMMITTED, folder / "campaign")
    data = read_trials(read_campaign(folder / "campaign"))
    write_model(folder / "model.json", fit_campaign(data, bootstrap=None).model)


def rich(effect: str, folder: Path) -> None:
    """Write a campaign of the rich protocol with one effect, and the model of its bare core."""
    with tempfile.TemporaryDirectory() as scratch:
        case = Path(scratch)
        write_case(document(effect, seed=7, protocol={"name": "rich", "repeats": 4}), case)
        shutil.copytree(case / "campaign", folder / "campaign")
        shutil.copy(case / "model.json", folder)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    folder = parser.parse_args().folder
    committed(folder / COMMITTED)
    rich("hysteresis", folder / "rich, with hysteresis")


if __name__ == "__main__":
    main()
