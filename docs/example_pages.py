"""Pages of the examples: each is run as a notebook, and its outputs stand below its cells.

A run is kept in ``build/examples`` until the example or the package changes.
"""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

import jupytext
import nbformat
from mkdocs.structure.files import File, Files
from nbclient import NotebookClient
from nbconvert import MarkdownExporter
from nbformat import NotebookNode

ROOT = Path(__file__).resolve().parent.parent
EXAMPLES = sorted((ROOT / "docs" / "examples").glob("*.py"))
_LONGEST_S = 600


def on_files(files: Files, config: Any) -> Files:
    """Add a page for each example, with its pictures."""
    for path in EXAMPLES:
        text, pictures = page(path)
        files.append(File.generated(config, f"examples/{path.stem}.md", content=text))
        for name, content in pictures.items():
            files.append(File.generated(config, f"examples/{name}", content=content))
    return files


def page(path: Path) -> tuple[str, dict[str, bytes]]:
    """Return an example's page as Markdown, and its pictures by name."""
    resources = {"output_files_dir": f"{path.stem}_files", "unique_key": path.stem}
    text, made = MarkdownExporter().from_notebook_node(executed(path), resources=resources)
    source = f"This page is made of [{path.name}](../../docs/examples/{path.name})."
    return f"{text.rstrip()}\n\n{source}\n", made.get("outputs", {})


def executed(path: Path) -> NotebookNode:
    """Run an example from its own folder; the notebook with its outputs."""
    kept = ROOT / "build" / "examples" / f"{path.stem}-{_state(path)}.ipynb"
    if kept.is_file():
        return nbformat.read(kept, as_version=4)
    notebook = jupytext.read(path)
    NotebookClient(
        notebook,
        timeout=_LONGEST_S,
        resources={"metadata": {"path": str(path.parent)}},
        # The kernel talks to this process alone: that it does so unencrypted is no warning.
        extra_arguments=["--IPKernelApp.log_level=40"],
    ).execute()
    kept.parent.mkdir(parents=True, exist_ok=True)
    for stale in kept.parent.glob(f"{path.stem}-*.ipynb"):
        stale.unlink()
    nbformat.write(notebook, kept)
    return notebook


def _state(path: Path) -> str:
    digest = hashlib.sha256(path.read_bytes())
    for source in sorted((ROOT / "src").rglob("*.py")):
        digest.update(source.read_bytes())
    return digest.hexdigest()[:16]
