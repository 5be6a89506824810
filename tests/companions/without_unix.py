"""Takes away what Unix alone has, as on Windows, then imports all of Evenlight and runs commands.

    without_unix.py FOLDER then WORD ... then WORD ...      `evenlight WORD ...` in a folder, and so on

It prints how many modules there are, which could not be imported, and the exit codes of the commands. It runs
in a fork of a process that has imported the libraries, which choose by the system they are built for.
"""

import errno
import importlib
import io
import json
import os
import pkgutil
import signal
import socket
import sys
import time
import traceback
import types

GONE = ("fcntl", "termios", "tty", "pty", "resource", "pwd", "grp", "curses", "readline", "syslog")
ABSENT = {
    os: "chown fchmod fchown fork forkpty getgid geteuid getgroups getloadavg getpgid getpgrp getpriority "
    "getsid getuid initgroups killpg lchown major makedev minor mkfifo mknod nice openpty posix_spawn pread "
    "pwrite sched_getaffinity sched_setaffinity sched_yield sendfile set_blocking setgid setpgid setpriority "
    "setsid setuid statvfs sync sysconf tcgetpgrp ttyname uname wait wait3 wait4 O_NONBLOCK O_CLOEXEC "
    "O_DIRECTORY O_NOCTTY O_SYNC WNOHANG",
    signal: "SIGKILL SIGHUP SIGQUIT SIGUSR1 SIGUSR2 SIGALRM SIGCHLD SIGCONT SIGSTOP SIGTSTP SIGPIPE SIGWINCH "
    "alarm setitimer pause pthread_sigmask pthread_kill sigwait siginterrupt",
    socket: "AF_UNIX CMSG_LEN SCM_RIGHTS",
    time: "clock_gettime clock_gettime_ns clock_getres tzset pthread_getcpuclockid CLOCK_MONOTONIC",
    errno: "EREMOTEIO",
}


def take_away() -> None:
    """Forget Evenlight, and give what it imports from now on modules as Windows has them.

    Libraries that are there already keep theirs: on Windows they would have chosen other ways.
    """
    for name in [name for name in sys.modules if name.partition(".")[0] == "evenlight"]:
        del sys.modules[name]
    for name in GONE:
        sys.modules[name] = None  # type: ignore[assignment] # an import of it fails
    for module, names in ABSENT.items():
        lacking = types.ModuleType(module.__name__)
        vars(lacking).update(
            {name: value for name, value in vars(module).items() if name not in names.split()}
        )
        sys.modules[module.__name__] = lacking


def import_all() -> tuple[int, list[str]]:
    """Import every module of Evenlight, and return how many there are, and what failed."""
    import evenlight

    failed: list[str] = []
    found = pkgutil.walk_packages(evenlight.__path__, "evenlight.", failed.append)
    names = [one.name for one in found if not one.name.endswith("__main__")]
    for name in names:
        try:
            importlib.import_module(name)
        except Exception:
            failed.append(f"{name}: {traceback.format_exc(limit=-1).splitlines()[-1]}")
    return len(names), failed


def run_all(words: list[str]) -> list[int]:
    """Run commands, and return their exit codes."""
    from evenlight import command as command_line

    commands: list[list[str]] = []
    for word in words:
        if word == "then":
            commands.append([])
        else:
            commands[-1].append(word)
    codes = []
    for command in commands:
        try:
            command_line.main(command)
        except SystemExit as ended:
            codes.append(int(ended.code or 0))
    return codes


if __name__ == "__main__":
    take_away()
    sys.stdout = io.TextIOWrapper(sys.stdout.buffer, encoding="ascii")  # fewer than any code page has
    sys.stderr = io.TextIOWrapper(sys.stderr.buffer, encoding="ascii")
    count, failures = import_all()
    os.chdir(sys.argv[1])
    print(json.dumps({"count": count, "failed": failures, "codes": run_all(sys.argv[2:])}))
