"""Quantities and units: what a number of a lightmap means, and that its file says so."""

from __future__ import annotations

import numpy as np
import pytest
from radiosity.solver import Settings, SettingsError, Sky, bake, element_form_factor
from radiosity.solver.image_file import read_layers, write_exr
from radiosity.solver.lamps import Point
from radiosity.solver.quantities import LUMINANCE, LUMINOUS_EFFICACY, TABLE, UNITS, encode, header, photometric, watts
from radiosity.solver.settings import QUANTITIES
from radiosity.tests.solver.rooms import quad

WHITE = np.ones((1, 3), np.float32)
# An audit's figures, as far as a header takes them.
REPORT = {"error": {"wanted": 0.03, "estimated": {"rms": 0.0125, "rms_high": 0.02}}}


@pytest.mark.parametrize(("quantity", "exact"), [
    ("radiance", (2 / np.pi, 4 / np.pi, 6 / np.pi)), ("irradiance", (2, 4, 6)), ("radiosity", (1, 1, 0.6)),
    ("illuminance", [683 * (0.2126 * 2 + 0.7152 * 4 + 0.0722 * 6)] * 3)])
def test_irradiance_becomes_each_quantity(quantity, exact):
    # E = 2, 4, 6 W/m2 on rho = .5, .25, .1: E / pi; E; rho E; 683 lm/W times the luminance 3.7192 W/m2, 2540 lux.
    found = encode(np.float32([[2, 4, 6]]), quantity, np.float32([[0.5, 0.25, 0.1]]))
    assert found.shape == (1, 3)
    assert found.dtype == np.float32
    assert found[0] == pytest.approx(exact, rel=1e-6)


def test_every_quantity_has_a_unit():
    # The words of the settings, no more and no fewer.
    assert set(UNITS) == set(QUANTITIES)


def test_the_luminance_of_white_is_1():
    # Rec. 709's weights add up to 1, so 1 W of white light is 683 lm.
    assert LUMINANCE.sum() == pytest.approx(1, abs=1e-7)
    assert photometric(WHITE)[0] == pytest.approx(683, rel=1e-6)


def test_the_table_is_of_one_dimension_on_either_side():
    # W becomes lm and all else stays: lux = lm/m2, candela = lm/sr, nit = lm/(m2 sr).
    assert {pair.photometric_unit for pair in TABLE.values()} == {"lumen", "lux", "candela", "nit"}
    for pair in TABLE.values():
        assert pair.unit.replace("W", "lm") == pair.in_lumens


def test_a_lamp_of_so_many_lumens_gives_so_many_lux():
    # A point lamp of 1,000 lm, 2 m above a floor: 1000 / (16 pi) = 19.894 lux, whatever the efficacy, if watts and lux
    # are made with the same.
    for efficacy in (683.0, 177.83, 93.0):
        lamp = Point("bulb", (0, 0, 2), np.full(3, watts(1000, efficacy)))
        irradiance = lamp.irradiance(np.float32([[0, 0, 0]]), np.float32([[0, 0, 1]]))
        assert photometric(irradiance, efficacy)[0] == pytest.approx(1000 / (16 * np.pi), rel=1e-5)


def test_a_candela_is_a_nit_of_a_square_metre():
    # A plate of 1 m2 and L = 1 W/(m2 sr), 683 nit, is a lamp of 683 cd along its normal: 683 / 100^2 lux from 100 m.
    plate = np.array([[-0.5, -0.5, 100], [-0.5, 0.5, 100], [0.5, 0.5, 100], [0.5, -0.5, 100]])
    factor = element_form_factor((0, 0, 0), (0, 0, 1), plate).value
    assert photometric(np.pi * factor * WHITE)[0] == pytest.approx(683 / 100**2, rel=1e-4)


@pytest.mark.parametrize("efficacy", [0, -1, 684, np.nan])
def test_an_efficacy_that_no_light_has_is_refused(efficacy):
    # 683 lm/W at 555 nm is the most there is: one line that names word and value.
    with pytest.raises(SettingsError, match="luminous_efficacy"):
        photometric(WHITE, efficacy)


@pytest.mark.parametrize("quantity", QUANTITIES)
def test_a_baked_floor_under_an_even_sky_has_each_quantity_s_number(quantity):
    # An unoccluded floor of rho .25 under a sky of L = 2 W/(m2 sr): E = 2 pi, so 2 W/(m2 sr), 6.2832 W/m2,
    # 4291.4 lux, 1.5708 W/m2; and the image file says which, in which unit.
    scene = quad((0, 0, 0), (1, 0, 0), (0, 1, 0), reflectance=0.25).scene(sky=Sky(np.full(3, 2.0)))
    made = bake(scene, Settings(quantity=quantity, resolution=16, error=0.03))
    exact = {"radiance": 2, "irradiance": 2 * np.pi, "illuminance": 2 * np.pi * 683, "radiosity": np.pi / 2}[quantity]
    assert made.lightmaps[0].pixels[8, 8] == pytest.approx([exact] * 3, rel=0.003)
    assert header(Settings(quantity=quantity), made.report)["radiosity:unit"] == UNITS[quantity]


def test_a_file_says_quantity_unit_seed_and_error(tmp_path):
    # Illuminance, seed 2^32 - 1, error .03 wanted and .0125 found: all come back, the efficacy too; seeds have more
    # digits than the file's floats, so they are text.
    settings = Settings(quantity="illuminance", seed=2**32 - 1, passes="direct")
    write_exr(tmp_path / "a.exr", np.ones((2, 2, 3), np.float32), header(settings, REPORT))
    _, found = read_layers(tmp_path / "a.exr")
    assert {name: value for name, value in found.items() if isinstance(value, str)} == {
        "radiosity:quantity": "illuminance", "radiosity:unit": "lux", "radiosity:passes": "direct",
        "radiosity:seed": "4294967295"}
    numbers = {name: value for name, value in found.items() if not isinstance(value, str)}
    assert numbers == pytest.approx({"radiosity:wantedError": 0.03, "radiosity:error": 0.0125,
                                     "radiosity:errorHigh": 0.02, "radiosity:luminousEfficacy": LUMINOUS_EFFICACY})


def test_a_file_of_radiance_says_how_bright_its_white_is(tmp_path):
    # OpenEXR's whiteLuminance, cd/m2 of (1, 1, 1): 683 for W/(m2 sr); no other quantity is a luminance.
    for quantity in QUANTITIES:
        write_exr(tmp_path / "a.exr", np.ones((2, 2, 3), np.float32), header(Settings(quantity=quantity)))
        _, found = read_layers(tmp_path / "a.exr")
        assert found.get("whiteLuminance") == (683 if quantity == "radiance" else None)
        assert "radiosity:error" not in found


def test_pixels_are_stored_without_exposure(tmp_path):
    # 1e-6 to 1e6 W/m2: the same float32 come back, nothing clipped, nothing scaled.
    pixels = np.geomspace(1e-6, 1e6, 27, dtype=np.float32).reshape(3, 3, 3)
    write_exr(tmp_path / "a.exr", pixels, header(Settings(quantity="irradiance")))
    assert np.array_equal(read_layers(tmp_path / "a.exr")[0][""], pixels)
