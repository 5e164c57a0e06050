"""The way of the light. Read this file first: it lists the steps of a bake, in their order.

    receivers   lumels of an unwrapped mesh, or points for mesh corners: position, normal, footprint
    lamps       area, point, spot, sun, and emissive triangles bright enough to be worth a shadow ray
    cells       every surface cut on its triangles' barycentric grids, filled when first met
    patches     clusters of cells; only the smooth indirect light lives on them
    rows        form factors F_ij: quasi-random rays from each patch, kept raw
    solve       H = q + F (rho H), all channels at once
    gather      the indirect light of every receiver: one more bounce, from cells and patches
    direct      the lamps' light at every receiver: closed form times the part that shadow rays find free
    audit       path tracing at random receivers, beside all of this, says how wrong the bake is
    finish      encode, dilate, stitch seams
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .across import links
from .adaptive import PEAK, Level, gather_adaptively
from .audit import Auditor, Truth, error_bar
from .cells import Cells
from .closure import PatchTable, patch_table
from .direct import PILOT_RAYS as PILOT
from .direct import DirectLight
from .energy import EnergyBalance, energy_balance
from .errors import NothingToBake
from .fans import Fans
from .finish import finished, texels
from .footprints import ReceiverFootprints
from .gather import Gather, Look
from .geometry import Geometry
from .groups import LightGroup
from .importance import Importance, look_around
from .layout import Layout
from .lumels import lumels as lay_out
from .neighbours import LumelNeighbours, Neighbours
from .parallel import Run
from .patches import Patches
from .path_keeper import PathKeeper, rays_kept
from .paths import Paths
from .plan import AUDIT_LUMELS, MOST_ROW_RAYS, audit_paths, pilot_rays, plan
from .probes import free_receivers, probes, triangle_middles
from .quantities import encode
from .receivers import Receivers
from .result import Bake, Lightmap, Solution, Stages, refuse_singular, report
from .scene import Scene
from .seam_samples import seam_samples
from .seams import Seams
from .settings import Settings
from .shells import Shells
from .sight import Sight
from .sources import light_sources
from .split import Split, group_light, split_lights
from .transport import Transport
from .unseen import shown
from .vertices import corner_receivers

Float = NDArray[np.floating[Any]]
Progress = Callable[[str, float], None]

# Rays of a receiver in the pilot that finds the first patches; and for how many of them there is a path that goes on.
PILOT_RAYS, PATH_SHARE = 16, 4
# Times that patches are split by what the solution does inside them, and how much a patch may add to the error over
# its fair part of what is wanted.
MOST_REFINEMENTS = 6
REFINE_SHARE = 3.0
# No more patches than one of so many that are planned are split for being wide.
WIDE_SHARE = 16
# Where the triangles that the receivers see have no more cells than this, all of them take part, met or not, and the
# energy adds up over whole surfaces.
COMPLETE_CELLS = 2**18
# Places over which `solve` takes the means of triangles, about.
SOLVED_PLACES = 2**17
# Cells are divided in which the lamps' light varies by more than this many times the wanted error of the mean light.
STEEP = 24.0
# Of more lamps than this, cells make do with the least shadow rays to each: together they are many.
FEW_LAMPS = 16
# All rows are traced anew, with MORE_RAYS times the rays, while their noise shifts the mean light by more than this
# part of the wanted error; so often at most, and while all rows hold no more hits (up to 17 bytes each).
LEVEL_SHARE, MORE_RAYS, MOST_RETRACED, MOST_HITS = 0.12, 4, 2, 3 * 2**24
# Residuals of the linear system that are small enough to see where to split patches, and at the end.
ROUGH, TOLERANCE = 1e-2, 1e-5
# The audit's random numbers start here, so that it shares none with the bake.
AUDIT_SEED = 0x5EED
# What light over several surfaces adds to that over one, about.
MORE_BOUNCES = 2.0
# Shadow rays of a first look at a lamp from a receiver without neighbours to tell it of occluders that it missed.
LONE_PILOT = 64
# Receivers whose direct light says how bright the scene is.
LEVEL_SAMPLE = 2048


class _Work:
    """A scene on its way through the steps above."""

    def __init__(self, scene: Scene, settings: Settings, progress: Progress | None,
                 cancelled: Callable[[], bool] | None, groups: Sequence[LightGroup] = (), *,
                 keep_paths: bool = False, geometry: Geometry | None = None) -> None:
        self.scene, self.settings, self._keep_paths = scene, settings, keep_paths
        self.paths: Paths | None = None
        self.run = Run(settings.thread_count, progress, cancelled)
        self.stages = Stages(self.run)
        self.warnings: list[dict[str, Any]] = []
        with self.stages("prepare"):
            self.geometry = geometry or Geometry(scene)
            if not self.geometry.area.any():
                raise NothingToBake("the scene has no triangle that has an area: add a mesh")
            self.split: Split | None = None
            if groups:
                self.lights, self.sampled_emitter, self.split = split_lights(self.geometry, groups, settings.passes)
            else:
                self.lights, self.sampled_emitter = light_sources(self.geometry)
            if not (self.lights or np.any(scene.emission) or not scene.sky.is_black):
                raise NothingToBake("the scene has no light: add a lamp, an emissive material or a world colour")
            notice = self.geometry.visibility.notice
            if notice:
                self.warnings.append({"object": "", "code": "slow_rays", "message": notice})
            self.direct = DirectLight(self.geometry, self.lights, settings.seed, self.split)

    def transport(self, receivers: Receivers, places: ReceiverFootprints, bounced: float | None = None,
                  fronts: int = 0) -> Transport:
        """Cells, patches, rows, solved, for what these receivers can see, and for cells at about so many places on all
        `fronts`; `bounced` is the part of their light that patches carry, found if not given."""
        with self.stages("patches"):
            pilot = pilot_rays(self.settings.error)
            looks = look_around(self.geometry, places, self.sampled_emitter, pilot // PATH_SHARE, self.settings.seed,
                                self.run)
            lamps, lit = self._lamp_level(receivers)
            straight = lamps + looks.straight
            share = self._bounced_share(looks, straight) if bounced is None else bounced
            glowing = looks.glowing * (1 - share) / max(straight, 1e-30)
            self.plan = plan(self.settings.error, looks.distance, share, len(receivers), glowing)
            transport = self._unmet(looks, straight)
            self.fans = Fans(places)
            some = np.arange(0, len(places), max(1, len(places) * PILOT_RAYS // pilot))
            look = Look(some, PILOT_RAYS, 0, self.settings.seed + 1)
            seen = Sight(transport, Gather(transport).meet(self.fans, look, self.run))
            transport.starts.see(seen.cell)
            transport.meet_whole(transport.cells.companions(COMPLETE_CELLS))
            self.fronts = transport.cells.fronts(fronts) if fronts else np.empty(0, np.int64)
            transport.meet_whole(self.fronts)
        rays = self._trace_rows(transport, seen, straight)
        self._refine(transport, seen, looks, rays)
        with self.stages("solve"):
            self.linear = transport.solve(TOLERANCE)
            transport.solve_apart(TOLERANCE)
        refuse_singular(self.linear, self.scene)
        self.level = Level(lamps, lit, looks.straight + seen.light())
        return transport

    def _unmet(self, looks: Importance, straight: float) -> Transport:
        """The transport side before any ray; `straight` is the mean light that comes without a bounce, W/m2."""
        corners = self.geometry.corners.reshape(-1, 3)
        patches = Patches(Shells.of(self.geometry.corners), corners.min(axis=0), corners.max(axis=0),
                          self.plan.smallest_patch, looks.distance, self.geometry.visibility)
        if looks.spots is not None:
            patches.grow(looks.spots, looks.weight, looks.seen_from, float(looks.weight.sum()) / self.plan.patches)
        cells = Cells(self.geometry, self.plan.cell_size)
        transport = Transport(self.geometry, self.direct, self.sampled_emitter, cells, patches, self.settings.seed,
                              self.run)
        if len(self.lights) <= FEW_LAMPS:
            transport.met.samples = self.plan.cell_samples
        transport.met.steep = STEEP * self.settings.error * straight
        return transport

    def _trace_rows(self, transport: Transport, seen: Sight, straight: float) -> int:
        """Trace the rows of all patches, anew while their noise is seen in the mean light; the rays of a row."""
        rays = self.plan.rays_of_row(len(transport.patches))
        with self.stages("form factors"):
            transport.discover(rays)
        self._solve_roughly(transport)
        for _ in range(MOST_RETRACED):
            noise = transport.level_noise(seen.share()) / max(straight + seen.light(), 1e-30)
            more = rays * MORE_RAYS
            too_many = more > MOST_ROW_RAYS or more * len(transport.patches) > MOST_HITS
            if noise <= LEVEL_SHARE * self.settings.error or too_many:
                break
            rays = more
            with self.stages("form factors"):
                transport.retrace(rays)
            self._solve_roughly(transport)
        return rays

    def _refine(self, transport: Transport, seen: Sight, looks: Importance, rays: int) -> None:
        """Split patches by what the solution does inside them."""
        since = 0
        with self.stages("refine"):
            light = seen.light()
            transport.peak = PEAK * (looks.straight + light)
            tolerance = REFINE_SHARE * self.settings.error * light / np.sqrt(max(self.plan.patches, 1))
            wide = transport.wide(self.plan.patches // WIDE_SHARE)
            for _ in range(MOST_REFINEMENTS):
                before = len(transport.patches)
                if not transport.refine(tolerance, seen.matters(), wide, since):
                    break
                transport.discover(rays)
                transport.relax(before)
                since, wide = before, wide[:0]

    def _solve_roughly(self, transport: Transport) -> None:
        with self.stages("solve"):
            self.linear = transport.solve(ROUGH)

    def light(self, receivers: Receivers, near: Neighbours) -> tuple[Float, Float]:
        """Direct (with the sky's and gathered emitters') and indirect irradiance of receivers: (n, 3) each, W/m2."""
        places = ReceiverFootprints(self.geometry, receivers, self.settings.footprint, self.settings.seed)
        self.run.check()
        # The audit asks nothing of the bake until both are done: it fills what threads the bake leaves idle.
        with self.run.beside("audit", partial(self._truth, places, near)) as truth:
            direct, bounced = self.unaudited_light(receivers, places, near)
            with self.stages("audit"):
                found = truth()
                passes = self.settings.passes
                self.error = error_bar(_passes(direct[found.rows], bounced[found.rows], passes), found.groups(passes),
                                       self.expected)
        return direct, bounced

    def unaudited_light(self, receivers: Receivers, places: ReceiverFootprints,
                        near: Neighbours | None) -> tuple[Float, Float]:
        """As `light`, with nobody to tell how good it is."""
        # What lies under a touching face is rightly dark, and no filter may mix that with what is seen.
        near = near and near.without(places.covered)
        self.transported = self.transport(receivers, places)
        with self.stages("gather"):
            self.transported.keeper = keeper = self._keeper(len(receivers))
            gathered = gather_adaptively(self.transported, self.fans, self.plan, self.level, self.settings.seed, near)
            self.paths = keeper.paths(self.transported) if keeper is not None else None
        with self.stages("direct"):
            level = (self.level.lamps + float(gathered.first.mean() + gathered.bounced.mean())) / gathered.lit
            self.expected = self.plan.expected_error(gathered.error / max(level, 1e-30))
            self.errors = np.sqrt(gathered.square_error)
            lit = self.direct.apart(places, self.run, level * self.plan.direct_error, PILOT if near else LONE_PILOT,
                                    neighbours=near.at(1) if near else None)
            self.apart = gathered.apart if self.settings.passes == "indirect" else gathered.apart + lit[:, 3:]
        return gathered.first + lit[:, :3], gathered.bounced

    def _keeper(self, receivers: int) -> PathKeeper | None:
        """What takes down the paths, if they are to be kept and are not too many."""
        traced = self.plan.gather_rays // 2
        if not self._keep_paths or self.settings.passes == "direct":
            return None
        if not rays_kept(receivers, traced):
            self.warnings.append({"object": "", "code": "no_paths", "message": f"what new reflectances would need of "
                                  f"{receivers} receivers is too large to be kept: they will need another bake"})
            return None
        return PathKeeper(receivers, traced)

    def _lamp_level(self, receivers: Receivers) -> tuple[float, float]:
        """The mean of the lamps' light over a sample of the receivers, W/m2, and which part of these it arrives at."""
        sample = receivers.take(np.linspace(0, len(receivers) - 1, min(len(receivers), LEVEL_SAMPLE)).astype(int))
        places = ReceiverFootprints(self.geometry, sample, self.settings.footprint, self.settings.seed)
        light = self.direct.irradiance(places, self.run) * (self.settings.passes != "indirect")
        return float(light.mean()), float(light.any(axis=1).mean())

    def _bounced_share(self, looks: Importance, straight: float) -> float:
        """About which part of the receivers' light comes over other surfaces, 0 ... 1; `straight` is the mean of the
        rest, W/m2."""
        if looks.spots is None:
            return 0.0
        some = np.linspace(0, looks.first - 1, min(looks.first, LEVEL_SAMPLE)).astype(int)
        spots = looks.spots.take(some)
        there = free_receivers(spots.points, spots.normals, self.geometry.surface[spots.triangle])
        met = ReceiverFootprints(self.geometry, there, 0.0, self.settings.seed)
        lit = self.direct.irradiance(met, self.run).mean(axis=1)
        once = float((looks.weight[some] * lit).mean()) * looks.first / looks.paths
        bounced = MORE_BOUNCES * once + looks.bounced
        return bounced / max(straight + bounced, 1e-30)

    @contextmanager
    def patch_figures(self, receivers: Receivers, light: Float
                      ) -> Iterator[Callable[[], tuple[EnergyBalance, PatchTable]]]:
        """The scene's energy, with the receivers' light (n, 3), and what tells of patches, added up beside what is done
        meanwhile."""
        transport, seed = self.transported, self.settings.seed
        with (self.run.beside("energy", lambda run: energy_balance(transport, receivers, light, seed, run)) as balance,
              self.run.beside("energy", lambda run: patch_table(transport)) as table):
            yield lambda: (balance(), table())

    def _truth(self, places: ReceiverFootprints, near: Neighbours, run: Run) -> Truth:
        """Path trace receivers drawn at random; of lumels the inner ones, as against a renderer."""
        inner = np.flatnonzero(near.inner())
        pool = inner if len(inner) else np.arange(len(places))
        auditor = Auditor(self.geometry, self.lights, self.sampled_emitter, AUDIT_SEED + self.settings.seed)
        return auditor.truth_at_random(places, pool, AUDIT_LUMELS, audit_paths(self.settings.error), run)


def bake(scene: Scene, settings: Settings, progress: Progress | None = None,
         cancelled: Callable[[], bool] | None = None, groups: Sequence[LightGroup] = (),
         layout: Layout | None = None, *, keep_paths: bool = False, geometry: Geometry | None = None) -> Bake:
    """Bake a scene: the whole way of the light.

    Parameters
    ----------
    scene, settings : what to bake, and how well.
    progress : called with (stage, fraction), from worker threads too.
    cancelled : asked now and then whether to stop.
    groups : lights to be kept apart; the result is the same, and the groups add up to it.
    layout : where the light goes, from `make_layout` for these settings; None makes it.
    keep_paths : keep what other reflectances need, so that `relight` can follow them; the result is the same.
    geometry : the scene's, where it is baked more than once; None makes it.

    Returns
    -------
    Bake
        Lightmaps (or corner colours), the layout, and the report.

    Raises
    ------
    NothingToBake, UnwrapError, SceneError, Cancelled
        See `solver.errors`.
    """
    work = _Work(scene, settings, progress, cancelled, groups, keep_paths=keep_paths, geometry=geometry)
    if settings.target == "vertex":
        return _bake_vertices(work)
    with work.stages("lumels"):
        lumels = lay_out(scene, settings, work.warnings, work.run.step, layout)
        samples = seam_samples(lumels, scene, work.run.check, work.geometry.solid)
        near = LumelNeighbours(lumels, links(samples, lumels, scene))
        work.run.check()
    direct, bounced = work.light(lumels.receivers, near)
    light = direct + bounced
    with work.patch_figures(lumels.receivers, light) as figures:
        with work.stages("finish"):
            triangle = lumels.receivers.triangle
            albedo = work.geometry.reflectance(triangle, *lumels.receivers.barycentric.T)
            values = encode(_passes(direct, bounced, settings.passes), settings.quantity, albedo)
            whose = shown(work.fans, work.geometry, near, light, settings, work.run)
            errors = work.errors / np.maximum(light.mean(axis=1), np.maximum(work.errors, 1e-30))
            work.run.check()
            own = whose == np.arange(len(whose))
            seams = Seams(samples, lumels, scene, values[whose], errors[whose], own)
            work.run.check()
            images = finished(lumels, seams, values[whose], settings, work.run)
            layers = group_light(work.split, work.apart, settings.quantity, albedo,
                                 lambda part: finished(lumels, seams, part[whose], settings, work.run))
            placed = [(surface.name, int(page)) for surface, page in
                      zip(scene.surfaces, lumels.page_of_surface, strict=True)]
            lightmaps = tuple(Lightmap(page.name, pixels, tuple(name for name, place in placed if place == number),
                                       texels(lumels, number, ~own))
                              for number, (page, pixels) in enumerate(zip(lumels.pages, images, strict=True)))
        report, patches = _reported(work, len(lumels), figures)
    return Bake(lightmaps, lumels.uv, lumels.page_of_surface, None, report, layers, patches, work.paths)


def _bake_vertices(work: _Work) -> Bake:
    with work.stages("lumels"):
        receivers, near, fit = corner_receivers(work.scene, work.settings, work.run)
    direct, bounced = work.light(receivers, near)
    with work.patch_figures(receivers, direct + bounced) as figures:
        with work.stages("finish"):
            albedo = work.geometry.reflectance(receivers.triangle, *receivers.barycentric.T)
            values = encode(_passes(direct, bounced, work.settings.passes), work.settings.quantity, albedo)
            colours = tuple(fit(values))
            layers = group_light(work.split, work.apart, work.settings.quantity, albedo,
                                 lambda light: fit(light, values))
        report, patches = _reported(work, len(receivers), figures)
    nowhere = np.full(len(work.scene.surfaces), -1, np.int32)
    return Bake((), tuple(None for _ in work.scene.surfaces), nowhere, colours, report, layers, patches, work.paths)


def solve(scene: Scene, settings: Settings) -> Solution:
    """The radiosity solution on patches alone, seen from every triangle of the scene.

    Returns
    -------
    Solution
        Radiosity and irradiance (t, 3) W/m2 of each triangle's front, the linear solver's outcome, statistics.
    """
    work = _Work(scene, settings, None, None)
    receivers = triangle_middles(work.geometry)
    places = ReceiverFootprints(work.geometry, receivers, settings.footprint, settings.seed)
    # Here patches are all that is asked for, whatever light comes straight.
    transport = work.transport(receivers, places, bounced=1.0, fronts=SOLVED_PLACES)
    return Solution.of(work.geometry, transport, work.fronts, work.linear, work.stages)


def irradiance(scene: Scene, settings: Settings, points: Float, normals: Float, progress: Progress | None = None,
               cancelled: Callable[[], bool] | None = None, surfaces: NDArray[np.integer[Any]] | None = None) -> Float:
    """Irradiance at receivers anywhere: points (n, 3) metres, normals (n, 3) -> (n, 3) float32, W/m2.

    Lamps with links shine on them as on `surfaces` (n,) of the scene, -1 for none; without it as on nothing's surface.
    """
    work = _Work(scene, settings, progress, cancelled)
    receivers = probes(scene, points, normals, surfaces)
    if not len(receivers):
        return np.zeros((0, 3), np.float32)
    places = ReceiverFootprints(work.geometry, receivers, settings.footprint, settings.seed)
    direct, bounced = work.unaudited_light(receivers, places, None)
    return _passes(direct, bounced, settings.passes)


def _passes(direct: Float, bounced: Float, passes: str) -> Float:
    return {"direct": direct, "indirect": bounced}.get(passes, direct + bounced)


def _reported(work: _Work, lumels: int, figures: Callable[[], tuple[EnergyBalance, PatchTable]]
              ) -> tuple[dict[str, Any], PatchTable]:
    with work.stages("energy"):
        balance, patches = figures()
    return report(work.scene, work.settings, work.stages, lumels, work.transported, work.error, balance, work.linear,
                  work.warnings), patches
