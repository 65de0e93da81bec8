rule diagnose:
    """Why model and actuator disagree: the answer, its page with figures, the augmented model."""
    input:
        raw_files=raw_files,
        trials=rules.raw_to_angle.output.trials,
        model=rules.identify.output.model,
    output:
        shown(
            directory(RESULTS / "{material}" / "diagnosis"),
            "{item}.png",
            "diagnosis.rst",
        ),
    log:
        RESULTS / "logs" / "{material}" / "diagnose.log",
    benchmark:
        RESULTS / "logs" / "{material}" / "diagnose.tsv"
    conda:
        "../envs/spa-fo.yaml"
    resources:
        mem_mb=growing(1000),
        runtime=growing(15),
    params:
        campaign=lambda wildcards: campaign_of(wildcards.material),
        seed=CONFIG["seed"],
        code=code("diagnose.py"),
    script:
        "../scripts/diagnose.py"


rule compare:
    """What changed since an earlier campaign of the same actuator."""
    input:
        raw_files=raw_files,
        reference_files=lambda wildcards: raw_files_of(REFERENCES[wildcards.material]),
        model=model_of_reference,
    output:
        shown(
            directory(RESULTS / "{material}" / "changed"),
            "{item}.png",
            "changed.rst",
        ),
    log:
        RESULTS / "logs" / "{material}" / "compare.log",
    benchmark:
        RESULTS / "logs" / "{material}" / "compare.tsv"
    conda:
        "../envs/spa-fo.yaml"
    resources:
        mem_mb=growing(1000),
        runtime=growing(15),
    params:
        campaign=lambda wildcards: campaign_of(wildcards.material),
        reference=lambda wildcards: campaign_of(REFERENCES[wildcards.material]),
        compared=lambda wildcards: compared(wildcards.material),
        seed=CONFIG["seed"],
        code=code("compare.py"),
    script:
        "../scripts/compare.py"
