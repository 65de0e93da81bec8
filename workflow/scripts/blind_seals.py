"""The seals of all cases in one file."""

from pathlib import Path

from spa_fo.atomic import write_text
from spa_fo.edge import workflow_step

with workflow_step(snakemake.log[0], snakemake.threads):
    files = [Path(folder) / "seals.txt" for folder in snakemake.input]
    lines = [line for path in files for line in path.read_text(encoding="ascii").splitlines()]
    by_case = sorted(lines, key=lambda line: line.split()[1])
    write_text(snakemake.output[0], "".join(f"{line}\n" for line in by_case))
