"""``spa-fo check``: a short run on a board, or a log that is there already."""

from __future__ import annotations

import argparse
import stat
import sys
from pathlib import Path

from spa_fo.atomic import write_bytes
from spa_fo.errors import BadInput
from spa_fo.rig.admission import reading
from spa_fo.rig.board_link import BoardLink
from spa_fo.rig.campaign_files import read_document
from spa_fo.rig.command_profile import CommandProfile
from spa_fo.rig.live_check import USUAL_SENSOR, Finding, check_log
from spa_fo.rig.live_view import LiveView
from spa_fo.rig.record_command import tell
from spa_fo.rig.record_series import Interruption
from spa_fo.rig.recorder import Outcome, record_trial
from spa_fo.rig.spa_rig_log import parse_spa_rig_log, read_spa_rig_log

_REST_S = 2.0
_UP_S = 4.0
_RELEASE_S = 2.0


def run_check(options: argparse.Namespace) -> None:
    """Check a port or a file; leaves with 1 where something is at fault."""
    sensor, curve = USUAL_SENSOR, None
    if options.campaign is not None:
        document = read_document(options.campaign / "campaign.yaml")
        known, curve = reading(document, options.campaign)
        sensor = known or USUAL_SENSOR
    source = Path(options.source)
    extra: list[Finding] = []
    if is_port(source):
        data, outcome = _short_run(options)
        if options.out is not None:
            write_bytes(options.out, data)
        if not data:
            raise BadInput(source, f"nothing came: {outcome.aborted}")
        log = parse_spa_rig_log(data, source)
        extra = _of_the_run(outcome)
    else:
        log = read_spa_rig_log(source)
    found = [*extra, *check_log(log, sensor, curve)]
    for finding in found:
        print(finding)
    if any(finding.level == "fault" for finding in found):
        raise SystemExit(1)


def is_port(path: Path) -> bool:
    """Whether this is a serial port rather than a file."""
    try:
        return stat.S_ISCHR(path.stat().st_mode)
    except OSError as error:
        raise BadInput(
            path, f"cannot be read ({error.strerror}); expected a port or a log"
        ) from error


def _short_run(options: argparse.Namespace) -> tuple[bytes, Outcome]:
    interruption = Interruption()
    heard = bytearray()
    with interruption.heeded(), BoardLink(options.source, options.baud) as link:
        tell(f"waiting for the board at {options.source}")
        info = link.wait_ready()
        if options.pressure > info.limit_kpa:
            raise BadInput("--pressure", f"expected at most the board's limit, {info.limit_kpa:g}")
        profile = check_profile(options.pressure)
        view = LiveView("check", profile.samples(options.rate), options.rate, out=sys.stderr)
        try:
            with interruption.gently():
                outcome = record_trial(
                    link, info, profile, options.rate, heard.extend, interruption, view
                )
        finally:
            view.close()
    return bytes(heard), outcome


def check_profile(pressure_kpa: float) -> CommandProfile:
    """Rest, a modest pressure, vented; rest only where the pressure is 0."""
    end_s = _REST_S + _UP_S
    return CommandProfile(
        "step_release",
        end_s + _RELEASE_S,
        ((_REST_S, pressure_kpa), (end_s, 0.0)),
    )


def _of_the_run(outcome: Outcome) -> list[Finding]:
    if outcome.aborted is not None:
        return [Finding("fault", "run", f"it did not end as it should: {outcome.aborted}")]
    return [Finding("warning", "run", note) for note in outcome.notes[:5]]
