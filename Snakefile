# From raw serial logs to the paper's tables and figures, and to why model and actuator disagree.
# Read the rules in this order: raw_to_angle -> identify -> gap -> ablation -> publish; blind, which
# proves the gap's diagnosis, stands beside them.
from snakemake.utils import min_version

min_version("9.0")


configfile: "config.yaml"


report: "workflow/report/workflow.rst"


include: "workflow/rules/common.smk"
include: "workflow/rules/report.smk"
include: "workflow/rules/raw_to_angle.smk"
include: "workflow/rules/identify.smk"
include: "workflow/rules/gap.smk"
include: "workflow/rules/ablation.smk"
include: "workflow/rules/publish.smk"
include: "workflow/rules/blind.smk"


localrules:
    all,
    blind,
    blind_seals,
    blind_unseal,


rule all:
    default_target: True
    input:
        RESULTS / "summary.md",
