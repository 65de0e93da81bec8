rule ablation:
    """How the fit depends on the number of datasets and points, and on outliers."""
    input:
        trials=rules.raw_to_angle.output.trials,
        description=description,
    output:
        table=RESULTS / "{material}" / "ablation.csv",
        verdict=RESULTS / "{material}" / "ablation.json",
    log:
        RESULTS / "logs" / "{material}" / "ablation.log",
    benchmark:
        RESULTS / "logs" / "{material}" / "ablation.tsv"
    conda:
        "../envs/spa-fo.yaml"
    resources:
        mem_mb=growing(1000),
        runtime=growing(10),
    params:
        campaign=lambda wildcards: campaign_of(wildcards.material),
        options=CONFIG["ablation"],
        seed=CONFIG["seed"],
        code=code("ablation.py"),
    script:
        "../scripts/ablation.py"
