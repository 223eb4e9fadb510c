"""A SLURM of one node on the loopback interface, from the packages of the distribution, without accounting."""

from __future__ import annotations

import os
import shutil
import socket
import subprocess
import time
from importlib.util import find_spec
from pathlib import Path
from typing import Any

PROGRAMS = ("munged", "slurmctld", "slurmd", "sbatch", "squeue", "scancel", "scontrol", "sinfo")
PLUGIN = "snakemake_executor_plugin_slurm"
MEMORY = 4000

CONFIGURATION = """
ClusterName=loop
SlurmctldHost=localhost(127.0.0.1)
SlurmUser={user}
SlurmdUser={user}
AuthType=auth/munge
AuthInfo=socket={folder}/munge.socket
CredType=cred/munge
CommunicationParameters=NoInAddrAny,NoCtldInAddrAny
SlurmctldPort={ports[0]}
SlurmdPort={ports[1]}
StateSaveLocation={folder}/controller
SlurmdSpoolDir={folder}/node
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SwitchType=switch/none
MpiDefault=none
SchedulerType=sched/backfill
SelectType=select/cons_tres
SelectTypeParameters=CR_Core_Memory
AccountingStorageType=accounting_storage/none
JobAcctGatherType=jobacct_gather/linux
JobAcctGatherFrequency=1
JobAcctGatherParams=OverMemoryKill
MinJobAge=3600
ReturnToService=2
NodeName=localhost NodeAddr=127.0.0.1 CPUs={cpus} RealMemory={memory} State=UNKNOWN
PartitionName=debug Nodes=localhost Default=YES MaxTime=INFINITE State=UP
"""


def missing() -> str:
    """Return the reason why SLURM cannot be brought up here; an empty text if it can."""
    absent = [name for name in PROGRAMS if _program(name) is None]
    if absent:
        return f"no {', '.join(absent)}: apt-get install slurm-wlm munge"
    return "" if find_spec(PLUGIN) else f"no {PLUGIN}: pip install '.[cluster]'"


def _program(name: str) -> str | None:
    """Return the path of a program, daemons of the system included."""
    return shutil.which(name, path=os.pathsep.join([os.environ.get("PATH", ""), "/usr/sbin", "/usr/local/sbin"]))


class SlurmNode:
    """The daemons, which end with :meth:`stop`; clients find them by the variable ``SLURM_CONF``."""

    def __init__(self, folder: Path) -> None:
        self.configuration = folder / "slurm.conf"
        folder.chmod(0o755)
        for name in ("controller", "node"):
            (folder / name).mkdir()
        key = folder / "munge.key"
        key.write_bytes(os.urandom(1024))
        key.chmod(0o600)
        user = subprocess.run(["id", "-un"], capture_output=True, text=True, check=True).stdout.strip()
        self.configuration.write_text(
            CONFIGURATION.format(folder=folder, user=user, ports=_free_ports(2), cpus=os.cpu_count(), memory=MEMORY)
        )
        places = {name: f"--{name}-file={folder}/munge.{name}" for name in ("key", "pid", "log", "seed")}
        self._daemons: list[subprocess.Popen[bytes]] = []
        try:
            # The folder is private, and /tmp can be written to by all: reasons for munged to refuse without force.
            self._start("munged", "--foreground", "--force", f"--socket={folder}/munge.socket", *places.values())
            self.wait_until((folder / "munge.socket").exists, 10)
            self._start("slurmctld", "-D", "-f", str(self.configuration))
            self._start("slurmd", "-D", "-N", "localhost", "-f", str(self.configuration))
            self.wait_until(lambda: "idle" in self.client("sinfo", "-h", "-o", "%T"))
        except BaseException:
            self.stop()
            raise

    def _start(self, name: str, *arguments: str) -> None:
        quiet = {"stdin": subprocess.DEVNULL, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        self._daemons.append(subprocess.Popen([str(_program(name)), *arguments], env=self.environment, **quiet))

    @property
    def environment(self) -> dict[str, str]:
        """Variables of processes that use this SLURM."""
        return {**os.environ, "SLURM_CONF": str(self.configuration)}

    def client(self, *command: str) -> str:
        """Return the output of a command of SLURM."""
        done = subprocess.run(command, env=self.environment, capture_output=True, text=True, check=False)
        return done.stdout

    def jobs(self, *states: str) -> list[str]:
        """Identifiers of the jobs in these states."""
        return self.client("squeue", "-h", "-o", "%i", "-t", ",".join(states)).split()

    def wait_until(self, condition: Any, seconds: float = 60) -> None:
        """Wait until ``condition()`` is true, and fail if it does not come true."""
        end = time.monotonic() + seconds
        while not condition():
            assert time.monotonic() < end, "SLURM does not get there"
            time.sleep(0.1)

    def stop(self) -> None:
        """End the daemons that this object has started, the node first."""
        for job in self.jobs("PENDING", "RUNNING"):
            self.client("scancel", job)
        for daemon in reversed(self._daemons):
            daemon.terminate()
            try:
                daemon.wait(20)
            except subprocess.TimeoutExpired:
                daemon.kill()
                daemon.wait()


def _free_ports(count: int) -> list[int]:
    sockets = [socket.socket() for _ in range(count)]
    for one in sockets:
        one.bind(("127.0.0.1", 0))
    ports = [one.getsockname()[1] for one in sockets]
    for one in sockets:
        one.close()
    return ports
