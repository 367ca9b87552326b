"""An interpreter that ends, or begins anew, while the package is at work."""

import sys

import pytest

from command import python

FRAME = """
import sys, threading, numpy, ldls

points = numpy.random.default_rng(0).uniform([-20, -15, 5], [20, 15, 50], (200_000, 3)).astype(numpy.float32)
camera = ldls.Camera(projection=[[500, 0, 620], [0, 500, 180], [0, 0, 1]])
masks = ldls.InstanceMasks.from_array(numpy.ones((1, 360, 1240), bool))
begun = threading.Event()


def work():
    while True:
        begun.set()
        ldls.segment(points, masks, camera)
"""


@pytest.mark.parametrize("ending", ["pass", "sys.exit(0)"], ids=["the end of the script", "sys.exit"])
def test_the_interpreter_may_end_during_a_call(ending):
    outcome = python("-c", f"{FRAME}\nthreading.Thread(target=work, daemon=True).start(); begun.wait(); {ending}")
    assert (outcome.returncode, outcome.stderr) == (0, "")


def test_the_modules_may_be_loaded_again_during_a_call():
    again = "import importlib; importlib.reload(ldls); importlib.reload(sys.modules['ldls.label_diffusion'])"
    use = "print(len(ldls.segment(points, masks, camera).labels))"
    outcome = python("-c", f"{FRAME}\nthreading.Thread(target=work, daemon=True).start(); begun.wait(); {again}; {use}")
    assert (outcome.returncode, outcome.stdout) == (0, "200000\n"), outcome.stderr


def test_a_second_interpreter_is_refused_or_works():
    script = "import _xxsubinterpreters as all; one = all.create(isolated=True)\n"
    script += "try:\n    all.run_string(one, 'import ldls._ldls')\nexcept all.RunFailedError as e:\n    print(e)\n"
    script += "print('alive')"
    if sys.version_info >= (3, 13):
        script = "import _interpreters as all; print(all.exec(all.create(), 'import ldls._ldls')); print('alive')"
    outcome = python("-c", script)
    assert outcome.returncode == 0, outcome.stderr
    *said, alive = outcome.stdout.splitlines()
    assert alive == "alive"
    assert not said or "ImportError" in " ".join(said) or said == ["None"], said
