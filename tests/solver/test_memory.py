"""Memory of a large bake, measured from outside, and what grows with the number of patches."""

from __future__ import annotations

import json
import subprocess
import sys
import tracemalloc

import pytest
from radiosity.solver import Settings, solve
from radiosity.tests.solver.rooms import box

LIMIT = 1.5 * 2**30
# Bakes a room on one page of 1,024 x 1,024 and prints its lumels, and the peak memory above that of the start, bytes.
# Its ceiling glows; or 256 panels under it do, of which a lumel looks at dozens.
SCRIPT = """
import json, resource, sys
import numpy as np
from radiosity.solver import Settings, bake
from radiosity.tests.solver.rooms import box, quad
start = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
panels = int(sys.argv[1])
room = box((0, 0, 0), (4, 3, 2.5), 0.6, (0, not panels, 0, 0, 0, 0))
room += box((1, 1, 0), (1.8, 2.1, 1.2), 0.6, inward=False)
for x, y in np.ndindex(panels, panels):
    room += quad((4 * (x + .25) / panels, 3 * (y + .25) / panels, 2.4), (0, .1, 0), (.1, 0, 0), emission=5.0)
report = bake(room.scene(), Settings(error=0.1, resolution=1024, threads=2)).report
peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
print(json.dumps([report["lumels"], 1024 * (peak - start)]))
"""


@pytest.mark.slow
@pytest.mark.parametrize("panels", [0, 16], ids=["one_lamp", "many_lamps"])
def test_a_lightmap_of_1024_x_1024_stays_below_one_and_a_half_gibibytes(panels):
    # A furnished room that fills half of its page and more, at .1, in a process of its own.
    if sys.platform != "linux":
        pytest.skip("ru_maxrss is counted in kibibytes on Linux alone")
    done = subprocess.run([sys.executable, "-c", SCRIPT, str(panels)], capture_output=True, text=True, check=True)
    lumels, peak = json.loads(done.stdout.splitlines()[-1])
    assert lumels > 500_000
    assert peak < LIMIT


def test_no_table_of_patches_by_patches_is_ever_there():
    # A room solved at .015 has more than 10,000 patches: form factors as a table of float32 would take 4 n^2 bytes,
    # half a gibibyte. All that NumPy holds at any time stays below a third of that.
    room = box((0, 0, 0), (4, 3, 2.5), 0.6, (0, 1, 0, 0, 0, 0)).scene()
    tracemalloc.start()
    patches = solve(room, Settings(error=0.015, threads=1)).statistics["patches"]
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert patches > 10_000
    assert peak < 4 * patches**2 / 3
