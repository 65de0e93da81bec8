rule identify:
    """The paper's swarm, the optimum and its uncertainty, the baselines; the model file."""
    input:
        trials=rules.raw_to_angle.output.trials,
        description=description,
    output:
        model=RESULTS / "{material}" / "model.json",
        fit=RESULTS / "{material}" / "fit.json",
        report=RESULTS / "{material}" / "fit_report.txt",
        comparison=RESULTS / "{material}" / "comparison.json",
    log:
        RESULTS / "logs" / "{material}" / "identify.log",
    benchmark:
        RESULTS / "logs" / "{material}" / "identify.tsv"
    conda:
        "../envs/spa-fo.yaml"
    resources:
        mem_mb=growing(1000),
        runtime=growing(10),
    params:
        campaign=lambda wildcards: campaign_of(wildcards.material),
        material=lambda wildcards: CONFIG["materials"][wildcards.material],
        options=CONFIG["identify"],
        seed=CONFIG["seed"],
        code=code("identify.py"),
    script:
        "../scripts/identify.py"
