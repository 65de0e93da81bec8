import re
import shutil
from functools import cache
from pathlib import Path

from spa_fo.atomic import TEMPORARY
from spa_fo.config import check_compared, has_angle, match_materials, read_config
from spa_fo.edge import bad_input_exits
from spa_fo.sources import code_hash
from spa_fo.validation import load_yaml

SCRIPTS = Path(workflow.basedir) / "workflow" / "scripts"

with bad_input_exits():
    # Refuses a key given twice, where Snakemake keeps the last.
    for path in workflow.configfiles:
        load_yaml(path)
    CONFIG = read_config(
        config,
        "config.yaml",
        Path(workflow.basedir) / "workflow/schemas/config.schema.yaml",
    )
    CONFIG["materials"] = match_materials(
        CONFIG["materials"], CONFIG["raw"], "config.yaml"
    )

RAW = Path(CONFIG["raw"])
RESULTS = Path(CONFIG["results"])
MATERIALS = list(CONFIG["materials"])
REFERENCES = {
    material: entry["reference"]
    for material, entry in CONFIG["materials"].items()
    if "reference" in entry
}
BLIND = RESULTS / "blind"
BATCHES = [f"batch_{number:02d}" for number in range(CONFIG["blind"]["batches"])]


onstart:
    # What a killed run was writing; the lock says that nobody writes now.
    for path in list(RESULTS.rglob(f"{TEMPORARY}*")):
        if path.is_dir():
            shutil.rmtree(path, ignore_errors=True)
        else:
            path.unlink(missing_ok=True)


wildcard_constraints:
    material="|".join(map(re.escape, MATERIALS)),


def campaign_of(material):
    """The material's folder in raw/."""
    return RAW / CONFIG["materials"][material].get("campaign", material)


@cache
def bends(material):
    """Whether the material's logs hold an angle; where they do not, it is only compared."""
    return has_angle(campaign_of(material))


def identified():
    """The materials that are parsed to angles, identified and diagnosed."""
    return [material for material in MATERIALS if bends(material)]


def compared(material):
    """What the material and its reference are compared by."""
    both = bends(material) and bends(REFERENCES[material])
    return "angle" if both else "pressure"


# Once a run: with hundreds of campaigns it takes seconds, and every job reads this file.
if workflow.is_main_process:
    with bad_input_exits():
        check_compared(
            CONFIG["materials"],
            {
                material: campaign_of(material)
                for material in MATERIALS
                if not bends(material)
            },
            "config.yaml",
        )


def raw_files(wildcards):
    """Every file of the material's campaign, so that an edit of any of them is seen."""
    return raw_files_of(wildcards.material)


def raw_files_of(material):
    folder = campaign_of(material)
    return sorted(path for path in folder.rglob("*") if path.is_file())


def description(wildcards):
    """The campaign.yaml; where there is none, the first step says so in its own words."""
    path = campaign_of(wildcards.material) / "campaign.yaml"
    return [path] if path.is_file() else []


def model_of_reference(wildcards):
    """What the reference is compared through; pressures need no model."""
    if compared(wildcards.material) == "pressure":
        return []
    return RESULTS / REFERENCES[wildcards.material] / "model.json"


def code(name):
    """What a script depends on in the package: an edit of the package runs its rule again."""
    return code_hash(SCRIPTS / name)


def growing(amount):
    """Memory in MB or time in minutes of a job, and more at each further attempt.

    docs/scale.md has what the rules take.
    """
    return lambda wildcards, attempt: amount * attempt


def of_each_identified(name):
    return lambda wildcards: expand(
        RESULTS / "{material}" / name, material=identified()
    )


def of_each_batch(path):
    return expand(BLIND / path, batch=BATCHES)
