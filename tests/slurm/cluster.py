# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""A Slurm of two nodes, n1 and n2, on this machine: as root, without systemd, cgroups, accounting or MPI. Nodes are
daemons with names of their own and ports of 127.0.0.1; what belongs to one is killed as if it had lost power."""
import os
import pathlib
import signal
import socket
import subprocess
import time

PROGRAMS = ("munged", "slurmctld", "slurmd", "sbatch", "scontrol", "squeue", "sinfo", "scancel")
NODES = ("n1", "n2")

CONFIGURATION = """\
ClusterName=semrover-test
SlurmctldHost={host}(127.0.0.1)
SlurmctldPort={port}
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
AuthInfo=socket={folder}/munge.socket
CredType=cred/munge
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool/%n
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.%n.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd.%n.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
JobCompType=jobcomp/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
SlurmdParameters=config_overrides
MpiDefault=none
MailProg=/bin/true
ReturnToService=2
JobRequeue=1
SlurmdTimeout=10
MessageTimeout=3
KillWait=2
BatchStartTimeout=1
MinJobAge=600
SchedulerParameters=batch_sched_delay=0,sched_interval=1,sched_min_interval=100000
PartitionName=all Nodes=n1,n2 Default=YES MaxTime=INFINITE State=UP
NodeName=n1 NodeAddr=127.0.0.1 Port={n1} CPUs=1 State=UNKNOWN
NodeName=n2 NodeAddr=127.0.0.1 Port={n2} CPUs=1 State=UNKNOWN
"""


def missing_programs():
    """what is not installed, of what a cluster needs"""
    path = os.environ.get("PATH", "") + ":/usr/sbin:/sbin"
    return [p for p in PROGRAMS if not any(os.access(os.path.join(f, p), os.X_OK) for f in path.split(":"))]


def free_ports(count):
    sockets = [socket.socket() for _ in range(count)]
    for s in sockets:
        s.bind(("127.0.0.1", 0))
    ports = [s.getsockname()[1] for s in sockets]
    for s in sockets:
        s.close()
    return ports


def wait_until(condition, seconds, what):
    """-> what condition() gave, once it is true"""
    end = time.monotonic() + seconds
    while True:
        value = condition()
        if value:
            return value
        if time.monotonic() > end:
            raise TimeoutError(f"after {seconds} s still not: {what}")
        time.sleep(0.1)


class Cluster:
    def __init__(self, folder):
        self.folder = pathlib.Path(folder)
        self.asked, self.waiting = 0, {}
        self.environment = {**os.environ, "SLURM_CONF": str(self.folder / "slurm.conf")}
        self.environment["PATH"] = os.environ.get("PATH", "") + ":/usr/sbin:/sbin"

    def call(self, *command, **more):
        """-> what it printed; an error raises"""
        done = subprocess.run(command, env={**self.environment, **more}, capture_output=True, text=True, timeout=60)
        if done.returncode:
            raise RuntimeError(f"{' '.join(command)}: {done.returncode}: {done.stderr.strip() or done.stdout.strip()}")
        return done.stdout

    # ---- up and down

    def start(self):
        for name in ("state", *(f"spool/{n}" for n in NODES)):
            (self.folder / name).mkdir(parents=True)
        ports = dict(zip(("port", *NODES), free_ports(3)))
        host = socket.gethostname().split(".")[0]
        (self.folder / "slurm.conf").write_text(CONFIGURATION.format(folder=self.folder, host=host, **ports))
        version = 2 if os.path.exists("/sys/fs/cgroup/cgroup.controllers") else 1
        (self.folder / "cgroup.conf").write_text(
            f"CgroupPlugin=cgroup/v{version}\n" + ("IgnoreSystemd=yes\n" if version == 2 else ""))
        key = self.folder / "munge.key"
        key.write_bytes(os.urandom(1024))
        key.chmod(0o400)
        self.folder.chmod(0o755)
        files = {"key-file": "munge.key", "socket": "munge.socket", "pid-file": "munged.pid", "log-file": "munged.log",
                 "seed-file": "munged.seed"}
        self.call("munged", "--force", *(f"--{option}={self.folder / file}" for option, file in files.items()))
        self.call("slurmctld", "-c", "-f", self.environment["SLURM_CONF"])
        for node in NODES:
            self.start_node(node)
        self.wait_idle()

    def start_node(self, node):
        self.call("slurmd", "-N", node, "-f", self.environment["SLURM_CONF"])

    def wait_idle(self, seconds=30):
        wait_until(lambda: set(self.call("sinfo", "-h", "-N", "-o", "%T").split()) == {"idle"}, seconds, "nodes idle")

    def stop(self):
        for node in NODES:
            self.kill_node(node)
        for name in ("slurmctld", "munged"):
            kill(self.pid_of(f"{name}.pid"), signal.SIGKILL)

    # ---- what may die

    def pid_of(self, file):
        try:
            return int((self.folder / file).read_text())
        except (OSError, ValueError):
            return None

    def scripts(self, node):
        """process numbers of the batch scripts on a node"""
        spool = f"{self.folder}/spool/{node}/"
        return [pid for pid in processes() if any(a.startswith(spool) for a in arguments_of(pid)[:3])]

    def kill_daemon(self, node):
        """The machine cannot be reached any more; what runs there goes on."""
        kill(self.pid_of(f"slurmd.{node}.pid"), signal.SIGKILL)

    def kill_step(self, node):
        """what watches over a script"""
        for script in self.scripts(node):
            kill(parent_of(script), signal.SIGKILL)

    def kill_node(self, node):
        self.kill_daemon(node)
        scripts = self.scripts(node)
        for step in {parent_of(s) for s in scripts}:
            if step and arguments_of(step)[:1] and "slurmstepd" in arguments_of(step)[0]:
                kill(step, signal.SIGKILL)
        for pid in [p for s in scripts for p in (s, *descendants(s))]:
            kill(pid, signal.SIGKILL)

    # ---- jobs

    def jobs(self):
        """[(number, state, reason)] of the elements that are not done; a number is 12_0 of an array's"""
        lines = self.call("squeue", "-h", "-r", "-o", "%i %T %r").splitlines()
        return [tuple(line.split(maxsplit=2)) for line in lines]

    def hurry(self):
        """Requeued elements wait two minutes; these two seconds. In less a node takes them for what it has just ended."""
        waiting = [number for number, state, reason in self.jobs() if state == "PENDING" and reason == "BeginTime"]
        now = time.monotonic()
        self.waiting = {number: self.waiting.get(number, now) for number in waiting}
        for number, since in self.waiting.items():
            if now > since + 2:
                subprocess.run(["scontrol", "update", f"JobId={number}", "StartTime=now"], env=self.environment,
                               capture_output=True)

    def ask_nodes(self):
        """Nodes say what runs there, which they do in minutes by themselves: so Slurm sees what is gone."""
        if time.monotonic() > self.asked + 4:
            self.asked = time.monotonic()
            self.call("scontrol", "reconfigure")

    def field(self, job, name):
        """of scontrol show job"""
        for word in self.call("scontrol", "-o", "show", "job", job).split():
            if word.startswith(name + "="):
                return word.split("=", 1)[1]
        return None


# ---- processes of this machine

def processes():
    return [int(p) for p in os.listdir("/proc") if p.isdigit()]


def arguments_of(pid):
    try:
        return pathlib.Path(f"/proc/{pid}/cmdline").read_text(errors="replace").split("\0")
    except OSError:
        return []


def parent_of(pid):
    try:
        return int(pathlib.Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[1])
    except (OSError, IndexError):
        return None


def descendants(pid):
    children = [p for p in processes() if parent_of(p) == pid]
    return [d for c in children for d in (c, *descendants(c))]


def kill(pid, number):
    if pid and pid > 1:
        try:
            os.kill(pid, number)
        except ProcessLookupError:
            pass
