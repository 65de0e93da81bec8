"""The examples of the documentation run as notebooks, and show what they promise."""

from __future__ import annotations

from pathlib import Path
from types import ModuleType

import pytest
from nbformat import NotebookNode

DOCS = Path(__file__).resolve().parent.parent / "docs"
EXAMPLES = sorted((DOCS / "examples").glob("*.py"))

# Of the text that an example prints or shows; the diagnosis must find what the bench was given.
SHOWN = {
    "campaign": ("Dragon Skin 20: dragon_skin_20, 18 trials", "synthetic data"),
    "diagnose": ("Cause: stiffening or softening of the actuator", "Nothing is left to separate"),
    "export": ("steady state itself exact", "phase margin"),
    "fit": ("95 % profile-likelihood interval", "K = 0.349"),
    "predict": ("predicted by the model of fx_pro", "rms error"),
}


def outputs(notebook: NotebookNode) -> list[dict[str, str]]:
    """What each cell showed, by kind; what was printed is text/plain."""
    found = []
    for cell in notebook.cells:
        for output in cell.get("outputs", ()):
            if output.output_type == "stream":
                found.append({output.name: output.text})
            else:
                found.append(dict(output.data))
    return found


def test_there_is_an_example_for_every_task() -> None:
    assert {path.stem for path in EXAMPLES} == set(SHOWN)


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_the_example_runs_and_shows(path: Path, examples: ModuleType) -> None:
    shown = outputs(examples.executed(path))
    assert not any("stderr" in one for one in shown)
    assert any("image/png" in one for one in shown)
    assert any("text/html" in one for one in shown)
    text = "\n".join(part for one in shown for kind, part in one.items() if kind != "image/png")
    for words in SHOWN[path.stem]:
        assert words in text
