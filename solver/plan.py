"""How much work the wanted error asks for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

# Edge of a cell, and of the smallest patch, over the median distance that gather rays travel.
CELL_SHARE = 0.06
SMALLEST_PATCH_SHARE = 0.02
# Cells grow with the root of the wanted error, and as less light comes from them. Of more receivers than these they are
# smaller, for they are then a small part of the work and many see them from close by; of fewer too, for these have few
# or none beside them to share their rays with. At most so many times finer or coarser in the end.
CELL_RECEIVERS, CELL_FACTORS = 25_000, (0.2, 4.0)

# The part of bounced light that the numbers below were found for (interiors), and the least that is planned for.
USUAL_SHARE = 0.5
LEAST_SHARE = 0.02

# Most rays of a usual row (`row_starts.py` gives some more, others fewer).
MOST_ROW_RAYS = 1024

# Rows have at least this part of the gather's rays: beside those of many receivers they are few, and along edges
# receivers see little else than one patch.
ROW_SHARE = 1 / 16

# Most rays of all receivers in the pilot.
MOST_PILOT_RAYS = 2**18

# So many receivers are few: their gather is no larger part of a bake than patches and audit.
FEW_RECEIVERS = 2**17

# Shadow rays to a lamp from a cell, at least and at most. All receivers read the same cells: what these err by is no
# noise to the gather, and no more of its rays help.
CELL_SAMPLES = (4, 16)
# Of many receivers those close by a cell see little else, and show how it errs. Shadow rays grow with the root of
# their number, as cells do, so that they stay the same part of a bake; so many times at most.
MORE_SAMPLES = 8

# Lumels that are audited.
AUDIT_LUMELS = 384


@dataclass(frozen=True)
class Plan:
    """What a bake spends: sizes in metres, rays by count.

    error : the wanted relative RMS error.
    patches : about how many there are before any is split for what the solution does inside it.
    row_rays : of all rows together, and of each at least.
    gather_rays : of every receiver; where they prove too noisy, more follow.
    cell_samples : shadow rays to a lamp from a cell.
    gather_error, direct_error, patch_error : relative errors that gather, direct light, and cells and patches may each
        have; of the last two, bakes against finer ones had about half.
    """

    error: float
    patches: int
    smallest_patch: float
    cell_size: float
    row_rays: tuple[int, int]
    gather_rays: int
    cell_samples: int
    gather_error: float
    direct_error: float
    patch_error: float

    def expected_error(self, gather: float) -> float:
        """The relative RMS error that a bake expects, from the one of its gather."""
        return float(np.sqrt(gather**2 + (self.direct_error**2 + self.patch_error**2) / 4))

    def rays_of_row(self, patches: int) -> int:
        """Rays of a usual row of so many patches: light comes from many patches, and their rows' errors are
        independent, so that few rays a row are enough where there are many rows."""
        everything, least = self.row_rays
        return int(np.clip(everything / max(patches, 1), least, max(least, MOST_ROW_RAYS)))


def plan(error: float, distance: float, bounced: float, receivers: int, glowing: float = 0.0) -> Plan:
    """The work for a wanted relative RMS error.

    Parameters
    ----------
    distance : how far the receivers usually see, metres.
    bounced : the part of their light that comes over other surfaces: patches and their rows serve only that, and may
        be as much coarser as it is less.
    receivers : how many there are.
    glowing : the part of their light that comes straight from emissive surfaces that no lamp stands for: cells serve it
        too.
    """
    share, of_cells = (max(part, LEAST_SHARE) / USUAL_SHARE for part in (bounced, bounced + glowing))
    finer = float(np.clip(0.03 / error * share, 0.1, 3.0))
    count = receivers / CELL_RECEIVERS
    finest = max(count**0.25, count**-0.125)
    coarser = np.clip(np.sqrt(error / 0.03) / of_cells / finest, *CELL_FACTORS)
    # A pilot that is enough where light is smooth, since neighbours share theirs. Of few receivers it may cost as much
    # as the rest of a bake, since fewer rays would make that little shorter.
    doublings = np.log2(64 * 0.03 / error)
    doublings = np.floor(doublings) + 1 if receivers <= FEW_RECEIVERS else np.round(doublings)
    gather = int(2 ** np.clip(doublings, 5, 9))
    return Plan(
        error=error,
        patches=int(6000 * finer),
        smallest_patch=SMALLEST_PATCH_SHARE * distance,
        cell_size=CELL_SHARE * distance * float(coarser),
        row_rays=(int(max(2**20 * finer, ROW_SHARE * receivers * gather)), int(np.clip(48 * finer, 32, 128))),
        gather_rays=gather,
        cell_samples=int(2 ** np.clip(np.round(np.log2(8 * 0.03 / error * share)), *np.log2(CELL_SAMPLES))
                         * 2 ** np.round(np.log2(np.clip(count**0.5, 1, MORE_SAMPLES)))),
        gather_error=0.7 * error,
        direct_error=0.2 * error,
        patch_error=0.3 * error,
    )


def pilot_rays(error: float) -> int:
    """First rays of all receivers together, which find the first patches and what matters of them."""
    return int(MOST_PILOT_RAYS * np.clip(0.03 / error, 1 / 8, 1))


def audit_paths(error: float) -> int:
    """Paths of each lumel that is audited.

    The audit's noise at one lumel, about 1 / sqrt(paths), may be more than the error that it is to see, as its mean
    square is taken off: so the paths need not grow with 1 / error^2, as a path tracer's. For the same rays, many paths
    at few lumels tell the mean square error better than few paths at many.
    """
    return int(np.clip(20 / error, 64, 4096))
