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
