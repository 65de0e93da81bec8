"""A Slurm of one node, this machine, for as long as it is needed.

``python tests/slurm_cluster.py COMMAND ...`` runs a command that finds one. Needs Debian's
``slurm-wlm`` and ``munge`` (``make slurm-tools``), and root; leaves nothing behind.
"""

from __future__ import annotations

import os
import secrets
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

PROGRAMS = ("munged", "munge", "slurmctld", "slurmd", "sbatch", "srun", "squeue", "scontrol")
_PATIENCE_S = 30.0

# Nothing here touches cgroups, which a container may not let us write; one partition, two jobs
# a node at a time if it has two processors and the memory for them. Accounting would need a
# database: the controller itself knows every job for MinJobAge seconds.
_CONFIGURATION = """\
ClusterName=one_node
SlurmctldHost={host}(127.0.0.1)
SlurmctldPort={controller_port}
SlurmdPort={node_port}
SlurmUser=root
AuthType=auth/munge
AuthInfo=socket={folder}/munge.socket
CredType=cred/munge
MpiDefault=none
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
JobCompType=jobcomp/filetxt
JobCompLoc={folder}/completed_jobs.txt
SchedulerType=sched/backfill
SchedulerParameters=sched_interval=1,batch_sched_delay=0,bf_interval=1
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU_Memory
ReturnToService=2
MinJobAge=3600
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd.log
{node} NodeAddr=127.0.0.1 State=UNKNOWN
PartitionName=all Nodes=ALL Default=YES MaxTime=INFINITE State=UP
"""


class NoCluster(Exception):
    """Why there is no Slurm to be had here."""


def find_programs() -> None:
    """Raise `NoCluster` unless everything is there that a cluster needs."""
    missing = [name for name in PROGRAMS if _program(name) is None]
    if missing:
        raise NoCluster(f"needs {', '.join(missing)}: make slurm-tools")
    if os.geteuid() != 0:
        raise NoCluster("needs root, as which Slurm's daemons run")


@contextmanager
def one_node_cluster() -> Iterator[dict[str, str]]:
    """Run munge, controller and node daemon; yield the environment in which they are found.

    Raises
    ------
    NoCluster
        A program is missing, or the node does not come up; the daemons' last words say why.
    """
    find_programs()
    # Short, because a socket's path has at most 107 characters.
    folder = Path(tempfile.mkdtemp(prefix="slurm-"))
    folder.chmod(0o755)
    environment = dict(os.environ) | {
        "SLURM_CONF": str(folder / "slurm.conf"),
        "PATH": f"{_own_srun(folder)}:{os.environ['PATH']}",
    }
    try:
        with ExitStack() as daemons:
            _start_munge(daemons, folder)
            _write_configuration(folder)
            for name in ("slurmctld", "slurmd"):
                command = [_program(name), "-D", "-f", environment["SLURM_CONF"], "-c"]
                daemons.enter_context(_daemon(command, folder / f"{name}.out"))
            _wait_for(["sinfo", "--noheader", "--format=%T"], "idle", environment, folder)
            try:
                yield environment
            finally:
                _cancel_everything(environment)
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def jobs(environment: dict[str, str]) -> list[dict[str, str]]:
    """What the controller knows of every job so far: its `scontrol show job`, by keyword."""
    listing = subprocess.run(
        ["scontrol", "--oneliner", "show", "job"],
        env=environment,
        capture_output=True,
        text=True,
        check=True,
    )
    return [
        dict(word.split("=", 1) for word in line.split() if "=" in word)
        for line in listing.stdout.splitlines()
        if line.startswith("JobId=")
    ]


def _program(name: str) -> str | None:
    """Daemons are in sbin, which not everyone's PATH has."""
    return shutil.which(name, path=f"{os.environ['PATH']}:/usr/sbin:/sbin")


def _own_srun(folder: Path) -> Path:
    """Make an srun that knows this cluster; Snakemake's jobs take SLURM_CONF out of its way."""
    script = folder / "bin" / "srun"
    script.parent.mkdir()
    script.write_text(f'#!/bin/sh\nSLURM_CONF={folder}/slurm.conf exec {_program("srun")} "$@"\n')
    script.chmod(0o755)
    return script.parent


def _start_munge(daemons: ExitStack, folder: Path) -> None:
    """Start the daemon by whose word Slurm's programs know each other, with a key of its own."""
    key = folder / "munge.key"
    key.touch(mode=0o600)
    key.write_bytes(secrets.token_bytes(128))
    files = {"socket": "socket", "pid-file": "pid", "log-file": "log", "seed-file": "seed"}
    places = [f"--{option}={folder}/munge.{suffix}" for option, suffix in files.items()]
    command = [_program("munged"), "--foreground", "--force", f"--key-file={key}", *places]
    daemons.enter_context(_daemon(command, folder / "munged.out"))
    probe = ["munge", "--no-input", f"--socket={folder}/munge.socket"]
    _wait_for(probe, "MUNGE:", dict(os.environ), folder)


def _write_configuration(folder: Path) -> None:
    # "NodeName=... CPUs=... RealMemory=...", what the daemon itself finds in this machine.
    hardware = subprocess.run(
        [_program("slurmd"), "-C"], capture_output=True, text=True, check=True
    )
    controller_port, node_port = _free_ports(2)
    text = _CONFIGURATION.format(
        folder=folder,
        host=socket.gethostname().split(".")[0],
        controller_port=controller_port,
        node_port=node_port,
        node=hardware.stdout.splitlines()[0],
    )
    for name in ("state", "spool"):
        (folder / name).mkdir()
    (folder / "slurm.conf").write_text(text)


def _free_ports(count: int) -> list[int]:
    with ExitStack() as stack:
        sockets = [stack.enter_context(socket.socket()) for _ in range(count)]
        for one in sockets:
            one.bind(("127.0.0.1", 0))
        return [one.getsockname()[1] for one in sockets]


@contextmanager
def _daemon(command: list[str | None], log: Path) -> Iterator[None]:
    with log.open("wb") as stream:
        process = subprocess.Popen(
            [word for word in command if word], stdout=stream, stderr=stream, env=dict(os.environ)
        )
        try:
            yield
        finally:
            process.terminate()
            try:
                process.wait(timeout=10)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


def _wait_for(command: list[str], answer: str, environment: dict[str, str], folder: Path) -> None:
    """Ask until the answer comes."""
    until = time.monotonic() + _PATIENCE_S
    while time.monotonic() < until:
        run = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
        if run.stdout.startswith(answer):
            return
        time.sleep(0.1)
    logs = "\n".join(
        f"--- {path.name}\n{path.read_text()[-2000:]}"
        for path in sorted([*folder.glob("*.out"), *folder.glob("*.log")])
    )
    raise NoCluster(f"{' '.join(command)}: {run.stdout}{run.stderr}\n{logs}")


def _cancel_everything(environment: dict[str, str]) -> None:
    """End what still runs, or its processes would outlive the daemons."""
    subprocess.run(["scancel", "--user", "root"], env=environment, check=False)
    until = time.monotonic() + _PATIENCE_S
    while time.monotonic() < until:
        left = subprocess.run(
            ["squeue", "--noheader"], env=environment, capture_output=True, text=True, check=False
        )
        if not left.stdout.strip():
            return
        time.sleep(0.2)


def main() -> int:
    """Run a command that finds a cluster."""
    if not sys.argv[1:]:
        print(__doc__)
        return 2
    # Terminated, it takes the daemons with it.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))
    try:
        with one_node_cluster() as environment:
            return subprocess.run(sys.argv[1:], env=environment, check=False).returncode
    except NoCluster as reason:
        print(f"no Slurm: {reason}", file=sys.stderr)
        return 2


if __name__ == "__main__":
    sys.exit(main())
