"""SHA256SUMS: the raw files are the bytes that were recorded, and all of them."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable, Mapping
from pathlib import Path

from spa_fo.atomic import write_text
from spa_fo.errors import BadInput
from spa_fo.rig.raw import read_bytes

NAME = "SHA256SUMS"
RECORDING = ".recording"
"""Suffix of the file beside a log that is not finished: until then the log need not be listed."""
_LINE = re.compile(r"(?P<digest>[0-9a-fA-F]{64}) [ *](?P<file>.+)")


def read_checksums(folder: Path, files: Iterable[str] = ("*/*.log",)) -> dict[str, str]:
    """Read ``SHA256SUMS`` of a campaign folder (the format of the sha256sum command).

    Parameters
    ----------
    folder : Path
        The campaign folder.
    files : iterable of str
        The files it should list, for the advice when it is missing.

    Returns
    -------
    dict of str to str
        Relative POSIX path to lower-case hexadecimal digest.

    Raises
    ------
    BadInput
        The file is missing or a line is not ``<64 hex digits>  <file>``.
    """
    path = folder / NAME
    patterns = sorted({(Path(file).parent / f"*{Path(file).suffix}").as_posix() for file in files})
    try:
        lines = path.read_bytes().decode("utf-8-sig").splitlines()
    except FileNotFoundError as error:
        raise BadInput(
            path,
            "is missing; expected the checksums of every raw file: "
            f"cd {folder} && sha256sum {' '.join(patterns)} > {NAME}",
        ) from error
    except (OSError, UnicodeDecodeError) as error:
        raise BadInput(path, "cannot be read; expected sha256sum's format") from error
    digests: dict[str, str] = {}
    for number, line in enumerate(lines, start=1):
        if not line.strip():
            continue
        match = _LINE.fullmatch(line)
        if match is None:
            raise BadInput(path, "expected 64 hex digits, two spaces and a file", f"line {number}")
        name = Path(match["file"]).as_posix()
        if name in digests:
            raise BadInput(path, f"lists {name} twice", f"line {number}")
        digests[name] = match["digest"].lower()
    return digests


def verify(folder: Path, files: Mapping[str, str]) -> tuple[str, ...]:
    """Check every raw file of a campaign against its ``SHA256SUMS``.

    Parameters
    ----------
    folder : Path
        The campaign folder.
    files : mapping of str to str
        The files that campaign.yaml names, relative to `folder`, to what each belongs to: an
        experiment, or the calibration. They exist.

    Returns
    -------
    tuple of str
        What is odd, in words: files that are listed and sound but that campaign.yaml does not
        name; trials of one experiment that are the same to the byte, as those of a simulator
        without noise may be; logs that are still being recorded.

    Raises
    ------
    BadInput
        A named file is not listed, a listed file is missing or has other bytes, files of different
        experiments hold the same bytes, or a ``.log`` lies in the folder that nobody lists.
    """
    sums = folder / NAME
    expected = read_checksums(folder, files)
    for name in files:
        if name not in expected:
            raise BadInput(sums, f"does not list {name}; run sha256sum {name} >> {NAME}")
    owners: dict[str, str] = {}
    warnings = []
    for name, digest in expected.items():
        path = folder / name
        if not path.is_file():
            raise BadInput(sums, f"lists {name}, which is not there")
        actual = hashlib.sha256(read_bytes(path, "a raw file")).hexdigest()
        if actual != digest:
            raise BadInput(
                path, f"its SHA-256 is {actual[:12]}..., but {NAME} says {digest[:12]}..."
            )
        if name in files and path.stat().st_size > 0:
            twin = owners.setdefault(digest, name)
            if files[twin] != files[name]:
                raise BadInput(path, f"holds the same bytes as {twin}; expected its own")
            if twin != name:
                warnings.append(f"{name} holds the same bytes as {twin}: a copy?")
        elif name not in files and name != "campaign.yaml":
            warnings.append(f"{name} is in {NAME}, but campaign.yaml does not name it")
    for path in sorted(folder.rglob("*.log")):
        name = path.relative_to(folder).as_posix()
        if name in expected:
            continue
        if path.with_suffix(RECORDING).exists():
            warnings.append(f"{name} is still being recorded, or its recorder was killed")
        else:
            raise BadInput(path, f"is not listed in {NAME}; expected every raw file there")
    return tuple(warnings)


def spare(target: Path, folder: Path, *others: Path) -> None:
    """Refuse to write a result over what it is made from.

    Parameters
    ----------
    target : Path
        The file that is to be written.
    folder : Path
        The campaign folder: its raw files, and their lists, are spared. So are logs that nobody
        lists, as no campaign may hold one.
    *others : Path
        Further files that are read.

    Raises
    ------
    BadInput
        It is one of them.
    """
    place, root = target.resolve(), folder.resolve()
    spared = {other.resolve() for other in others}
    if place.is_relative_to(root):
        listed = read_checksums(folder) if (folder / NAME).is_file() else {}
        spared |= {root / name for name in ("campaign.yaml", NAME, *listed)}
    if place in spared or (place.is_relative_to(root) and place.suffix == ".log"):
        raise BadInput(target, "is a file of the campaign or the model; expected another to write")


def add(folder: Path, file: str) -> None:
    """List a raw file in a campaign's ``SHA256SUMS``, if it is not listed; made where missing."""
    path = folder / NAME
    known = read_checksums(folder) if path.exists() else {}
    if file not in known:
        text = path.read_text(encoding="utf-8-sig").rstrip() if known else ""
        digest = hashlib.sha256(read_bytes(folder / file, "a raw file")).hexdigest()
        write_text(path, f"{text}\n{digest}  {file}\n".lstrip())
