"""The campaign.yaml of a draft, with what is unsure as comments."""

from __future__ import annotations

import json
from collections.abc import Iterator

from spa_fo.rig.campaign_files import Setup
from spa_fo.rig.draft import Draft, DraftExperiment

UNSURE = "UNSURE"


def campaign_text(draft: Draft) -> str:
    """Return campaign.yaml; every guess that may be wrong has a comment with the word UNSURE."""
    return "\n".join(_lines(draft)) + "\n"


def _lines(draft: Draft) -> Iterator[str]:
    yield "# Drafted by spa-fo init from the logs in this folder. What is marked UNSURE is a guess:"
    yield "# correct it, and look at overview.png and at what spa-fo parse says."
    yield "schema: spa-fo/campaign/1"
    yield f"name: {_text(draft.folder.resolve().name or 'campaign')}"
    yield f"material: unknown  # {UNSURE}: no log says it"
    yield f"provenance: {{kind: measured, source: logs}}  # {UNSURE}: measured, or synthetic"
    yield draft.log.section().rstrip("\n")
    for role in ("command", "pressure"):
        if role in draft.doubts:
            yield f"  # {UNSURE}: offset of {role}: {draft.doubts[role]}"
    yield from _sensor(draft)
    doubt = draft.doubts.get("reference_kpa")
    why = f"{UNSURE}: {doubt}" if doubt else "the largest command; any round number will do"
    yield f"input: {{reference_kpa: {draft.reference_kpa!r}}}  # {why}"
    if draft.calibration:
        yield f"calibration:  # {UNSURE}: started_s, by the files' names"
        for file, started_s in draft.calibration:
            yield f"  - {{file: {_text(file)}, started_s: {started_s!r}}}"
    yield "experiments:"
    if "started_s" in draft.doubts:
        yield f"  # {UNSURE}: order and started_s: {draft.doubts['started_s']}"
    for experiment in draft.experiments:
        yield from _experiment(experiment)
    if draft.left_out:
        yield "# Left out:"
        yield from (f"#   {file}: {_line(why)}" for file, why in draft.left_out.items())


def _experiment(one: DraftExperiment) -> Iterator[str]:
    yield f"  - name: {_text(one.name)}"
    yield "    setpoint_deg: null  # the angle that was aimed at, if any"
    yield f"    protocol: {one.protocol}" + (f"  # {UNSURE}: {one.doubt}" if one.doubt else "")
    yield "    trials:" + ("  # the same command" if len(one.trials) > 1 else "")
    for trial in one.trials:
        yield (
            f"      - {{file: {_text(trial.file)}, order: {trial.order}, "
            f"started_s: {trial.started_s!r}}}"
        )


def _sensor(draft: Draft) -> Iterator[str]:
    banner, doubt = draft.log.banner, draft.doubts.get("pressure_sensor")
    if banner is None or doubt is None:
        return
    usual = Setup("", 1.0)
    yield f"pressure_sensor:  # {UNSURE}: {doubt}; volts and kpa are a usual one's"
    yield f"  volts: {list(usual.volts)}"
    yield f"  kpa: {list(usual.kpa)}"
    yield f"  vref_mv: {banner.vref_mv:g}"
    yield f"  adc_max: {banner.adc_max}"


def _text(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)


def _line(text: str) -> str:
    return "".join(c if c.isprintable() else "?" for c in text)
