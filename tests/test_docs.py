"""Documentation that repeats what the code says, and the commands and code that it shows."""

from __future__ import annotations

import ast
import functools
import re
import shlex
import shutil
from pathlib import Path

import pytest

import campaigns
from shown_commands import ROOT, SHELL, Block, blocks, commands, refusal, run
from spa_fo.plant import Model, TransferFunction, write_model
from spa_fo.plant.effects.effect import Effect
from spa_fo.plant.effects.library import LIBRARY
from spa_fo.report.audit import audit

DOCS = sorted((ROOT / "docs").glob("*.md"))
PAGES = [ROOT / "README.md", *DOCS]
EXAMPLES = sorted((ROOT / "docs" / "examples").glob("*.py"))
_MOST_NAMES = 6


def rows() -> dict[str, list[str]]:
    """Rows of the library's table, by the effect's id."""
    text = (ROOT / "docs" / "diagnosis.md").read_text(encoding="utf-8")
    found = {}
    for line in text.splitlines():
        match = re.match(r"\| `(\w+)` \|", line)
        if match:
            found[match[1]] = [cell.strip() for cell in line.strip("|").split("|")]
    return found


def parameters(effect: Effect) -> str:
    names = [f"`{parameter.name}`" for parameter in effect.parameters]
    return ", ".join(names) if len(names) <= _MOST_NAMES else f"{names[0]} … {names[-1]}"


def test_the_table_of_the_library_is_the_library() -> None:
    table = rows()
    assert list(table) == list(LIBRARY)
    for name, effect in LIBRARY.items():
        _, stage, form, listed = table[name]
        assert (stage, listed) == (effect.stage, parameters(effect))
        assert form


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_file_that_a_page_links_to_is_there(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    links = [link for link in re.findall(r"\]\(([^)#]+)\)", text) if "://" not in link]
    # Made when the site is built: the commands' page, and one of each example.
    made = {"commands.md", *(f"examples/{path.stem}.md" for path in EXAMPLES)}
    missing = [link for link in links if not (page.parent / link).exists()]
    assert set(missing) <= made


def blocks_of(page: Path) -> list[Block]:
    return list(blocks(page.read_text(encoding="utf-8")))


def has_blocks(page: Path) -> bool:
    return any(block.language in (*SHELL, "python") for block in blocks_of(page))


def runs(block: Block) -> bool:
    """Say whether a block is carried out: all are but those marked, and make's, which take long."""
    if block.reason or block.elsewhere or block.language not in (*SHELL, "python"):
        return False
    return block.language == "python" or not all(
        command.startswith("make ") for command in commands(block.body)
    )


def bare_commands(block: Block) -> set[str]:
    """Return a shell block's commands without the comments behind them."""
    return {shlex.join(shlex.split(line, comments=True)) for line in commands(block.body)}


def run_on(page: Path) -> set[str]:
    return set().union(
        *(
            bare_commands(block)
            for block in blocks_of(page)
            if block.language in SHELL
            if runs(block)
        )
    )


@pytest.fixture(scope="module")
def workplace(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder as the pages expect it, with small campaigns under the names they use."""
    folder = tmp_path_factory.mktemp("pages")
    for name in ("dragon_skin_20", "fx_pro"):
        (folder / "raw" / name).mkdir(parents=True)
        campaigns.step_campaign(folder / "raw" / name, trials=2)
    for name in ("a", "b"):
        path = folder / "raw" / "my_arm" / "step_30" / f"{name}.csv"
        campaigns.write_log(path, campaigns.step_command(50.0), 25.0, seed=ord(name))
        path.write_text(path.read_text().replace("t,command,angle", "t,p,theta"))
    shutil.copy(path, folder / "step_20psi.csv")
    model = Model("dragon_skin_20", "test rubber", TransferFunction(**campaigns.TRUTH), 30.0)
    write_model(folder / "model.json", model)
    for name in ("examples", "tests", "workflow", "Snakefile", "benchmarks"):
        (folder / name).symlink_to(ROOT / name)
    return folder


@pytest.mark.parametrize(
    "page",
    [page for page in PAGES if has_blocks(page)],
    ids=lambda page: page.name,
)
def test_every_command_on_a_page_works(
    page: Path, workplace: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shutil.copytree(workplace, tmp_path, symlinks=True, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    for block in blocks_of(page):
        known = block.reason or block.elsewhere or block.file
        assert known or not block.mark, f"no such mark: {block.mark}"
        if block.file:
            (tmp_path / block.file).parent.mkdir(exist_ok=True)
            (tmp_path / block.file).write_text(block.body, encoding="utf-8")
        elif block.elsewhere:
            assert bare_commands(block) <= run_on(ROOT / block.elsewhere)
        elif runs(block):
            run(block, names)
        elif block.language in SHELL:
            for command in commands(block.body):
                assert refusal(command) == "", command


@pytest.mark.parametrize(
    "command",
    [
        "spa-fo fit raw/arm --out model.json --sed 3",
        "spa-fo nothing",
        "make nothing",
        "snakemake --nothing",
        "python -m spa_fo.report.audit_document --nothing",
        "rm -r results",
    ],
)
def test_a_command_that_would_not_be_accepted_is_refused(command: str) -> None:
    assert refusal(command)


def skeleton(node: ast.expr) -> str:
    """Return a message with … for what differs from case to case."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return node.value
    if isinstance(node, ast.JoinedStr):
        return "".join(skeleton(value) for value in node.values)
    if isinstance(node, ast.BinOp):
        return skeleton(node.left) + skeleton(node.right)
    return "…"


@functools.cache
def texts(path: Path) -> set[str]:
    """Return the skeletons of all of a module's texts."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    return {skeleton(node) for node in ast.walk(tree) if isinstance(node, ast.expr)}


def refusals(path: Path) -> set[str]:
    """Return the skeletons of what a module says of bad input, but for what is said elsewhere."""
    calls = [
        node
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name)
    ]
    said = {skeleton(call.args[1]) for call in calls if call.func.id == "BadInput"}
    return said - {"…"}


def test_troubleshooting_has_the_messages_of_the_program_and_some_of_every_module() -> None:
    page = (ROOT / "docs" / "troubleshooting.md").read_text(encoding="utf-8")
    messages = re.findall(r"^\| `(.+?)` \|", page, re.MULTILINE)
    assert len(messages) == len(set(messages)) > 60
    modules = sorted((ROOT / "src" / "spa_fo").rglob("*.py"))
    said = set.union(*(texts(path) for path in modules))
    assert [message for message in messages if not is_said(message, said)] == []
    silent = [
        path.relative_to(ROOT).as_posix()
        for path in modules
        # The benchmark's files and the virtual rig's are met by developers alone.
        if not {"blind", "virtual_rig"} & set(path.parts)
        if not path.stem.endswith("_document") and path.stem != "blind_history"
        if refusals(path) and not any(is_said(text, texts(path)) for text in messages)
    ]
    assert silent == []


def is_said(message: str, skeletons: set[str]) -> bool:
    """Say whether a message is one of these; one that ends in … may be cut short there."""
    if message.endswith("…"):
        return any(text.startswith(message.rstrip("…")) and "…" in text for text in skeletons)
    return message in skeletons


def test_the_audit_of_the_paper_is_what_is_computed() -> None:
    """Lines on what the paper prints; those on this run's identification are not made again."""
    page = (ROOT / "docs" / "audit.md").read_text(encoding="utf-8")
    rows = [
        tuple(cell.strip() for cell in line.strip().strip("|").split(" | "))
        for line in page.splitlines()
        if line.startswith("|")
    ]
    computed = [(line.where, line.statement, line.computed, line.verdict) for line in audit({})]
    assert [line for line in computed if line not in rows] == []
    assert len(rows) > len(computed) > 10
    assert "synthetic" in page
