"""The engine of one machine, where what is done with frames does not matter."""

import sys
import threading
from contextlib import closing
from itertools import count
from types import SimpleNamespace

from ldls.batch import local


def records(window):
    for work in window.works:
        work.record = {"frame": work.name}


WORK = SimpleNamespace(read=lambda _: None, segment=lambda _: None, write=records)
WINDOWS = [((number, str(number)),) for number in range(24)]
PATIENCE_S = 20


def interrupted_at(n):
    """Whoever runs `WINDOWS`, interrupted before the n-th step of its own after the first outcome."""
    steps, outcomes = count(), []

    def interrupt(frame, event, argument):
        if frame.f_code is local._Pipeline.stop.__code__:
            sys.settrace(None)
        elif outcomes and next(steps) == n:
            raise KeyboardInterrupt
        return interrupt

    sys.settrace(interrupt)
    try:
        with closing(local.run_local(WORK, WINDOWS, workers=1)) as run:
            outcomes.extend(run)
    except KeyboardInterrupt:
        pass
    finally:
        sys.settrace(None)


def test_a_run_that_is_interrupted_anywhere_ends():
    for n in range(400):
        caller = threading.Thread(target=interrupted_at, args=[n], daemon=True)
        caller.start()
        caller.join(PATIENCE_S)
        assert not caller.is_alive(), n
