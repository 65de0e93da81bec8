from pathlib import Path

import spa_fo
from spa_fo.sources import code_hash, imported_files

PACKAGE = Path(spa_fo.__file__).parent


def script(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "script.py"
    path.write_text(text)
    return path


def test_a_script_depends_on_what_it_imports_and_on_what_that_imports(tmp_path: Path) -> None:
    files = imported_files(script(tmp_path, "from spa_fo.atomic import write_text\n"))
    assert {PACKAGE / "atomic.py", PACKAGE / "errors.py", PACKAGE / "__init__.py"} <= files
    assert PACKAGE / "sources.py" not in files


def test_a_module_imported_as_a_name_counts(tmp_path: Path) -> None:
    assert PACKAGE / "errors.py" in imported_files(script(tmp_path, "from spa_fo import errors\n"))


def test_data_files_beside_a_module_count(tmp_path: Path) -> None:
    files = imported_files(script(tmp_path, "import spa_fo.rig.campaign\n"))
    assert PACKAGE / "rig" / "campaign.schema.yaml" in files


def test_the_benchmark_beside_the_package_counts(tmp_path: Path) -> None:
    files = imported_files(script(tmp_path, "from blind.unseal import unseal\n"))
    assert PACKAGE.parent / "blind" / "unseal.py" in files
    assert PACKAGE / "errors.py" in files


def test_the_hash_changes_with_the_script(tmp_path: Path) -> None:
    first = code_hash(script(tmp_path, "import math\n"))
    assert first == code_hash(script(tmp_path, "import math\n"))
    assert first != code_hash(script(tmp_path, "import cmath\n"))


def test_what_only_the_type_checker_reads_does_not_count(tmp_path: Path) -> None:
    text = "if TYPE_CHECKING:\n    import spa_fo.sources\nelse:\n    import spa_fo.errors\n"
    files = imported_files(script(tmp_path, text))
    assert PACKAGE / "errors.py" in files
    assert PACKAGE / "sources.py" not in files
