"""No part of the package needs POSIX: what Windows lacks is named nowhere without a question before it."""

import ast
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "python/ldls"
# modules of the standard library that Windows has not, and names within others
LACKING = {
    "": "crypt curses fcntl grp nis posix pty pwd readline resource syslog termios tty",
    "os": "O_CLOEXEC O_DIRECTORY O_NOFOLLOW O_NONBLOCK WEXITSTATUS WIFEXITED WIFSIGNALED chown fchown fdatasync fork "
    "forkpty getegid geteuid getgid getloadavg getpgid getuid killpg lchown lockf mkfifo mknod nice openpty pipe2 "
    "posix_fadvise posix_fallocate pread pwrite register_at_fork sched_getaffinity sched_setaffinity sendfile setsid "
    "statvfs sync sysconf uname wait wait4 waitid",
    "signal": "SIGALRM SIGBUS SIGCHLD SIGHUP SIGKILL SIGPIPE SIGQUIT SIGSTOP SIGTSTP SIGUSR1 SIGUSR2 alarm pause "
    "pthread_kill pthread_sigmask setitimer sigwait",
    "socket": "AF_UNIX sethostname",
    "time": "clock_gettime tzset",
}
QUESTIONS = ("sys.platform", "os.name", "hasattr(")


def posix_names(text):
    """The lines and names of `text` that Windows has not, save where the code asks before whether they are there."""
    return sorted(_found(ast.parse(text), asked=False))


def _found(node, asked):
    asked = asked or _asks(node)
    if not asked:
        yield from ((node.lineno, name) for name in _names(node) if _is_lacking(name))
    for child in ast.iter_child_nodes(node):
        yield from _found(child, asked)


def _asks(node):
    """Return if what stands within `node` is reached only where its question or its ImportError lets it."""
    if isinstance(node, (ast.If, ast.IfExp)):
        return any(question in ast.unparse(node.test) for question in QUESTIONS)
    handlers = node.handlers if isinstance(node, ast.Try) else ()
    return any(handler.type and "ImportError" in ast.unparse(handler.type) for handler in handlers)


def _names(node):
    if isinstance(node, ast.Import):
        return [alias.name for alias in node.names]
    if isinstance(node, ast.ImportFrom):
        return [node.module or "", *(f"{node.module}.{alias.name}" for alias in node.names)]
    if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
        return [f"{node.value.id}.{node.attr}"]
    return []


def _is_lacking(name):
    module, _, rest = name.partition(".")
    return name in LACKING[""].split() or rest in LACKING.get(module, "").split()


@pytest.mark.parametrize(
    "path", [pytest.param(path, id=path.relative_to(PACKAGE).as_posix()) for path in sorted(PACKAGE.rglob("*.py"))]
)
def test_a_module_needs_no_posix(path):
    assert posix_names(path.read_text(encoding="utf-8")) == []


@pytest.mark.parametrize(
    ("text", "names"),
    [
        pytest.param("import fcntl", ["fcntl"], id="module"),
        pytest.param("def lock():\n    import os, termios as t", ["termios"], id="module within a function"),
        pytest.param("from signal import SIGTERM, SIGKILL", ["signal.SIGKILL"], id="name imported"),
        pytest.param("import os\nchild = os.fork()", ["os.fork"], id="function called"),
        pytest.param("import os\nif ready:\n    os.mkfifo('a')", ["os.mkfifo"], id="another question"),
        pytest.param("import os\nif hasattr(os, 'fork'):\n    os.fork()", [], id="asked with hasattr"),
        pytest.param("import os, sys\nif sys.platform != 'win32':\n    os.mkfifo('a')", [], id="asked of the platform"),
        pytest.param("try:\n    import pwd\nexcept ImportError:\n    pwd = None", [], id="import that may fail"),
        pytest.param("posix = 'a/b'.title\nposix.x()", [], id="a name of one's own"),
        pytest.param("import os, signal\nos.replace('a', 'b'); signal.SIGINT", [], id="what Windows has"),
    ],
)
def test_what_windows_lacks_is_found(text, names):
    assert [name for _, name in posix_names(text)] == names
