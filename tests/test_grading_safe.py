"""Code of a student that tries to get out of the sandbox, and can't."""

import ast
import ctypes
import errno
import os
import platform
import socket
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

if find_spec("nbgrader") is None:
    pytest.skip("nbgrader is not installed; it comes with the extra 'instructor'.", allow_module_level=True)

from kernels import SECRET, Kernel, sandboxed

from hdr_helpers.grading._running.calls import NUMBERS, REFUSED, call_filter
from hdr_helpers.grading._running.sandbox import COURSE, HOME, NO_NESTS, bubblewrap
from hdr_helpers.grading.course import ROOT


@pytest.fixture(scope="module")
def outside(tmp_path_factory):
    """What lies beside a kernel's folder in grading, each file with the secret."""
    base = tmp_path_factory.mktemp("jobs")
    for job in ("hdr_mine", "hdr_another"):
        for name in ("course/gradebook.db", "in/03_crf.ipynb", "marked/03_crf.json", "job.json", "out/03_crf.json"):
            place = base / job / name
            place.parent.mkdir(parents=True, exist_ok=True)
            place.write_text(SECRET)
    place = base / "hdr_another" / "kernels" / "03_crf" / "line" / "kernel.json"
    place.parent.mkdir(parents=True)
    place.write_text(SECRET)
    return base


@pytest.fixture(scope="module")
def kernel(outside):
    before = os.environ.get("TOKEN")
    os.environ["TOKEN"] = SECRET
    with Kernel(outside / "hdr_mine" / "kernels" / "03_crf") as kernel:
        yield kernel
    os.environ.pop("TOKEN") if before is None else os.environ.update(TOKEN=before)


@sandboxed
def test_no_file_and_no_environment_that_is_readable_inside_holds_the_secret(kernel, outside):
    read = f"""
found, count = [], 0
for top, folders, names in os.walk('/'):
    here = [name for name in folders if os.path.join(top, name) not in {("/usr", sys.prefix, sys.base_prefix)}]
    folders[:] = here if top != '/proc' else [name for name in here if name.isdigit() or name == 'self']
    for name in names:
        path = os.path.join(top, name)
        if not os.path.isfile(path) or name in ('pagemap', 'clear_refs', 'mem'):
            continue
        try:
            with open(path, 'rb') as file:
                count += 1
                if {SECRET[::-1]!r}[::-1].encode() in file.read(2 ** 20):
                    found.append(path)
        except OSError:
            pass
return count, found
"""
    state, (count, found) = kernel.attempt(read)  # backwards, for the kernel keeps a history of cells
    assert state == "got" and count > 100 and not found
    assert kernel.attempt("return Path('/proc/1/environ').read_text(), 'TOKEN' in os.environ") == ("got", ("", False))
    assert (outside / "hdr_mine" / "job.json").read_text() == SECRET


@sandboxed
def test_the_course_inside_is_without_solutions_tests_grading_and_history(kernel):
    assert kernel.attempt(f"return sorted(os.listdir({COURSE!r}))") == ("got", ["data", "hdr_helpers", "notebooks"])
    assert kernel.attempt(f"return os.listdir('{COURSE}/hdr_helpers/grading')") == ("got", [])
    assert kernel.attempt(f"return os.listdir('{COURSE}/notebooks')") == ("got", [])
    inside = ("/proc", "/dev", "/usr", sys.prefix, sys.base_prefix)
    paths = [ROOT / part for part in ("notebooks", "tests", "hdr_helpers", "README.md", ".git")]
    paths += [
        Path(path) for path in ("/etc/passwd", "/etc/shadow", "/etc/ssl", "/etc/resolv.conf", "/sys", "/run", "/var")
    ]
    paths += [path for path in Path.home().iterdir() if not any(str(path) in prefix for prefix in inside)]
    there = [str(path) for path in paths if path.exists()]
    assert there
    assert kernel.attempt(f"return [path for path in {there} if os.path.lexists(path)]") == ("got", [])
    assert kernel.attempt("import hdr_helpers.grading.course")[0] == "refused"


@sandboxed
def test_the_only_processes_inside_are_its_own(kernel):
    state, found = kernel.attempt(
        "return [Path(f'/proc/{name}/cmdline').read_text() for name in os.listdir('/proc') if name.isdigit()]"
    )
    assert state == "got" and len(found) == 2 and all("bwrap" in line or "ipykernel" in line for line in found)
    me = max(os.getpid(), 300)
    assert kernel.attempt(f"os.kill({me}, 0)") == ("refused", "ProcessLookupError")
    assert kernel.attempt(f"return open('/proc/{me}/mem', 'rb')") == ("refused", "FileNotFoundError")
    assert kernel.attempt(f"return ctypes.CDLL(None).ptrace(16, {me}, None, None)") == ("got", -1)
    assert kernel.attempt("return os.getppid()") == ("got", 1)


@sandboxed
def test_nothing_can_be_reached_by_network(kernel, tmp_path):
    servers = []
    for family, address in (
        (socket.AF_INET, ("127.0.0.1", 0)),
        (socket.AF_UNIX, f"\0hdr-{os.getpid()}"),
        (socket.AF_UNIX, str(tmp_path / "socket")),
        (socket.AF_UNIX, f"/tmp/hdr-{os.getpid()}"),
    ):
        server = socket.socket(family)
        server.bind(address)
        server.listen()
        servers.append(server)
    try:
        for server in servers:
            with socket.socket(server.family) as own:
                own.connect(server.getsockname())
            name = server.getsockname()
            name = name.decode("ascii") if isinstance(name, bytes) else name
            connect = f"line = socket.socket({int(server.family)})\nline.settimeout(3)\nline.connect({name!r})"
            assert kernel.attempt(connect)[1] in ("ConnectionRefusedError", "FileNotFoundError")
    finally:
        for server in servers:
            server.close()
        Path(f"/tmp/hdr-{os.getpid()}").unlink()
    assert kernel.attempt("socket.create_connection(('1.1.1.1', 53), 3)") == ("refused", "OSError")
    assert kernel.attempt("socket.create_connection(('2606:4700:4700::1111', 53), 3)")[0] == "refused"
    assert kernel.attempt("socket.getaddrinfo('example.org', 80)") == ("refused", "gaierror")
    assert kernel.attempt("return [name for _, name in socket.if_nameindex()]") == ("got", ["lo"])


@sandboxed
def test_files_can_be_made_in_its_own_folders_and_nowhere_else(kernel):
    make = """
writable = []
for top, folders, _ in os.walk('/'):
    folders[:] = [name for name in folders if os.path.join(top, name) != '/proc']
    try:
        os.close(os.open(os.path.join(top, 'own'), os.O_CREAT | os.O_WRONLY | os.O_EXCL))
        os.unlink(os.path.join(top, 'own'))
        writable.append(top)
    except OSError:
        pass
return writable
"""
    state, found = kernel.attempt(make)
    assert state == "got"
    own = {"/tmp", "/dev/shm", HOME, f"{COURSE}/notebooks", str(kernel.line)}
    assert own <= set(found) and all(own & {place, *map(str, Path(place).parents)} for place in found)
    for path in ("/usr/bin/env", f"{COURSE}/hdr_helpers/crf.py", sys.executable, os.__file__):
        assert kernel.attempt(f"os.open({path!r}, os.O_WRONLY)") == ("refused", "OSError"), path
        assert kernel.attempt(f"os.chmod({path!r}, 0o777)") == ("refused", "OSError"), path
        assert kernel.attempt(f"os.rename({path!r}, '/tmp/own')")[0] == "refused", path


@sandboxed
def test_no_setting_of_the_machine_can_be_opened_for_writing(kernel):
    settings = """
opened = []
for top, folders, names in os.walk('/proc'):
    folders[:] = [name for name in folders if not name.isdigit() and name not in ('self', 'thread-self')]
    for name in names:
        try:
            os.close(os.open(os.path.join(top, name), os.O_WRONLY))
            opened.append(os.path.join(top, name))
        except OSError:
            pass
return opened
"""
    assert kernel.attempt(settings) == ("got", [])


@sandboxed
def test_there_are_no_privileges_to_be_had(kernel):
    state, said = kernel.attempt("return Path('/proc/self/status').read_text()")
    facts = dict(line.split(":\t", 1) for line in said.splitlines())
    assert facts["NoNewPrivs"] == "1"
    assert {facts[name] for name in ("CapInh", "CapPrm", "CapEff", "CapBnd", "CapAmb")} == {"0" * 16}
    state, mounts = kernel.attempt("return Path('/proc/self/mountinfo').read_text().splitlines()")
    assert state == "got" and all("nosuid" in mount.split()[5] for mount in mounts)
    assert kernel.attempt("os.mknod('/tmp/disk', stat.S_IFBLK | 0o600, os.makedev(8, 0))")[1] == "PermissionError"
    assert kernel.attempt("os.chroot('/tmp')") == ("refused", "PermissionError")
    assert kernel.attempt("return ctypes.CDLL(None).mount(b'none', b'/tmp', b'tmpfs', 0, None)") == ("got", -1)
    assert kernel.attempt("return ctypes.CDLL(None).umount2(b'/course/hdr_helpers/grading', 2)") == ("got", -1)


@sandboxed
@pytest.mark.skipif(call_filter() is None, reason="The numbers of this machine's calls are not known.")
def test_calls_that_go_round_namespaces_are_refused(kernel):
    numbers = NUMBERS[platform.machine()][2]
    assert ctypes.CDLL(None).syscall(numbers[REFUSED.index("keyctl")], 0, -3, 1) > 0  # there are keys outside
    call = "libc = ctypes.CDLL(None, use_errno=True)\nreturn libc.syscall({}, 0, -3, 1, 0, 0), ctypes.get_errno()"
    for number in numbers:
        assert kernel.attempt(call.format(number)) == ("got", (-1, errno.EPERM)), number
    for family in (socket.AF_VSOCK, socket.AF_PACKET, socket.AF_ALG):
        assert kernel.attempt(f"socket.socket({int(family)}, 5)") == ("refused", "PermissionError")
    assert kernel.attempt("socket.socketpair()\nsocket.socket(socket.AF_INET6).close()\nreturn 1") == ("got", 1)
    assert kernel.attempt("import multiprocessing as m\nreturn m.Pool(2).map(abs, [-1, 2])") == ("got", [1, 2])


@sandboxed
def test_namespaces_within_give_nothing(kernel):
    nest = """
read, write = os.pipe()
if os.fork() == 0:
    libc = ctypes.CDLL(None)
    done = [libc.unshare(0x10000000 | 0x00020000), libc.mount(None, b'/usr', None, 0x20 | 0x1000, None)]
    done.append(libc.umount2(b'/course/hdr_helpers/grading', 2))
    try:
        done.append(os.open('/usr/own', os.O_CREAT | os.O_WRONLY))
    except OSError:
        done.append(-1)
    done.append(len(os.listdir('/course/hdr_helpers/grading')))
    os.write(write, repr(done).encode())
    os._exit(0)
return os.read(read, 100).decode()
"""
    unshared, *rest = ast.literal_eval(kernel.attempt(nest)[1])
    assert rest == [-1, -1, -1, 0]
    assert unshared == (-1 if set(NO_NESTS) <= set(bubblewrap()) else 0)
