# The blind benchmark (`snakemake -c2 blind`): campaigns with a known cause, sealed; diagnoses that
# cannot see it; then the seals are opened and the answers judged. Batches share a start-up.


wildcard_constraints:
    batch=r"batch_\d+",


rule blind:
    """The blind benchmark, judged."""
    input:
        BLIND / "table.md",


rule blind_cases:
    """A share of all rigs' cases: what the diagnosis may see, and apart from it the labels."""
    output:
        cases=directory(BLIND / "cases" / "{batch}"),
        labels=directory(BLIND / "labels" / "{batch}"),
    log:
        RESULTS / "logs" / "blind" / "{batch}_cases.log",
    benchmark:
        RESULTS / "logs" / "blind" / "{batch}_cases.tsv"
    conda:
        "../envs/spa-fo.yaml"
    resources:
        mem_mb=growing(1000),
        runtime=growing(60),
    params:
        plan=CONFIG["blind"],
        share=lambda wildcards: BATCHES.index(wildcards.batch),
        code=code("blind_cases.py"),
    script:
        "../scripts/blind_cases.py"


rule blind_seals:
    """The hash of every label, together, before the first diagnosis."""
    input:
        of_each_batch("cases/{batch}"),
    output:
        BLIND / "seals.txt",
    log:
        RESULTS / "logs" / "blind" / "seals.log",
    conda:
        "../envs/spa-fo.yaml"
    params:
        code=code("blind_seals.py"),
    script:
        "../scripts/blind_seals.py"


rule blind_diagnose:
    """Diagnose a share of the cases: campaign, model, effects to withhold, and nothing else.

    One process each, as many side by side as there are cores; a case's error is its answer.
    """
    input:
        cases=rules.blind_cases.output.cases,
        seals=rules.blind_seals.output,
    output:
        directory(BLIND / "diagnoses" / "{batch}"),
    log:
        RESULTS / "logs" / "blind" / "{batch}_diagnose.log",
    benchmark:
        RESULTS / "logs" / "blind" / "{batch}_diagnose.tsv"
    conda:
        "../envs/spa-fo.yaml"
    resources:
        mem_mb=growing(1000),
        runtime=growing(120),
    params:
        seed=CONFIG["seed"],
        code=code("blind_diagnose.py"),
    script:
        "../scripts/blind_diagnose.py"


rule blind_realise:
    """What the diagnoses' models are worth on each case's unseen trials."""
    input:
        cases=rules.blind_cases.output.cases,
        diagnoses=rules.blind_diagnose.output,
    output:
        BLIND / "realised" / "{batch}.json",
    log:
        RESULTS / "logs" / "blind" / "{batch}_realise.log",
    benchmark:
        RESULTS / "logs" / "blind" / "{batch}_realise.tsv"
    conda:
        "../envs/spa-fo.yaml"
    resources:
        mem_mb=growing(1000),
        runtime=growing(60),
    params:
        seed=CONFIG["seed"],
        code=code("blind_realise.py"),
    script:
        "../scripts/blind_realise.py"


rule blind_unseal:
    """Open the labels, if they are what was sealed before any of the diagnoses."""
    input:
        seals=rules.blind_seals.output,
        labels=of_each_batch("labels/{batch}"),
        diagnoses=of_each_batch("diagnoses/{batch}"),
    output:
        BLIND / "labels.json",
    log:
        RESULTS / "logs" / "blind" / "unseal.log",
    conda:
        "../envs/spa-fo.yaml"
    params:
        code=code("blind_unseal.py"),
    script:
        "../scripts/blind_unseal.py"


rule blind_score:
    """Judge the answers."""
    input:
        labels=rules.blind_unseal.output,
        diagnoses=of_each_batch("diagnoses/{batch}"),
        realised=of_each_batch("realised/{batch}.json"),
    output:
        BLIND / "scores.json",
    log:
        RESULTS / "logs" / "blind" / "score.log",
    benchmark:
        RESULTS / "logs" / "blind" / "score.tsv"
    conda:
        "../envs/spa-fo.yaml"
    resources:
        mem_mb=growing(1000),
        runtime=growing(15),
    params:
        plan=CONFIG["blind"],
        code=code("blind_score.py"),
    script:
        "../scripts/blind_score.py"


rule blind_publish:
    """The tables, the worst first, and the figures."""
    input:
        rules.blind_score.output,
    output:
        table=BLIND / "table.md",
        tables=multiext(
            f"{BLIND}/",
            *(
                f"{name}.{suffix}"
                for name in ("marks", "per_effect", "arms")
                for suffix in ("csv", "tex", "md")
            ),
        ),
        classes=BLIND / "classes.csv",
        figures=multiext(
            f"{BLIND}/",
            *(
                f"{name}.{suffix}"
                for name in (
                    "surroundings",
                    "confusion",
                    "calibration",
                    "size_curve",
                    "shrink",
                )
                for suffix in ("pdf", "png")
            ),
        ),
    log:
        RESULTS / "logs" / "blind" / "publish.log",
    benchmark:
        RESULTS / "logs" / "blind" / "publish.tsv"
    conda:
        "../envs/spa-fo.yaml"
    resources:
        mem_mb=growing(1000),
        runtime=growing(10),
    params:
        code=code("blind_publish.py"),
    script:
        "../scripts/blind_publish.py"
