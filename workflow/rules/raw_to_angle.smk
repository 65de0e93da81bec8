rule raw_to_angle:
    """Verify the checksums, read every log, calibrate: flex counts become angles."""
    input:
        raw_files,
    output:
        trials=RESULTS / "{material}" / "trials.csv",
        report=RESULTS / "{material}" / "parse_report.md",
        calibration=RESULTS / "{material}" / "calibration.json",
    log:
        RESULTS / "logs" / "{material}" / "raw_to_angle.log",
    benchmark:
        RESULTS / "logs" / "{material}" / "raw_to_angle.tsv"
    conda:
        "../envs/spa-fo.yaml"
    resources:
        mem_mb=growing(1000),
        runtime=growing(5),
    params:
        campaign=lambda wildcards: campaign_of(wildcards.material),
        code=code("raw_to_angle.py"),
    script:
        "../scripts/raw_to_angle.py"
