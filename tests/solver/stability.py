"""The stability cases: what each breaks, which tests hold it, and the page that they and what they measured make.

A test that shows a classical method failing calls `stability`, which keeps the row; the rows of a run go to
out/stability.md, and `python tools/validation.py` keeps docs/stability.md up to it.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

FOLDER = Path(__file__).resolve().parent
PAGE = FOLDER.parents[1] / "out" / "stability.md"
# A method fails where it is this many times further off than ours, at least.
WORSE = 10.0
# Digits below this are those of the exact answers themselves.
ROUNDING = 1e-12

HEADER = """# Where methods break, and ours

Twenty-two ways to break a radiosity solver, each with the tests (in `tests/solver/`) that hold ours to its answer.
Written by the tests (`tests/solver/stability.py`).

| case | what breaks | tests |
|---|---|---|
"""
MEASURED = """
## Classical methods on the same cases

Each from `benchmarks/`, or written out in the test itself; measured by the test named, beside ours. Errors are relative
to the exact answer unless the row says otherwise; `inf` is no number at all. Ours is
`< 1e-12` where no more of the exact answer's digits are known, or where nothing was found.

| case | method and case | its error | ours | test |
|---|---|---|---|---|
"""


class Case(NamedTuple):
    breaks: str
    tests: tuple[str, ...]


CASES = {
    "S-1": Case("gaps of .01 to .0001 of the side", ("test_form_factor_stability.py::test_gap_closes_without_a_jump",)),
    "S-2": Case("polygons that share an edge at 1 to 179 degrees",
                ("test_form_factor_stability.py::test_shared_edge_at_any_angle",)),
    "S-3": Case("distances of 10 to 100,000 sides", ("test_form_factor_stability.py::test_distance_costs_no_digits",
                                                     "test_polygon.py::test_distance_costs_no_digits")),
    "S-4": Case("polygons through the receiver's horizon", (
        "test_polygon.py::test_polygon_through_the_horizon_is_clipped",
        "test_form_factor_stability.py::test_polygon_that_crosses_the_others_plane_counts_with_its_front_part_alone",
        "test_form_factor_stability.py::test_planes_that_cut_both_polygons_clip_both")),
    "S-5": Case("scenes of 4 mm and 4 km, or 10,000 sizes from the origin", (
        "test_form_factor_stability.py::test_scale_and_place_of_a_scene_do_not_matter",
        "test_radiosity_stability.py::test_a_room_of_any_size_and_place_gets_the_same_light",
        "test_stability_plates.py::test_plates_of_any_size_and_place_get_the_exact_light")),
    "S-6": Case("needles of 1 : 10,000", (
        "test_form_factor_stability.py::test_needles_keep_their_digits",
        "test_stability_scenes.py::test_walls_of_needles_reflect_as_whole_ones",
        "test_stability_plates.py::test_plates_made_of_bad_faces_get_the_exact_light")),
    "S-7": Case("a thin occluder on or off the line between centres", (
        "test_form_factor_stability.py::test_thin_occluder_on_or_off_the_line_of_centres_blocks_the_same",)),
    "S-8": Case("an occluder over a thousandth of the light", (
        "test_form_factor_stability.py::test_occluder_over_a_thousandth_of_the_light_is_not_lost",
        "test_many_lights.py::test_an_occluder_of_a_thousandth_of_the_light_is_found")),
    "S-9": Case("a pin-hole that few rays find", (
        "test_form_factor_stability.py::test_pin_hole_is_found_or_the_error_bar_says_so",
        "test_stability_scenes.py::test_a_pin_hole_that_a_bake_misses_is_in_its_error_bar")),
    "S-10": Case("rooms that absorb a thousandth, or nothing", (
        "test_radiosity_stability.py::test_a_closed_room_that_absorbs_next_to_nothing_is_solved",
        "test_radiosity_stability.py::test_a_closed_room_that_absorbs_nothing_is_refused_by_its_materials_name",
        "test_radiosity_stability.py::test_an_open_room_that_absorbs_nothing_is_solved")),
    "S-11": Case("two rooms joined by a door, or a pin-hole", (
        "test_radiosity_stability.py::test_a_dark_room_is_lit_through_its_door_as_path_tracing_says",
        "test_stability_classical.py::test_only_krylov_finds_two_rooms_by_itself")),
    "S-12": Case("a lamp that touches a wall, or lies in a receiver's plane", (
        "test_polygon.py::test_wall_that_a_lamp_touches_is_lit_up_to_the_edge",
        "test_polygon.py::test_lumel_coplanar_with_a_lamp_beside_it_gets_nothing",
        "test_stability_scenes.py::test_a_wall_that_a_lamp_touches_is_lit_up_to_the_edge_in_a_scene")),
    "S-13": Case("faces turned over or doubled, T-junctions, lumels inside a block", (
        "test_stability_scenes.py::test_a_room_of_turned_over_faces_gets_the_same_light",
        "test_stability_plates.py::test_plates_made_of_bad_faces_get_the_exact_light",
        "test_stability_scenes.py::test_walls_with_t_junctions_let_no_light_in",
        "test_leaks.py::test_a_second_copy_of_a_floor_changes_nothing",
        "test_leaks.py::test_lumels_under_a_box_are_black_and_do_not_darken_those_beside_it")),
    "S-14": Case("light of 1e-6 and 1e+6 W/m2; negative, infinite or no number", (
        "test_radiosity_stability.py::test_light_of_any_strength_scales",
        "test_stability_plates.py::test_plates_of_any_strength_get_the_exact_light",
        "test_radiosity_stability.py::test_light_that_cannot_be_is_refused")),
    "S-15": Case("the same points at every receiver: bands", (
        "test_stability_scenes.py::test_errors_of_neighbours_make_no_bands",)),
    "S-16": Case("a tolerance below the noise", (
        "test_stability_scenes.py::test_patches_are_not_split_for_their_noise",
        "test_stability_scenes.py::test_a_tolerance_below_the_noise_does_not_explode")),
    "S-17": Case("a symmetric scene", ("test_radiosity_stability.py::test_a_symmetric_room_gets_symmetric_light",)),
    "S-18": Case("the light of two lamps is the sum of each",
                 ("test_radiosity_stability.py::test_the_light_of_two_lamps_is_the_sum_of_each",)),
    "S-19": Case("a scene turned by 37 degrees about a skew axis", (
        "test_form_factor_stability.py::test_rotation_does_not_matter",
        "test_radiosity_stability.py::test_a_turned_room_gets_the_same_light",
        "test_stability_plates.py::test_turned_plates_get_the_exact_light")),
    "S-20": Case("coplanar faces that fight for every ray", (
        "test_radiosity_stability.py::test_a_floor_twice_over_is_lit_and_reflects_as_one",
        "test_stability_plates.py::test_plates_made_of_bad_faces_get_the_exact_light")),
    "S-21": Case("error bars that hold the truth", (
        "test_coverage.py::test_the_error_bar_holds_the_exact_error_in_45_of_50_bakes",
        "test_audit.py::test_the_interval_holds_the_true_error_in_nine_of_ten_bakes",
        "test_audit.py::test_the_error_is_freed_of_the_audits_noise",
        "test_form_factor.py::test_standard_error_is_honest_over_thirty_seeds")),
    "S-22": Case("one-sided lamps among two-sided faces", (
        "test_radiosity_stability.py::test_energy_is_kept_where_one_sided_lamps_meet_two_sided_meshes",)),
}


class Failure(NamedTuple):
    case: str
    method: str
    wrong: float
    ours: float
    test: str

    def line(self) -> str:
        ours = f"{self.ours:.0e}" if self.ours > ROUNDING else f"< {ROUNDING:.0e}"
        return f"| {self.case} | {self.method} | {self.wrong:.2g} | {ours} | `{self.test}` |\n"


class Failures:
    """What classical methods were measured to do, in this run."""

    def __init__(self) -> None:
        self.rows: list[Failure] = []

    def add(self, test: str, case: str, method: str, wrong: float, ours: float) -> None:
        """Keep a row; the method must be off by WORSE times as much as ours."""
        assert case in CASES
        assert abs(wrong) >= WORSE * max(abs(ours), ROUNDING), f"{case}, {method}: off by {wrong!r}, ours by {ours!r}"
        self.rows.append(Failure(case, method, float(wrong), abs(float(ours)), test))

    def write(self) -> None:
        """The whole page."""
        def lines(tests: tuple[str, ...]) -> str:
            return "<br>".join(f"`{test}`" for test in tests)

        text = HEADER + "".join(f"| {name} | {case.breaks} | {lines(case.tests)} |\n" for name, case in CASES.items())
        order = list(CASES)
        rows = sorted(self.rows, key=lambda row: order.index(row.case))
        PAGE.parent.mkdir(exist_ok=True)
        PAGE.write_text(text + MEASURED + "".join(row.line() for row in rows), encoding="utf-8")
