"""What namespaces leave open: calls to Linux that reach the instructor's keys, or memory that nobody counts.

A filter of the kernel's own, which bubblewrap installs, refuses them. Student code has no use for any.
"""

import platform
import struct

REFUSED = ("shmget", "msgget", "semget", "add_key", "request_key", "keyctl", "perf_event_open", "bpf", "userfaultfd")
# Machine -> its number in the kernel; numbers of socket, of REFUSED, and of io_uring_setup, which goes round a filter.
NUMBERS = {
    "x86_64": (0xC000003E, 41, (29, 68, 64, 248, 249, 250, 298, 321, 323, 425)),
    "aarch64": (0xC00000B7, 198, (194, 186, 190, 217, 218, 219, 241, 280, 282, 425)),
}
FAMILIES = (1, 2, 10, 16)  # of sockets: unix, internet twice, netlink. Others are not bound to a network namespace
LOAD, EQUAL, AT_LEAST, RETURN = 0x20, 0x15, 0x35, 0x06  # of the filter's machine
ALLOW, REFUSE, KILL = 0x7FFF0000, 0x00050001, 0x80000000  # REFUSE : with EPERM
CALL, MACHINE, FIRST_ARGUMENT = 0, 4, 16  # where a call's data lie
FOREIGN = 0x40000000  # calls in the form of another machine begin here


def call_filter() -> bytes | None:
    """The filter as bubblewrap's --seccomp reads it; None for a machine whose numbers are not known here."""
    if platform.machine() not in NUMBERS:
        return None
    machine, socket, refused = NUMBERS[platform.machine()]
    steps = [(LOAD, 0, 0, MACHINE), (EQUAL, 1, 0, machine), (RETURN, 0, 0, KILL), (LOAD, 0, 0, CALL)]
    steps += [(AT_LEAST, 0, 1, FOREIGN), (RETURN, 0, 0, REFUSE)]
    for number in refused:
        steps += [(EQUAL, 0, 1, number), (RETURN, 0, 0, REFUSE)]
    # A step names how many to leave out where it holds, and where it does not; the last one allows.
    steps += [(EQUAL, 0, len(FAMILIES) + 2, socket), (LOAD, 0, 0, FIRST_ARGUMENT)]
    steps += [(EQUAL, len(FAMILIES) - k, 0, family) for k, family in enumerate(FAMILIES)]
    steps += [(RETURN, 0, 0, REFUSE), (RETURN, 0, 0, ALLOW)]
    return b"".join(struct.pack("<HBBI", *step) for step in steps)
