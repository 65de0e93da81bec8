rule figures:
    """Figs. 4 and 5, calibration, whole logs, ablation, identifiability."""
    input:
        raw_files=raw_files,
        trials=rules.raw_to_angle.output.trials,
        model=rules.identify.output.model,
        fit=rules.identify.output.fit,
        comparison=rules.identify.output.comparison,
        ablation=rules.ablation.output.table,
        ablation_verdict=rules.ablation.output.verdict,
    output:
        shown(
            directory(RESULTS / "{material}" / "figures"),
            "{item}.png",
            "figures.rst",
        ),
    log:
        RESULTS / "logs" / "{material}" / "figures.log",
    benchmark:
        RESULTS / "logs" / "{material}" / "figures.tsv"
    conda:
        "../envs/spa-fo.yaml"
    resources:
        mem_mb=growing(1000),
        runtime=growing(5),
    params:
        campaign=lambda wildcards: campaign_of(wildcards.material),
        material=lambda wildcards: CONFIG["materials"][wildcards.material],
        code=code("figures.py"),
    script:
        "../scripts/figures.py"


rule publish:
    """The tables (csv, tex, md), the audit of the paper, the summary; the report's pages and texts."""
    input:
        parse_reports=of_each_identified("parse_report.md"),
        fits=of_each_identified("fit.json"),
        reports=of_each_identified("fit_report.txt"),
        comparisons=of_each_identified("comparison.json"),
        ablations=of_each_identified("ablation.csv"),
        ablation_verdicts=of_each_identified("ablation.json"),
        figures=of_each_identified("figures"),
        diagnoses=of_each_identified("diagnosis"),
        changes=expand(RESULTS / "{material}" / "changed", material=REFERENCES),
    output:
        summary=RESULTS / "summary.md",
        tables=directory(RESULTS / "tables"),
        pages=shown(directory(RESULTS / "pages"), "{material}/{item}.html", "pages.rst"),
        texts=directory(RESULTS / "report_texts"),
    log:
        RESULTS / "logs" / "publish.log",
    benchmark:
        RESULTS / "logs" / "publish.tsv"
    conda:
        "../envs/spa-fo.yaml"
    resources:
        mem_mb=growing(1000),
        runtime=growing(15),
    params:
        campaigns={material: campaign_of(material) for material in MATERIALS},
        materials=CONFIG["materials"],
        identified=lambda wildcards: identified(),
        changed=list(REFERENCES),
        code=code("publish.py"),
    script:
        "../scripts/publish.py"
