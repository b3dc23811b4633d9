"""A real Slurm cluster of three nodes on this machine, in namespaces of its own, gone when its block ends."""

from __future__ import annotations

import contextlib
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Final

NODES: Final = ("n1", "n2", "n3")
NODE_MEMORY_MB: Final = 2000
PROGRAMS: Final = (
    "munged",
    "slurmctld",
    "slurmd",
    "sbatch",
    "scontrol",
    "squeue",
    "unshare",
    "nsenter",
    "ip",
)
PACKAGES: Final = "slurmctld slurmd slurm-client munge iproute2 util-linux"

_ADDRESS: Final = "10.99.0.1"
_HOST: Final = "farm"
# Programs of the daemons are in sbin, which is not on everybody's path.
_PATH: Final = os.pathsep.join([os.environ.get("PATH", ""), "/usr/sbin", "/sbin"])

# The namespaces' first process: everything in them ends with this one, which ends with its standard input. It
# leaves no zombies, for which Slurm would wait.
_INIT: Final = """
import signal, socket, subprocess, sys
socket.sethostname(sys.argv[1])
for command in sys.argv[2:]:
    subprocess.run(command, shell=True, check=True)
signal.signal(signal.SIGCHLD, signal.SIG_IGN)
for number in (signal.SIGINT, signal.SIGTERM):
    signal.signal(number, signal.SIG_IGN)
print("ready", flush=True)
sys.stdin.read()
"""


class ClusterError(Exception):
    """Slurm could not be started, or did not do what it was told."""


def why_not() -> str | None:
    """Return why no cluster can be started here, or None.

    Returns
    -------
    str or None
        One sentence, for a skipped test.
    """
    if sys.platform != "linux" or os.geteuid() != 0:
        return "a cluster in namespaces needs root on Linux"
    missing = [name for name in PROGRAMS if shutil.which(name, path=_PATH) is None]
    if missing:
        return f"{', '.join(missing)} missing; install Debian's packages {PACKAGES}"
    trial = subprocess.run(
        ["unshare", "--net", "--uts", "--ipc", "--mount", "--pid", "--fork", "true"],
        capture_output=True, text=True, check=False, env=os.environ | {"PATH": _PATH},
    )  # fmt: skip
    if trial.returncode:
        return f"unshare makes no namespaces here: {trial.stderr.strip()}"
    return None


class Cluster:
    """A running cluster; made by `started`.

    Parameters
    ----------
    folder : Path
        Where its configuration, state and logs are.
    init : int
        The namespaces' first process, as this side numbers it.
    """

    def __init__(self, folder: Path, init: int) -> None:
        self.folder = folder
        self._init = init
        self._daemons: list[subprocess.Popen[bytes]] = []
        self.environment = {
            "PATH": _PATH,
            "SLURM_CONF": str(folder / "slurm.conf"),
            "LANG": "C.UTF-8",
            "HOME": os.environ.get("HOME", "/root"),
        }

    def run(self, command: Sequence[str], *, check: bool = True, **environment: str) -> str:
        """Run a command inside, and return what it says on standard output.

        Parameters
        ----------
        command : sequence of str
            The command.
        check : bool
            Whether a failure is an error.
        environment : str
            Further variables.
        """
        done = subprocess.run(
            [*self._inside(), *command],
            capture_output=True, text=True, check=False, timeout=60, stdin=subprocess.DEVNULL,
            env=self.environment | environment,
        )  # fmt: skip
        if check and done.returncode:
            raise ClusterError(f"{' '.join(command)}: exit {done.returncode}: {done.stderr}{done.stdout}")
        return done.stdout

    def start_daemon(self, name: str, command: Sequence[str]) -> None:
        """Start a program in the namespaces' background, its words in NAME.out."""
        with (self.folder / f"{name}.out").open("ab") as words:
            daemon = subprocess.Popen(
                [*self._inside(), *command],
                stdin=subprocess.DEVNULL, stdout=words, stderr=words, env=self.environment,
            )  # fmt: skip
        self._daemons.append(daemon)

    def reap(self) -> None:
        """Wait for the daemons' ends, which have come."""
        for daemon in self._daemons:
            daemon.wait(10)

    def start_node(self, node: str) -> None:
        """Start a node's slurmd."""
        self.start_daemon(node, ["slurmd", "-D", "-N", node])

    def kill_node(self, node: str) -> None:
        """Kill a node at once, as a loss of power does: its slurmd and everything that runs under it."""
        tree = self._processes()
        # A step's own line does not name its node, but that of the script which it runs does.
        scripts = [parent for parent, line in tree.values() if f"{self.folder / f'spool.{node}'}/job" in line]
        roots = {pid for pid, (_, line) in tree.items() if line.startswith(f"slurmd -D -N {node}")}
        roots |= {pid for pid in scripts if tree.get(pid, (0, ""))[1].startswith("slurmstepd: ")}
        if not roots:
            raise ClusterError(f"{node} runs nothing")
        family = set(roots)
        while True:
            children = {pid for pid, (parent, _) in tree.items() if parent in family} - family
            if not children:
                break
            family |= children
        for pid in family:
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)

    def jobs(self) -> dict[str, dict[str, str]]:
        """Return the fields that Slurm tells of each job that it remembers, by ``JOB`` or ``JOB_INDEX``."""
        text = self.run(["scontrol", "--oneliner", "show", "job"])
        found = {}
        for line in text.splitlines():
            fields = dict(re.findall(r"(?:^| )([A-Za-z/:]+)=(\S*)", line))
            if "JobId" not in fields:
                continue
            key = fields["JobId"]
            if "ArrayTaskId" in fields:
                key = f"{fields['ArrayJobId']}_{fields['ArrayTaskId']}"
            found[key] = fields
        return found

    def wait(self, what: str, done: Callable[[], bool], seconds: float = 120.0) -> None:
        """Wait until something is so.

        Parameters
        ----------
        what : str
            What is waited for, for the error.
        done : callable
            Tells whether it is so.
        seconds : float
            How long at most.
        """
        end = time.monotonic() + seconds
        while not done():
            if time.monotonic() > end:
                raise ClusterError(f"waited {seconds:g} s for {what}\n{self.story()}")
            time.sleep(0.1)

    def story(self) -> str:
        """Return queue, nodes and the ends of the daemons' logs, for who has to find out what went wrong."""
        parts = [self.run(["squeue"], check=False), self.run(["sinfo", "-N"], check=False)]
        for log in sorted(self.folder.glob("*.log")):
            lines = log.read_text(errors="replace").splitlines()[-15:]
            parts.append("\n".join([f"-- {log.name}", *lines]))
        return "\n".join(parts)

    def _inside(self) -> list[str]:
        return ["nsenter", f"--target={self._init}", "--net", "--uts", "--ipc", "--mount", "--pid", "--"]

    def _processes(self) -> dict[int, tuple[int, str]]:
        """Return parent and command line of each process in the namespaces, as this side numbers them."""
        home = (Path("/proc") / str(self._init) / "ns" / "pid").stat().st_ino
        found = {}
        for entry in Path("/proc").iterdir():
            if not entry.name.isdigit():
                continue
            with contextlib.suppress(OSError):
                if (entry / "ns" / "pid").stat().st_ino != home:
                    continue
                parent = (entry / "stat").read_text().rsplit(")", 1)[1].split()[1]
                line = (entry / "cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace").strip()
                found[int(entry.name)] = (int(parent), line)
        return found


@contextlib.contextmanager
def started(folder: Path) -> Iterator[Cluster]:
    """Start munged, slurmctld and a slurmd for each node, and end them all.

    Parameters
    ----------
    folder : Path
        An empty folder for configuration, state and logs.

    Yields
    ------
    Cluster
        With all its nodes idle.
    """
    _configure(folder)
    init = subprocess.Popen(
        ["unshare", "--net", "--uts", "--ipc", "--mount", "--pid", "--fork", "--mount-proc", "--kill-child",
         sys.executable, "-c", _INIT, _HOST,
         "ip link set lo up",
         # Where there is but loopback Slurm finds no address.
         "ip link add farm0 type veth peer name farm1",
         f"ip address add {_ADDRESS}/24 dev farm0",
         "ip link set farm0 up", "ip link set farm1 up",
         f"mount --bind '{folder / 'hosts'}' /etc/hosts"],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=os.environ | {"PATH": _PATH},
    )  # fmt: skip
    assert init.stdin is not None
    assert init.stdout is not None
    cluster = None
    try:
        if init.stdout.readline() != "ready\n":
            raise ClusterError("The namespaces could not be made.")
        # unshare waits outside for the process that it forked inside.
        children = Path(f"/proc/{init.pid}/task/{init.pid}/children").read_text().split()
        cluster = Cluster(folder, int(children[0]))
        munge = folder / "munge"
        cluster.start_daemon("munged", [
            "munged", "--foreground", "--force", f"--socket={folder / 'munge.socket'}",
            f"--key-file={munge / 'key'}", f"--pid-file={munge / 'pid'}",
            f"--seed-file={munge / 'seed'}", "--num-threads=2",
        ])  # fmt: skip
        cluster.wait("munge", (folder / "munge.socket").exists, 10)
        cluster.start_daemon("slurmctld", ["slurmctld", "-D", "-c"])
        for node in NODES:
            cluster.start_node(node)
        cluster.wait("the nodes", lambda: _idle(cluster) == len(NODES), 30)
        yield cluster
    finally:
        init.stdin.close()
        try:
            init.wait(10)
        except subprocess.TimeoutExpired:
            init.kill()
            init.wait(10)
        init.stdout.close()
        if cluster is not None:
            cluster.reap()


def _idle(cluster: Cluster) -> int:
    """Return how many nodes are idle."""
    return cluster.run(["sinfo", "-h", "-N", "-o", "%T"], check=False).split().count("idle")


def _configure(folder: Path) -> None:
    """Write the configuration of munge and Slurm."""
    for name in ("munge", "state", *(f"spool.{node}" for node in NODES)):
        (folder / name).mkdir(mode=0o755)
    key = folder / "munge" / "key"
    key.write_bytes(os.urandom(1024))
    key.chmod(0o400)
    (folder / "hosts").write_text(f"127.0.0.1 localhost\n{_ADDRESS} {_HOST} {' '.join(NODES)}\n")
    version = subprocess.run(
        ["slurmctld", "-V"], capture_output=True, text=True, check=True, env=os.environ | {"PATH": _PATH}
    ).stdout
    # Nothing asks for control groups, yet the daemons load the plugin; "disabled" is unknown before 23.11.
    recent = tuple(int(n) for n in re.findall(r"\d+", version)[:2]) >= (23, 11)
    (folder / "cgroup.conf").write_text(f"CgroupPlugin={'disabled' if recent else 'cgroup/v1'}\n")
    lines = [
        "ClusterName=farm",
        f"SlurmctldHost={_HOST}({_ADDRESS})",
        "SlurmctldPort=17817",
        "SlurmUser=root",
        "SlurmdUser=root",
        "AuthType=auth/munge",
        "CredType=cred/munge",
        # A requeued job waits until its credential has run out: 120 s if nothing is said.
        f"AuthInfo=socket={folder / 'munge.socket'},cred_expire=5",
        f"StateSaveLocation={folder / 'state'}",
        f"SlurmdSpoolDir={folder}/spool.%n",
        f"SlurmctldPidFile={folder}/slurmctld.pid",
        f"SlurmdPidFile={folder}/slurmd.%n.pid",
        f"SlurmctldLogFile={folder}/slurmctld.log",
        f"SlurmdLogFile={folder}/slurmd.%n.log",
        "SlurmctldDebug=info",
        "SlurmdDebug=info",
        "MpiDefault=none",
        "ProctrackType=proctrack/linuxproc",
        "TaskPlugin=task/none",
        "SwitchType=switch/none",
        "ReturnToService=2",
        "SlurmdTimeout=6",
        "KillWait=10",
        "MinJobAge=3600",
        "MaxArraySize=1001",
        # Slurm kills what is over its --mem, as a site without control groups does. It looks rarely, so that
        # the command's own limit comes first, but for a job that asks with --acctg-freq.
        "JobAcctGatherType=jobacct_gather/linux",
        "JobAcctGatherFrequency=task=30",
        "JobAcctGatherParams=OverMemoryKill",
        "SelectType=select/cons_tres",
        "SelectTypeParameters=CR_Core_Memory",
        "SchedulerType=sched/backfill",
        "SchedulerParameters=batch_sched_delay=0,sched_interval=1,bf_interval=1",
        "PriorityType=priority/basic",
        "SlurmdParameters=config_overrides",
        *(f"NodeName={node} NodeHostname={_HOST} NodeAddr={_ADDRESS} Port={18001 + place} "
            f"CPUs=1 RealMemory={NODE_MEMORY_MB}"
          for place, node in enumerate(NODES)),
        "PartitionName=farm Nodes=ALL Default=YES MaxTime=60 State=UP",
    ]  # fmt: skip
    (folder / "slurm.conf").write_text("\n".join(lines) + "\n")
