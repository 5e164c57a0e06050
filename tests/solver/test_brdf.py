"""BRDFs: reciprocal, without gain of energy, read from files, and a diffuse surface that stands for each."""

from __future__ import annotations

import numpy as np
import pytest
from radiosity.benchmarks.brdf.synthetic import SURFACES, bin_directions, write_merl
from radiosity.benchmarks.brdf.unnormalised import UnnormalisedPhong
from radiosity.solver import SceneError, Settings, brdf_integrals, solve
from radiosity.solver.brdf import Blinn, Lambert, Phong, mirrored
from radiosity.solver.brdf_integrals import (
    diffuse_equivalent,
    directional_reflectance,
    hemispherical_reflectance,
    reciprocity_gap,
    residual,
)
from radiosity.solver.merl import SCALE, SHAPE, bins, half_difference, read_merl
from radiosity.tests.solver.rooms import box, quad

EXPONENTS = (0, 0.3, 1, 2.5, 10, 100, 1000, 10000)
# Cosines from straight up to 89.4 degrees.
COSINES = np.linspace(0.01, 1, 40)
UP = np.array([0.0, 0.0, 1.0])


@pytest.fixture(scope="module")
def plastic(tmp_path_factory):
    """The surface by its formula, and as read from a file of its values in MERL's format."""
    path = tmp_path_factory.mktemp("merl") / "plastic.binary"
    write_merl(path, SURFACES[0])
    return SURFACES[0], read_merl(path)


def some_directions(count, seed):
    """(count, 3) evenly over the hemisphere."""
    random = np.random.default_rng(seed)
    z, phi = random.random(count), 2 * np.pi * random.random(count)
    return np.stack([np.sqrt(1 - z**2) * np.cos(phi), np.sqrt(1 - z**2) * np.sin(phi), z], axis=1)


def by_brute_force(brdf, cosine, side=400):
    """The directional reflectance by Gauss nodes over cos_i and evenly around: no half vector."""
    x, w = np.polynomial.legendre.leggauss(side)
    z, phi = ((x + 1) / 2)[:, None], 2 * np.pi * (np.arange(side) + 0.5)[None] / side
    r = np.sqrt(1 - z**2)
    incoming = np.stack([r * np.cos(phi), r * np.sin(phi), np.broadcast_to(z, (side, side))], axis=-1)
    outgoing = np.array([np.sqrt(1 - cosine**2), 0, cosine])
    weight = (w / 2)[:, None] * z * 2 * np.pi / side
    return (brdf(incoming, outgoing) * weight[..., None]).sum(axis=(0, 1))


# --- the three models ---


def test_lambert_reflects_rho_of_any_light():
    # f = rho / pi, its integral over the projected hemisphere is rho from every direction; rho .2, .5, .9.
    brdf = Lambert((0.2, 0.5, 0.9))
    assert np.allclose(directional_reflectance(brdf, COSINES), [0.2, 0.5, 0.9], rtol=1e-12)
    assert np.allclose(hemispherical_reflectance(brdf), [0.2, 0.5, 0.9], rtol=1e-12)
    assert np.allclose(residual(brdf), 0, atol=1e-12)


@pytest.mark.parametrize("model", [Phong, Blinn])
@pytest.mark.parametrize("exponent", EXPONENTS)
def test_a_lobe_reflects_all_light_along_the_normal_and_no_more_of_any_other(model, exponent):
    # k_s 1, k_d 0: the normalisation makes rho(normal) = 1 exactly; for slanted light the cosine takes its part.
    found = directional_reflectance(model(0, 1, exponent), np.append(COSINES, 1.0))[:, 0]
    assert found[-1] == pytest.approx(1, abs=1e-7)
    assert found.max() <= 1 + 1e-7


@pytest.mark.parametrize("brdf", [Lambert(0.5), *(model(0.3, 0.7, n) for model in (Phong, Blinn) for n in EXPONENTS)])
def test_models_are_reciprocal(brdf):
    # f(i, o) = f(o, i): Helmholtz. 4,096 random pairs, to rounding.
    assert reciprocity_gap(brdf) < 1e-12


@pytest.mark.parametrize("model", [Phong, Blinn])
def test_a_lobe_without_exponent_is_lambert(model):
    # n = 0: the lobe is constant; both factors are 1 / pi then.
    first, second = some_directions(50, 1), some_directions(50, 2)
    assert np.allclose(model(0.25, 0.5, 0)(first, second), 0.75 / np.pi, rtol=1e-12)


@pytest.mark.parametrize(("model", "limit", "rate"), [(Phong, 2 / 3, 1.5), (Blinn, 1 / 2, 1)])
def test_an_endless_exponent_reflects_a_known_part_of_even_light(model, limit, rate):
    # n -> infinity: rho(o) -> cos_o (Phong) and cos_o^2 (Blinn), so rho_hh -> 2 / 3 and 1 / 2. Phong's lobe, n^-1/2
    # wide, differs where cos_o is below that, by that much: the third power. Blinn's factor differs as 1 / n.
    gaps = [hemispherical_reflectance(model(0, 1, n))[0] - limit for n in (100, 1000, 10000)]
    assert np.log10(gaps[0] / gaps[1]) == pytest.approx(rate, abs=0.05)
    assert abs(gaps[2]) < 2e-4


@pytest.mark.parametrize("brdf", [Phong(0.2, 0.6, 10), Blinn(0.2, 0.6, 10), Phong(0.2, 0.6, 40), SURFACES[1]])
def test_the_quadrature_agrees_with_brute_force(brdf):
    # The same integral over 400 x 400 directions without the half vector, at 0, 37, 60 and 80 degrees.
    for cosine in np.cos(np.radians([0, 37, 60, 80])):
        assert np.allclose(directional_reflectance(brdf, [cosine])[0], by_brute_force(brdf, cosine), rtol=2e-5)


@pytest.mark.parametrize("brdf", [Phong(0, 1, 30), Phong(0, 1, 1e6), Blinn(0, 1, 1e6)])
def test_more_nodes_change_nothing(brdf, monkeypatch):
    # 1.5 times the nodes each way: the reflectance stays to five digits, up to the sharpest lobe allowed.
    few = hemispherical_reflectance(brdf)[0]
    for name, count in (("POLAR_NODES", 96), ("AZIMUTHS", 144), ("COSINES", 48)):
        monkeypatch.setattr(brdf_integrals, name, count)
    assert few == pytest.approx(hemispherical_reflectance(brdf)[0], rel=1e-5)


def test_even_light_is_reflected_as_random_rays_say():
    # Light from everywhere by cosine-weighted i, o even over the hemisphere: mean of f pi 2 pi cos_o is pi rho_hh.
    brdf = Phong((0.1, 0.3, 0.5), 0.4, 15)
    flat = some_directions(400_000, 5)
    incoming = np.stack([flat[:, 0], flat[:, 1], np.zeros(len(flat))], axis=1)
    spread = np.sqrt(np.random.default_rng(6).random(len(flat))) / np.linalg.norm(incoming, axis=1)
    incoming *= spread[:, None]
    incoming[:, 2] = np.sqrt(1 - (incoming**2).sum(axis=1))
    outgoing = some_directions(400_000, 7)
    sample = brdf(incoming, outgoing) * outgoing[:, 2:] * 2 * np.pi
    error = sample.std(axis=0) / np.sqrt(len(sample))
    assert (np.abs(sample.mean(axis=0) - hemispherical_reflectance(brdf)) < 4 * error).all()


# --- the formula of the lectures ---


def test_the_unnormalised_phong_breaks_reciprocity():
    # f = k_s (r.o)^n / cos_i: with i at 60 degrees and o straight up, 1 / cos_i is 2 one way and 1 the other.
    brdf = UnnormalisedPhong(0, 0.5, 2)
    slanted = np.array([np.sin(np.pi / 3), 0, 0.5])
    assert brdf(slanted, UP)[0] == pytest.approx(2 * brdf(UP, slanted)[0])
    assert reciprocity_gap(brdf) > 0.5


def test_the_unnormalised_phong_reflects_more_than_all_light():
    # Of light along the normal it reflects 2 pi / (n + 2) k_s + pi k_d: 2.1 times all of it at k_s 1, n 1, and pi times
    # at k_d 1. Of light at 89.5 degrees k_s .5, n 10 reflect 3.8 times all; the normalised lobe less than .5 of it.
    # (Without reciprocity it matters which direction is integrated over: here the outgoing one.)
    def of_light_from(brdf, cosine):
        return directional_reflectance(lambda i, o: brdf(o, i), [cosine])[0, 0]

    assert of_light_from(UnnormalisedPhong(0, 1, 1), 1.0) == pytest.approx(2 * np.pi / 3, rel=1e-6)
    assert of_light_from(UnnormalisedPhong(1, 0, 1), 1.0) == pytest.approx(np.pi, rel=1e-6)
    grazing = np.cos(np.radians(89.5))
    assert of_light_from(UnnormalisedPhong(0, 0.5, 10), grazing) > 3
    assert of_light_from(Phong(0, 0.5, 10), grazing) < 0.5


def test_a_gain_of_energy_is_refused():
    # k_d 1 without its 1 / pi reflects pi times all light; the message names the BRDF and the value.
    with pytest.raises(SceneError, match=r"UnnormalisedPhong reflects 3\.14"):
        diffuse_equivalent(UnnormalisedPhong(1, 0, 1))


@pytest.mark.parametrize("make", [
    lambda: Lambert(1.1), lambda: Lambert((0.1, 0.2)), lambda: Lambert(np.nan), lambda: Phong(0.6, 0.5, 10),
    lambda: Blinn((0.1, 0.1, 0.9), 0.2, 10), lambda: Phong(0.1, 0.1, -1), lambda: Blinn(0.1, 0.1, np.nan)])
def test_values_out_of_range_are_refused(make):
    # Reflectance above 1, two channels, nan, k_d + k_s above 1, a negative exponent: one line that says so.
    with pytest.raises(SceneError) as caught:
        make()
    assert "\n" not in str(caught.value)


# --- measured data ---


def test_the_angles_are_rusinkiewicz_s():
    # i and o 40 degrees to each side of a half vector that stands at 25 degrees, in its plane: theta_d 40, phi_d 0.
    def at(degrees):
        return np.array([np.sin(np.radians(degrees)), 0, np.cos(np.radians(degrees))])

    found = np.degrees(half_difference(at(65), at(-15)))
    assert np.allclose(found, [25, 40, 0], atol=1e-10)
    # Straight above each other about the normal: theta_h 0; apart by 60 degrees across its plane: phi_d 90.
    up_and_across = np.array([0, 0.5, np.sqrt(0.75)])
    assert np.allclose(np.degrees(half_difference(up_and_across, mirrored(up_and_across))), [0, 30, 90], atol=1e-6)
    tilted = np.array([[0.8, 0, 0.6], [0, 0, 0]])[0] * np.cos(0.3)
    across = np.array([0, np.sin(0.3), 0])
    assert np.allclose(half_difference(tilted + across, tilted - across), [np.arccos(0.6), 0.3, np.pi / 2])


def test_exchanged_directions_have_the_same_angles():
    # 1,000 pairs: theta_h and theta_d are alike, phi_d differs by pi, which is folded.
    first, second = some_directions(1000, 3), some_directions(1000, 4)
    there, back = half_difference(first, second), half_difference(second, first)
    assert np.allclose(there[:2], back[:2])
    assert np.allclose(np.sin(there[2] - back[2]), 0, atol=1e-9)


def test_the_middle_of_every_bin_is_looked_up_in_that_bin():
    # 90 x 90 x 180 bins; every 7th: angles of its middle, directions, angles again, indices.
    i, o = (each[::7, ::7, ::7] for each in bin_directions())
    wanted = np.stack(np.meshgrid(*(np.arange(0, n, 7) for n in SHAPE), indexing="ij"))
    assert (np.stack(bins(*half_difference(i, o))) == wanted).all()


def test_a_number_of_the_file_is_found_where_the_format_has_it(tmp_path):
    # All zero but bin (theta_h 10, theta_d 20, phi_d 30): number 30 + 180 (20 + 90 10) of a plane; 1500 in red is 1.
    planes = np.zeros((3, 90 * 90 * 180))
    planes[:, 30 + 180 * (20 + 90 * 10)] = 1500, 3000, 4500
    (tmp_path / "one.binary").write_bytes(np.array([90, 90, 180], np.int32).tobytes() + planes.tobytes())
    measured = read_merl(tmp_path / "one.binary")
    i, o = (each[10, 20, 30] for each in bin_directions())
    assert np.allclose(measured(i, o), [1, 2 * 1.15, 3 * 1.66])
    i, o = (each[11, 20, 30] for each in bin_directions())
    assert (measured(i, o) == 0).all()


def test_a_surface_comes_back_from_its_file(plastic):
    # At bins' middles the same to float32; the reflectances to .2 %, by angle to .5 %. About a quarter of the bins
    # has a direction below the surface, so nothing was measured there.
    formula, measured = plastic
    i, o = (each[::11, ::13, ::17] for each in bin_directions())
    assert np.allclose(measured(i, o), formula(i, o), rtol=1e-6)
    assert 0.7 < measured.measured < 0.8
    assert np.allclose(hemispherical_reflectance(measured), hemispherical_reflectance(formula), rtol=2e-3)
    angles = np.cos(np.radians([0, 30, 60, 80]))
    assert np.allclose(directional_reflectance(measured, angles), directional_reflectance(formula, angles), rtol=5e-3)


def test_measured_data_is_reciprocal_and_gains_nothing(plastic):
    # The table holds half of phi_d, so exchanged directions share a bin; reflectance from 0 to 89.4 degrees below 1.
    _, measured = plastic
    assert reciprocity_gap(measured) < 1e-12
    assert directional_reflectance(measured, COSINES).max() < 1
    assert (measured(some_directions(9, 1), -some_directions(9, 2)) == 0).all()


@pytest.mark.parametrize(("content", "says"), [
    (None, "can't be read"), (b"", "is no MERL table"), (b"text, and no table at all", "is no MERL table"),
    (np.array([90, 90, 360], np.int32).tobytes(), "(90, 90, 360)"),
    (np.array(SHAPE, np.int32).tobytes() + bytes(80), "92 bytes, not 34992012")])
def test_a_file_that_is_no_table_is_one_line(tmp_path, content, says):
    # Not there, empty, text, an anisotropic table, cut short: SceneError that names the file.
    path = tmp_path / "bad.binary"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(SceneError) as caught:
        read_merl(path)
    assert str(path) in str(caught.value)
    assert says in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_table_with_a_value_that_is_not_finite_is_refused(tmp_path):
    # One nan among zeros.
    planes = np.zeros((3, *SHAPE))
    planes[1, 2, 3, 4] = np.nan
    (tmp_path / "nan.binary").write_bytes(np.array(SHAPE, np.int32).tobytes() + planes.tobytes())
    with pytest.raises(SceneError, match="not finite"):
        read_merl(tmp_path / "nan.binary")


def test_the_scales_of_the_channels_are_merl_s():
    # Red 1, green 1.15, blue 1.66, all over 1500.
    assert np.allclose(SCALE * 1500, [1, 1.15, 1.66], rtol=1e-15)


# --- into the radiosity solver ---


def test_the_residual_grows_from_lambert_to_mirror():
    # Half of |f - rho / pi| over all that is reflected: 0 at n = 0, towards 1 with n; half of it for a mixture.
    found = [residual(Phong(0, 0.8, n))[0] for n in EXPONENTS]
    assert found[0] == pytest.approx(0, abs=1e-12)
    assert (np.diff(found) > 0).all()
    assert found[-1] > 0.99
    even = Phong(0.4, 0.4 / hemispherical_reflectance(Phong(0, 1, 1e4))[0], 1e4)
    assert residual(even)[0] == pytest.approx(0.5, abs=0.01)


def test_a_furnace_of_glossy_walls_glows_as_its_diffuse_equivalent_says():
    # A closed box, all walls E 1 and rho_hh of a coloured Blinn surface: H = 1 / (1 - rho_hh), B = E + rho H.
    rho = diffuse_equivalent(Blinn((0.1, 0.3, 0.5), 0.4, 30))
    room = box((0, 0, 0), (1, 1, 1)).scene(reflectance=rho, emission=1.0)
    solution = solve(room, Settings(error=0.03))
    assert np.allclose(solution.irradiance, 1 / (1 - rho), rtol=0.002)
    assert np.allclose(solution.radiosity, 1 / (1 - rho), rtol=0.002)


def test_two_glossy_plates_exchange_what_diffuse_ones_do():
    # P-34 (unit squares, gap 1, open, E 1 and 0): its rho .8 here is that of a Phong surface, .5 diffuse and the rest
    # gloss: mean B 1.026587975413 and .164167849583.
    gloss = hemispherical_reflectance(Phong(0, 1, 20))[0]
    rho = diffuse_equivalent(Phong(0.5, 0.3 / gloss, 20))
    assert np.allclose(rho, 0.8, rtol=1e-6)
    plates = (quad((0, 0, 0), (1, 0, 0), (0, 1, 0), emission=1.0) + quad((0, 0, 1), (0, 1, 0), (1, 0, 0)))
    solution = solve(plates.scene(reflectance=rho), Settings(error=0.03))
    assert solution.radiosity[:2].mean() == pytest.approx(1.026587975413, rel=0.01)
    assert solution.radiosity[2:].mean() == pytest.approx(0.164167849583, rel=0.01)


def test_the_equivalent_of_a_file_is_a_reflectance_of_a_scene(plastic):
    # A measured surface's (3,) float32 goes into Scene.reflectance as it is: red plastic reflects most red.
    _, measured = plastic
    rho = diffuse_equivalent(measured)
    assert rho.shape == (3,)
    assert rho.dtype == np.float32
    assert rho[0] > rho[1] > rho[2]
    scene = box((0, 0, 0), (1, 1, 1)).scene(reflectance=rho)
    assert np.allclose(scene.reflectance, rho)
