"""Where the Rust code may be `unsafe`: in the kernel of the sweeps and in the binding of the allocator."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1] / "rust"
KERNEL = "ldls-core/src/diffusion"
ALLOWED = {
    f"{KERNEL}/lanes.rs",  # the registers that the kernel computes with
    f"{KERNEL}/sweep.rs",  # the kernel
    f"{KERNEL}/values.rs",  # the values that its threads share
    "ldls-py/src/allocator.rs",  # the binding of a C library
}
UNSAFE = re.compile(r"\bunsafe\b(?!_code)")

pytestmark = pytest.mark.skipif(not ROOT.is_dir(), reason="the Rust code is not here")


def code_of(path):
    """Lines of a file without their comments."""
    return [line.split("//")[0] for line in path.read_text(encoding="utf-8").splitlines()]


def test_unsafe_code_stands_in_the_kernel_and_in_the_binding_alone():
    found = {p.relative_to(ROOT).as_posix() for p in ROOT.rglob("*.rs") if any(map(UNSAFE.search, code_of(p)))}
    assert found == ALLOWED


def test_unsafe_code_is_refused_by_the_compiler_elsewhere():
    manifest = (ROOT.parent / "Cargo.toml").read_text(encoding="utf-8")
    assert re.search(r'^unsafe_code = "deny"$', manifest, re.MULTILINE)
    members = sorted(path.parent for path in ROOT.glob("*/Cargo.toml"))
    assert all("[lints]\nworkspace = true" in (m / "Cargo.toml").read_text(encoding="utf-8") for m in members)
    excepted = {
        p.relative_to(ROOT).as_posix()
        for p in ROOT.rglob("*.rs")
        if re.search(r"(allow|expect)\([^)]*unsafe_code", p.read_text(encoding="utf-8"))
    }
    assert excepted == ALLOWED


@pytest.mark.parametrize("name", sorted(ALLOWED))
def test_each_unsafe_block_says_why_it_is_sound(name):
    lines = (ROOT / name).read_text(encoding="utf-8").splitlines()
    for number, line in enumerate(code_of(ROOT / name)):
        if UNSAFE.search(line):
            before = "\n".join(lines[max(0, number - 8) : number + 1])
            assert "SAFETY" in before or "# Safety" in before, f"{name}:{number + 1}"
