"""What stands between our benchmarks and other people's programs; the programs themselves need not be installed."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest
from radiosity.benchmarks import chart
from radiosity.benchmarks.cycles.compare import Row
from radiosity.benchmarks.form_factors import peers as form_factor_peers
from radiosity.benchmarks.form_factors.cases import BY_NAME
from radiosity.benchmarks.peers import environment, mitsuba_bake, oidn, twin_arrays, view_factors
from radiosity.benchmarks.peers.run import quickest


@pytest.fixture
def no_peers(monkeypatch, tmp_path):
    """An environment of the peers that does not exist."""
    monkeypatch.setattr(environment, "FOLDER", tmp_path / "nothing")
    monkeypatch.delenv("DRJIT_LIBLLVM_PATH", raising=False)


def test_every_peer_is_pinned_to_one_version():
    # Curves of other versions would be other curves.
    assert len(environment.wanted()) == 5
    assert all(requirement.count("==") == 1 for requirement in environment.wanted())


def test_a_peer_that_is_not_installed_is_named_with_the_command_that_installs_it(no_peers):
    with pytest.raises(environment.PeerError, match=r"mitsuba is not installed: run python -m benchmarks\.peers"):
        environment.require("mitsuba")
    assert environment.llvm() is None
    assert oidn.lightmap() is None


def test_form_factors_without_peers_say_what_is_missing_and_have_no_rows(no_peers, tmp_path):
    rows, problems = form_factor_peers.rows((BY_NAME["P-01"],), 16, 1, 1, tmp_path)
    assert rows == []
    assert set(problems) == {"pyviewfactor", "raystrack rays", "raystrack pairs"}


def test_a_script_that_fails_gives_its_last_line(monkeypatch, tmp_path):
    # A peer's crash must not look like a missing curve without a reason.
    script = tmp_path / "broken.py"
    script.write_text("raise SystemExit('no such lamp')\n")
    monkeypatch.setattr(environment, "python", lambda: environment.Path(environment.sys.executable))
    with pytest.raises(environment.PeerError, match="broken ended with code 1 and said: no such lamp"):
        environment.run(script, {}, tmp_path)


def test_gaps_between_charts_take_the_value_of_the_nearest_lumel():
    # One row of five pixels, covered at both ends: 1 . . . 3; the middle is as near to either.
    image = np.zeros((1, 5, 3))
    image[0, 0], image[0, 4] = 1, 3
    covered = np.array([[True, False, False, False, True]])
    filled = oidn.filled(image, covered)[0, :, 0]
    assert filled[[0, 1, 3, 4]].tolist() == [1, 1, 3, 3]
    assert filled[2] in (1, 3)


def test_the_denoiser_takes_the_noise_off_a_flat_picture_and_keeps_its_mean():
    # Radiance 2 with 20 % noise on 64 x 64 pixels: three quarters of the noise go and the
    # mean moves below 1 %: pixels reach the library and come back. How well it denoises is its own affair.
    denoiser = oidn.blenders()
    if denoiser is None:
        pytest.skip("the bpy wheel holds no Open Image Denoise here")
    noisy = (2 + 0.4 * np.random.default_rng(0).standard_normal((64, 64, 3))).astype(np.float32)
    (clean,) = oidn.denoise(denoiser, [noisy])
    assert np.sqrt(np.square(clean - 2).mean()) < 0.25 * np.sqrt(np.square(noisy - 2).mean())
    assert abs(clean.mean() - 2) < 0.02


def test_a_filter_that_a_library_does_not_have_is_an_error_and_no_black_picture():
    denoiser = oidn.blenders()
    if denoiser is None:
        pytest.skip("the bpy wheel holds no Open Image Denoise here")
    with pytest.raises(environment.PeerError, match="Open Image Denoise said"):
        oidn.denoise(oidn.Denoiser(denoiser.library, "NoSuchFilter"), [np.ones((8, 8, 3))])


def test_places_lie_in_the_central_half_of_the_texel_and_in_its_triangle():
    # The triangle (0,0) (1,0) (0,1) with texels of .1; one lumel in the middle, one whose texel the long side cuts.
    arrays = {
        "corners": np.array([[[0, 0, 0], [1, 0, 0], [0, 1, 0]]], np.float32),
        "lumel_triangle": np.zeros(2, np.int32),
        "lumel_weight": np.array([[0.25, 0.25], [0.49, 0.49]], np.float32),
        "lumel_step": np.tile(np.array([[0.1, 0], [0, 0.1]], np.float32), (2, 1, 1)),
    }
    lumel = np.repeat([0, 1], 2000)
    place = mitsuba_bake.Places(arrays, 0.5, 0)(lumel)[:, :2]
    assert np.abs(place - arrays["lumel_weight"][lumel]).max() <= 0.025 + 1e-6
    assert place.sum(axis=1).max() <= 1 + 1e-6
    np.testing.assert_allclose(place[lumel == 0].mean(axis=0), [0.25, 0.25], atol=0.002)


def test_an_emissive_face_becomes_two_that_look_opposite_ways():
    # Blender's emission leaves both sides, the peers' one: two faces .1 mm apart, each looking away from the other.
    triangle = np.array([[[0, 0, 0], [1, 0, 0], [0, 1, 0]]], np.float32)
    arrays = {
        "corners": np.concatenate([triangle, triangle + 5]),
        "reflectance": np.full((2, 3), 0.5, np.float32),
        "radiance": np.array([[7, 7, 7], [0, 0, 0]], np.float32),
        "lamp_corners": np.empty((0, 3, 3), np.float32),
        "lamp_radiance": np.empty((0, 3), np.float32),
    }
    found = mitsuba_bake.parts(arrays)
    lit = [corners[0] for corners, _, radiance in found if radiance.any()]
    assert len(found) == 3
    assert len(lit) == 2
    heights, normals = [c[0, 2] for c in lit], [np.cross(c[1] - c[0], c[2] - c[0])[2] for c in lit]
    assert sorted(normals) == [-1, 1]
    assert heights[normals.index(1)] - heights[normals.index(-1)] == pytest.approx(mitsuba_bake.APART)


def test_a_cut_polygon_keeps_its_area_and_its_side():
    # A 2 x 1 rectangle that faces up, cut 4 x 4: sixteen quadrilaterals of 1/8, all facing up.
    vertices, corners = view_factors._quads(np.array([[0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0]], float), 4)
    quads = vertices[corners]
    area = np.cross(quads[:, 2] - quads[:, 0], quads[:, 3] - quads[:, 1])[:, 2] / 2
    np.testing.assert_allclose(area, np.full(16, 1 / 8))


def test_values_of_lumels_come_back_to_their_texels():
    # Two receivers of 2 x 2 texels: lumels 1 and 2 on the first, 3 on the second.
    arrays = {"page_names": np.array(["floor", "wall"]), "lumel_page": np.array([0, 0, 1]),
              "lumel_pixel": np.array([0, 3, 2])}
    images = twin_arrays.images(np.array([[1.0] * 3, [2.0] * 3, [3.0] * 3]), arrays, 2)
    assert images["floor"][..., 0].tolist() == [[1, 0], [0, 2]]
    assert images["wall"][..., 0].tolist() == [[0, 0], [3, 0]]


def test_the_chart_draws_what_its_table_holds_and_refuses_an_empty_folder(tmp_path):
    with pytest.raises(SystemExit, match="measure first"):
        chart.main(["--draw", "--output", str(tmp_path)])
    rows = ["scene,program,seconds,rms,rms_low,rms_high", "box,ours,1,.02,.01,.03", "box,ours,3,.01,0,.02",
            "box,cycles,4,.09,.08,.1", "hall,mitsuba,5,.2,.1,.3"]
    (tmp_path / "accuracy.csv").write_text("\n".join(rows) + "\n")
    chart.main(["--draw", "--output", str(tmp_path)])
    assert (tmp_path / "accuracy.png").read_bytes().startswith(b"\x89PNG")


def test_requests_are_plain_json():
    # What is sent to the other environment: polygons as lists, the exact value, the occluders.
    case = form_factor_peers._plain(BY_NAME["P-14"])
    assert json.loads(json.dumps(case))["exact"] == BY_NAME["P-14"].exact
    assert np.shape(case["occluders"]) == (1, 4, 3)


def test_of_several_rounds_the_quickest_of_each_bake_counts():
    # Two rounds of two bakes by us and one by Cycles, numbered: of each program and knob the row with fewest seconds.
    def row(program, knob, seconds, rays):
        values = dict.fromkeys((field.name for field in dataclasses.fields(Row)), 0.0)
        return Row(**{**values, "program": program, "knob": knob, "seconds": seconds, "rays": rays})

    rows = [row("ours", "0.1", 3.0, 1), row("ours", "0.03", 5.0, 2), row("cycles", "16", 1.0, 3),
            row("ours", "0.1", 2.0, 4), row("ours", "0.03", 6.0, 5), row("cycles", "16", 1.5, 6)]
    assert [each.rays for each in quickest(rows)] == [4, 2, 3]
