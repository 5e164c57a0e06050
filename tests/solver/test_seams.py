"""Seams: both sides agree, the rest stays as it was."""

from dataclasses import replace

import numpy as np
import pytest
from radiosity.solver.finish import finished, to_images
from radiosity.solver.lumels import lumels
from radiosity.solver.scene import Scene, Surface
from radiosity.solver.seam_samples import seam_samples
from radiosity.solver.seams import Seams, seam_taps, stiffness, texel_of
from radiosity.solver.settings import Settings

SIDE = 48
SETTINGS = Settings(uv_layer="UVMap", atlas="shared", resolution=SIDE, margin=4)
# Two unit squares side by side, sharing the edge x = 1; in the layout apart, the second one turned by 90 degrees and
# smaller, so that no texels face each other.
VERTICES = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0, 0], [2, 1, 0]], float)
TRIANGLES = np.array([[0, 1, 2], [0, 2, 3], [1, 4, 5], [1, 5, 2]])
LEFT = np.array([[.05, .05], [.45, .05], [.45, .45], [.05, .45]])
RIGHT = np.array([[.93, .52], [.93, .87], [.58, .87], [.58, .52]])
UV = np.concatenate([LEFT[[[0, 1, 2], [0, 2, 3]]], RIGHT[[[0, 1, 2], [0, 2, 3]]]])


def two_squares(vertices=VERTICES, triangles=TRIANGLES, surfaces=None):
    surfaces = surfaces or (Surface("both", 0, 4, lightmap_uv=UV),)
    return Scene(vertices, triangles, surfaces=surfaces)


def baked(scene, light):
    result = lumels(scene, SETTINGS, [])
    return result, to_images(result, light(result.receivers.position + scene.origin), SETTINGS)


def seams(result, scene, images, error=.1):
    """The seams, as stiff as the light of the lumels in the images asks."""
    return stiff_for(result, scene, np.concatenate([image.reshape(-1, 3) for image in images])[texel_of(result)], error)


def stiff_for(result, scene, values, error=.1):
    return Seams(seam_samples(result, scene), result, scene, values, np.full(len(result), error))


def filtered(image, uv):
    """What bilinear filtering shows at layout coordinates (n, 2)."""
    point = np.asarray(uv) * SIDE - .5
    corner = np.floor(point).astype(int)
    a, b = (point - corner).T[:, :, None]
    x, y = corner.T
    return ((1 - a) * (1 - b) * image[y, x] + a * (1 - b) * image[y, x + 1]
            + (1 - a) * b * image[y + 1, x] + a * b * image[y + 1, x + 1])


def gap(image):
    """RMS difference of the light on both sides of the seam."""
    t = np.linspace(.01, .99, 99)[:, None]
    left = filtered(image, LEFT[1] * (1 - t) + LEFT[2] * t)
    right = filtered(image, RIGHT[0] * (1 - t) + RIGHT[3] * t)
    return np.sqrt(np.mean((left - right) ** 2))


def rough(p):
    """Light 1 with a noise of .1, as two charts baked apart have it."""
    return 1 + np.random.default_rng(0).normal(0, .1, (len(p), 3))


def test_a_seam_closes():
    # Noise of 10 % on both sides: the difference across the seam falls by more than a factor of 3, and no lumel moves
    # by more than the noise's spread of three sigma.
    scene = two_squares()
    result, images = baked(scene, rough)
    stitched = seams(result, scene, images).stitch(images)
    assert gap(stitched[0]) < gap(images[0]) / 3
    change = (stitched[0] - images[0]).reshape(-1, 3)[result.pixel]
    assert np.abs(change).max() < .3


def test_lumels_are_as_stiff_as_the_square_of_the_step_beside_the_noise():
    # Light 1 on the left and b on the right, an error of e on both sides: a step of |b - 1|, in parts of 3 sqrt(2) e,
    # squared. Exact answers: 1 for a step within that, 4 for twice and 100 at the most for 20 times; with twice the
    # error a quarter of 4.
    scene = two_squares()
    result = lumels(scene, SETTINGS, [])
    taps = seam_taps(seam_samples(result, scene), result, scene)
    at_seam = np.unique(taps.texel[(taps.weight > .1) & (taps.owner[taps.texel] >= 0)])
    right = result.receivers.position[:, 0] + scene.origin[0] > 1
    error = .01
    step = 3 * np.sqrt(2) * error
    for part, errors, stiff in ((.5, error, 1), (2, error, 4), (20, error, 100), (2, 2 * error, 1)):
        light, noise = np.zeros((len(taps.owner), 3)), np.zeros(len(taps.owner))
        where = texel_of(result)
        light[where] = np.where(right, 1 + part * step, 1)[:, None]
        noise[where] = errors
        assert stiffness(taps, light, noise)[at_seam] == pytest.approx(stiff, rel=1e-9)


def test_a_step_of_light_moves_lumels_less_than_noise_does():
    # Light 1 and 1.1, and light 1 and 4, on two charts, known to 3 %: exact answer none; of the larger step a smaller
    # part is taken.
    scene = two_squares()
    parts = []
    for bright in (1.1, 4):
        result, images = baked(scene, lambda p, bright=bright: np.where(p[:, :1] > 1, bright, 1) * np.ones(3))
        change = seams(result, scene, images, .03).stitch(images)[0] - images[0]
        parts.append(np.abs(change.reshape(-1, 3)[result.pixel]).max() / (bright - 1))
    assert parts[1] < parts[0] / 5


def test_a_chart_without_lumels_moves_none_beside_it():
    # The right square's chart is a quarter of a texel wide, between texels' centres: it has no lumel, and what its
    # texels show was spread there from elsewhere. Exact answer: the left square's lumels stay, and both sides agree.
    thin = RIGHT.copy()
    thin[:, 0] = np.where(thin[:, 0] > .7, 36.25, 36) / SIDE
    scene = two_squares(surfaces=(Surface("both", 0, 4, lightmap_uv=np.concatenate(
        [LEFT[[[0, 1, 2], [0, 2, 3]]], thin[[[0, 1, 2], [0, 2, 3]]]])),))
    result, images = baked(scene, rough)
    assert (result.receivers.triangle < 2).all()
    images[0][:, 30:] = 5
    stitched = seams(result, scene, images).stitch(images)
    assert np.array_equal(*(image.reshape(-1, 3)[result.pixel] for image in (images[0], stitched[0])))
    t = np.linspace(.1, .9, 33)[:, None]
    left = filtered(stitched[0], LEFT[1] * (1 - t) + LEFT[2] * t)
    right = filtered(stitched[0], thin[0] * (1 - t) + thin[3] * t)
    assert np.abs(left - right).mean() < .1


def test_what_lumels_show_of_others_gives_way():
    # Light 1, and a right square that nobody sees: it shows 3, which the margin grew over it. Exact answer: the left
    # square's lumels stay.
    scene = two_squares()
    result, images = baked(scene, lambda p: np.where(p[:, :1] > 1, 3, 1) * np.ones(3))
    values = images[0].reshape(-1, 3)[result.pixel]
    left = result.receivers.triangle < 2
    stitched = Seams(seam_samples(result, scene), result, scene, values, np.full(len(result), .1), left).stitch(images)
    assert np.array_equal(stitched[0].reshape(-1, 3)[result.pixel[left]], values[left])
    assert gap(stitched[0]) < gap(images[0]) / 3


def test_parts_of_the_light_add_up_after_stitching():
    # Noise of two lamps apart, stitched as their sum asks. Exact answer: the sum stitched.
    scene = two_squares()
    result, first = baked(scene, rough)
    second = baked(scene, lambda p: 2 - rough(p[::-1]))[1]
    both = [one + other for one, other in zip(first, second, strict=True)]
    made = seams(result, scene, both)
    apart = made.stitch(first)[0] + made.stitch(second)[0]
    assert apart == pytest.approx(made.stitch(both)[0], abs=1e-3)


def test_only_texels_at_the_seam_change():
    # All texels further than two texels from both sides of the seam keep their bits.
    scene = two_squares()
    result, images = baked(scene, rough)
    changed = np.argwhere((seams(result, scene, images).stitch(images)[0] != images[0]).any(axis=2))[:, ::-1] + .5
    near_left = np.abs(changed[:, 0] - .45 * SIDE) < 2
    near_right = np.abs(changed[:, 1] - .52 * SIDE) < 2
    assert len(changed) > 20
    assert (near_left | near_right).all()


def test_light_that_is_continuous_stays():
    # E = 1 + x + y: filtered, both sides differ by the margin's constant extension only; the truth at the lumels moves
    # by less than 2 % and the seam still gets better.
    scene = two_squares()
    result, images = baked(scene, lambda p: np.repeat(1 + p[:, :1] + p[:, 1:2], 3, axis=1))
    stitched = seams(result, scene, images).stitch(images)
    covered = np.zeros(SIDE * SIDE, bool)
    covered[result.pixel] = True
    change = (stitched[0] / np.maximum(images[0], 1e-9) - 1).reshape(-1, 3)[covered]
    assert np.abs(change).max() < .02
    assert gap(stitched[0]) <= gap(images[0])


def test_a_crease_keeps_both_its_lights():
    # The right square folded up by 90 degrees: nothing changes.
    folded = VERTICES.copy()
    folded[4:, 0], folded[4:, 2] = 1, 1
    scene = two_squares(folded)
    result, images = baked(scene, rough)
    assert np.array_equal(seams(result, scene, images).stitch(images)[0], images[0])


@pytest.mark.parametrize(("tilt", "joined"), [(0, True), (.1, False)])
def test_objects_are_joined_only_where_they_are_flush(tilt, joined):
    # The same squares as two objects that touch: in one plane they are stitched, with one tilted by 6 degrees not.
    vertices = np.vstack([VERTICES[:4], VERTICES[[1, 4, 5, 2]]])
    vertices[[5, 6], 2] = tilt
    triangles = np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]])
    scene = two_squares(vertices, triangles, (Surface("left", 0, 2, lightmap_uv=UV[:2]),
                                              Surface("right", 2, 2, lightmap_uv=UV[2:])))
    result, images = baked(scene, rough)
    assert (seams(result, scene, images).stitch(images)[0] != images[0]).any() == joined


def test_a_chart_without_seams_is_returned_as_it_was():
    # One square alone: the same pixels, in a copy.
    scene = Scene(VERTICES[:4], TRIANGLES[:2], surfaces=(Surface("one", 0, 2, lightmap_uv=UV[:2]),))
    result, images = baked(scene, rough)
    stitched = seams(result, scene, images).stitch(images)
    assert np.array_equal(stitched[0], images[0])
    assert stitched[0] is not images[0]


def test_objects_that_touch_without_common_corners_are_joined():
    # The right square reaches from y = -.5 to 1.5: no edge has the same ends as one of the left square's. Noise of
    # 10 %: the difference along their common edge falls by more than a factor of 3.
    vertices = np.vstack([VERTICES[:4], [[1, -.5, 0], [2, -.5, 0], [2, 1.5, 0], [1, 1.5, 0]]])
    triangles = np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]])
    scene = two_squares(vertices, triangles, (Surface("left", 0, 2, lightmap_uv=UV[:2]),
                                              Surface("right", 2, 2, lightmap_uv=UV[2:])))
    result, images = baked(scene, rough)
    stitched = seams(result, scene, images).stitch(images)
    # y = 0 ... 1 is the middle half of the right square's edge.
    low, high = (RIGHT[0] * 3 + RIGHT[3]) / 4, (RIGHT[0] + RIGHT[3] * 3) / 4

    def common_gap(image):
        t = np.linspace(.02, .98, 49)[:, None]
        left, right = filtered(image, LEFT[1] * (1 - t) + LEFT[2] * t), filtered(image, low * (1 - t) + high * t)
        return np.sqrt(np.mean((left - right) ** 2))

    assert common_gap(stitched[0]) < common_gap(images[0]) / 3


@pytest.mark.parametrize("far", [3, 1e3, 1e5])
def test_a_step_between_objects_is_no_seam(far):
    # The right square lies 2 cm lower, as beside a mat, and a third object so many metres away. No seam, wherever that
    # is; with both in one plane there is one.
    for step, joined in ((0.02, False), (0.0, True)):
        right, away = VERTICES[[1, 4, 5, 2]] - [0, 0, step], VERTICES[:3] + np.array([far, 0, 5])
        points = np.concatenate([VERTICES[:4], right, away])
        triangles = np.concatenate([TRIANGLES[:2], TRIANGLES[:2] + 4, [[8, 9, 10]]])
        surfaces = (Surface("left", 0, 2, lightmap_uv=UV[:2]), Surface("right", 2, 2, lightmap_uv=UV[2:]),
                    Surface("far", 4, 1, receives=False))
        scene = two_squares(points, triangles, surfaces)
        assert bool(len(seam_samples(lumels(scene, SETTINGS, []), scene))) == joined


def test_a_wall_on_a_floor_is_no_seam():
    # The right square stands on the left one's edge, a little shorter: touching, but not flush. Nothing changes.
    vertices = np.vstack([VERTICES[:4], [[1, .1, 0], [1, .9, 0], [1, .9, 1], [1, .1, 1]]])
    triangles = np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]])
    scene = two_squares(vertices, triangles, (Surface("left", 0, 2, lightmap_uv=UV[:2]),
                                              Surface("right", 2, 2, lightmap_uv=UV[2:])))
    result, images = baked(scene, rough)
    assert np.array_equal(seams(result, scene, images).stitch(images)[0], images[0])


def test_without_a_margin_seams_are_stitched_and_empty_texels_stay_black():
    # Margin 0: lumels are as with a margin of 1, all other texels are 0.
    scene = two_squares()
    result = lumels(scene, SETTINGS, [])
    values = rough(result.receivers.position).astype(np.float32)
    without, = finished(result, stiff_for(result, scene, values), values, replace(SETTINGS, margin=0))
    within, = finished(result, stiff_for(result, scene, values), values, replace(SETTINGS, margin=1))
    covered = np.zeros(SIDE * SIDE, bool)
    covered[result.pixel] = True
    assert np.array_equal(without.reshape(-1, 3)[covered], within.reshape(-1, 3)[covered])
    assert not without.reshape(-1, 3)[~covered].any()
    assert gap(within) < gap(to_images(result, values, SETTINGS)[0]) / 2


def test_what_holds_the_surfaces_colour_is_not_stitched():
    # Radiosity of a red square beside a green one has a step. Exact answer: the images are as they were dilated.
    scene = two_squares()
    result = lumels(scene, SETTINGS, [])
    values = rough(result.receivers.position).astype(np.float32)
    settings = replace(SETTINGS, quantity="radiosity")
    assert np.array_equal(finished(result, stiff_for(result, scene, values), values, settings)[0],
                          to_images(result, values, settings)[0])
