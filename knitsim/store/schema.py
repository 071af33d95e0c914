"""The result schema: every name that may stand in a result file, with its unit and meaning.

This table is the contract with readers of the files.  A change of it is a change of
:data:`SCHEMA_VERSION` and stands in the changelog.
"""

from dataclasses import dataclass

SCHEMA_VERSION = "2.0"
CONVENTIONS = "CF-1.11, ACDD-1.3"

AXES = ("course", "wale", "thickness")
ENERGY_TERMS = ("stretch", "bend", "contact", "friction")
PHASES = ("loading", "recovery")


@dataclass(frozen=True)
class Name:
    """One variable or coordinate: CF unit, meaning, and the flag meanings if it is a flag."""

    units: str | None
    long_name: str
    flags: tuple[str, ...] = ()
    # Shapes only: positions may be rounded in the file, forces and energies never.
    shape: bool = False


COORDINATES = {
    "axis": Name(None, "fabric axis; thickness is positive to the technical face"),
    "term": Name(None, "energy term"),
    "variant": Name(None, "reading of the same test"),
    "step": Name("1", "number of the stored state, in the order of the test"),
    "loop": Name("1", "number of the loop in the repeating cell, along its courses in turn"),
    "loop_wale": Name("1", "wale of the loop in the repeating cell, from 0"),
    "loop_course": Name("1", "course of the loop in the repeating cell, from 0"),
    "point": Name("1", "number of the point along one loop"),
    "section": Name("1", "number of the cross-section along one loop"),
    "fibre": Name("1", "number of the fibre in its cross-section"),
    "anchor": Name("1", "number of the anchor point along one loop"),
    "crossing": Name("1", "number of the crossing along one loop, from the head"),
    "vertex": Name("1", "number of the vertex of the tension law"),
    "sample": Name("1", "number of the point of a measured curve"),
    "parameter": Name(None, "calibrated parameter"),
    "other_parameter": Name(None, "calibrated parameter that is correlated with the first"),
    "profile_point": Name("1", "number of the value at which the others were fitted again"),
    "curve": Name(None, "measured curve, as the configuration names it"),
    "curve_test": Name(None, "test that was measured: tension or bending"),
    "curve_direction": Name(None, "direction pulled, or that becomes curved, in the measured test"),
    "curve_role": Name(None, "whether the calibration was fitted to the curve, or predicts it"),
    "curve_residual": Name(None, "what is compared: the strain at given force or the like"),
    "state": Name("1", "number of the predicted state in tension"),
    "input": Name(None, "input of the model that is changed"),
    "result": Name(None, "result whose change is given"),
    "result_units": Name(None, "unit of the result"),
    "bent_state": Name("1", "number of the predicted state in bending"),
    "bound": Name(None, "end of an interval"),
    "parameter_units": Name(None, "unit of the calibrated parameter"),
    "parameter_note": Name(None, "why a calibrated parameter has no confidence interval"),
    "form": Name(None, "form of the tension law: continuous, or as printed"),
    "twist_form": Name(None, "twist as corrected (a rotation) or by eq (1) as printed"),
    "section_axis": Name(None, "axes of the yarn's cross-section"),
    "yarn_axis": Name(None, "axes of the straight yarn; z along it"),
    "alternative": Name(None, "another plausible value of an assumed input, as key=value"),
    "refused": Name(None, "why no result could be computed with this alternative"),
    "quantity": Name(None, "result whose change is given"),
    "quantity_units": Name(None, "unit of the quantity"),
    "set": Name("1", "part of the loop's curvature that the yarn has taken as its rest shape"),
    "compared": Name("1", "number of the loop length compared"),
    "spacing": Name(None, "wale or course spacing"),
    "order": Name(None, "which inclination of the printed eqs (2), (3) is turned first"),
    "strain": Name("1", "engineering strain along the pull, from the starting state"),
    "shear_angle": Name("rad", "angle by which the wale leans, courses sliding over each other"),
    "curvature": Name("m-1", "curvature, positive when the technical face is convex"),
    "phase": Name(None, "loading or recovery"),
    "cycle": Name("1", "number of the cycle, from 1"),
    "round": Name("1", "number of the cycle that a value is of, from 1"),
    "rest_state": Name(
        "1", "number of the state at rest: pulled along the course, as it is, along the wale"
    ),
    "segment": Name("1", "number of the turning point that the test goes towards, from 0"),
    "row": Name("1", "number of the row of a table"),
    "test": Name(None, "kind of test: tensile, bending or shear"),
    "model": Name(None, "kinematic or equilibrium"),
    "direction": Name(None, "direction pulled, or that becomes curved"),
    "kes_parameter": Name(None, "name of a KES parameter"),
    "value_units": Name(None, "SI unit of the value"),
    "kes_units": Name(None, "unit of the value as the KES instruments give it"),
    "definition": Name(None, "how the parameter is read, with its numbers"),
    "left_out": Name(None, "why the parameter cannot be had from this test"),
    "swept": Name(None, "what changes from fabric to fabric, the rest stays"),
    "comparison": Name(None, "verification case and quantity compared"),
    "case": Name(None, "verification case: a scene with an exact answer"),
    "case_group": Name(None, "kind of verification case"),
    "compared_quantity": Name(None, "quantity compared with the exact answer"),
    "elements": Name("1", "elements (spline spans) of each yarn"),
}

VARIABLES = {
    # yarn
    "law_strain": Name("1", "strain at the vertices of the yarn's tension law"),
    "law_tension": Name("N", "tension at the vertices of the yarn's tension law"),
    "breaking_strain": Name("1", "breaking strain of the yarn"),
    "law_is_plastic": Name(None, "whether post-yield strain stays", ("reversible", "plastic")),
    "linear_density": Name("kg m-1", "linear density of the yarn"),
    "diameter": Name("m", "yarn diameter"),
    "twist": Name("m-1", "turns per length, positive for Z"),
    "fibre_diameter": Name("m", "fibre diameter"),
    "fibre_position": Name("m", "fibre centres in the cross-section of the yarn", shape=True),
    "fibre_path": Name("m", "fibre centres over successive cross-sections", shape=True),
    "section_edge": Name("1", "numbers of the two fibres that a section spring joins"),
    "section_spacing": Name("m", "distance of successive cross-sections"),
    "curve_origin": Name(None, "where the yarn's curve comes from", ("measured", "rebuilt")),
    "curve_strain": Name("1", "strain of the yarn's given curve, slack removed"),
    "curve_tension": Name("N", "tension of the yarn's given curve"),
    "fitted_tension": Name("N", "tension of the calibrated law at the strains of the given curve"),
    "fitted_value": Name(None, "calibrated value; unit in parameter_units"),
    "fitted_interval": Name(None, "95 % confidence interval of the calibrated value"),
    "stated_value": Name(None, "the value that the configuration states, if it does"),
    "fit_rms": Name("1", "rms misfit of the calibration over the largest tension of the curve"),
    "fit_largest": Name("1", "largest misfit of the calibration over the curve's largest tension"),
    "fit_r_squared": Name("1", "coefficient of determination of the calibration"),
    "mean_radius_ratio": Name("1", "mean fibre radius over that of the starting state"),
    "friction_force": Name("N", "F = c v between the fibres, positive on loading"),
    "time": Name("s", "time from the start of the test at the set velocity"),
    "section_energy": Name("J m-1", "energy of the section springs per length of yarn"),
    "stretch_energy": Name("J m-1", "energy of the tension springs per length of yarn"),
    "bend_energy": Name("J m-1", "energy of the bending springs per length of yarn"),
    "plastic_dissipated": Name("J m-1", "plastic work per length of yarn, cumulative"),
    "friction_dissipated": Name("J m-1", "work of F = c v per length of yarn, cumulative"),
    "work_per_length": Name("J m-1", "work done per length of yarn, cumulative"),
    # loop
    "centreline": Name(
        "m", "centre lines; the last point of a loop is the first of the next one in its course",
        shape=True,
    ),
    "model_length": Name("m", "length L of the bent model along the bent direction"),
    "tangent": Name("1", "unit tangent of the centre line", shape=True),
    "normal": Name("1", "first unit normal of the rotation-minimising frame", shape=True),
    "binormal": Name("1", "second unit normal of the rotation-minimising frame", shape=True),
    "frame_closure_angle": Name(
        "rad", "angle by which the frame fails to close over a loop, spread along it"
    ),
    "turn_per_loop": Name("rad", "angle by which the twist turns the sections from loop to loop"),
    "thickness": Name("m", "thickness of the fabric: of its centre lines and one yarn diameter"),
    "cover": Name("1", "share of the area under yarn, overlaps counted twice"),
    "peirce_point": Name("m", "Peirce's own loop at these spacings", shape=True),
    "printed_section_axis": Name("1", "section axis by the printed eqs (2), (3)", shape=True),
    "section_angle_error_of_diagonal": Name("rad", "the same for the direction (1, 1, 1)"),
    "backward_share": Name("1", "share of the curve parameter that runs backwards course-wise"),
    "fibre_point": Name("m", "fibre points of one loop", shape=True),
    "anchor_point": Name("m", "anchor points of one loop", shape=True),
    "arc_length": Name("m", "length along the centre line from the sinker loop"),
    "curve_point": Name("m", "Choi and Lo's curve that gives the anchors", shape=True),
    "loop_height": Name("m", "extent of one loop along the wale"),
    "loop_length": Name("m", "length of yarn in one loop"),
    "choi_lo_parameter": Name("1", "parameter chi of Choi and Lo's curve"),
    "stitch_density": Name("m-2", "loops per area"),
    "tightness_factor": Name("tex0.5 cm-1", "tightness factor, sqrt(tex) over loop length in cm"),
    "areal_mass": Name("kg m-2", "mass per area"),
    "over": Name(None, "whether the loop crosses over or under, seen on the face", ("under", "over")),
    "neighbour": Name("1", "course that the loop crosses, relative to its own"),
    "section_angle_error": Name(
        "rad", "median angle between the section axis of the printed eqs (2), (3) and the tangent"
    ),
    "peirce_loop_length": Name("m", "loop length of Peirce's own loop, 2 c + w + 5.94 d"),
    # tension and bending
    "force_per_loop": Name("N", "derivative of one loop's energy by the spacing pulled"),
    "force_per_width": Name("N m-1", "force over the transverse spacing of the starting state"),
    "moment_per_width": Name("N", "derivative of the energy per area at rest by the curvature"),
    "yarn_tension": Name("N", "tension of the yarn, mean over the loop"),
    "yarn_strain": Name("1", "strain of the yarn, mean over the loop"),
    "transverse_strain": Name("1", "engineering strain across the pull, from the starting state"),
    "wale_spacing": Name("m", "distance of neighbouring wales"),
    "course_spacing": Name("m", "distance of neighbouring courses"),
    "energy": Name("J", "energy per loop"),
    "work": Name("J", "work done per loop, cumulative"),
    "dissipated": Name("J", "energy lost per loop, cumulative"),
    "cycle_peak_force_per_width": Name("N m-1", "largest force over the width of a cycle"),
    "cycle_residual_strain": Name("1", "strain left after a cycle where it ends without force"),
    "cycle_dissipated": Name("J", "energy lost per loop in a cycle, its hysteresis"),
    "cycles_to_close": Name("1", "cycle from which on the peak force stays within 1 %"),
    "growth": Name("1", "residual strain after the last cycle less that after the first"),
    "return_point_change": Name("1", "largest change of force where the test comes back to a strain"),
    "rest_line_spacing": Name("m", "spacings in which friction lets the fabric rest, from end to end"),
    "min_distance": Name("1", "smallest distance of yarn centre lines, in yarn diameters"),
    "crossings_intact": Name(
        None, "whether the loops are interlooped", ("lost", "intact", "not_reached")
    ),
    "stated_wale_spacing": Name("m", "distance of neighbouring wales as stated"),
    "stated_course_spacing": Name("m", "distance of neighbouring courses as stated"),
    "fitted_loop_length": Name("m", "loop length with which the relaxed density is the stated one"),
    "fitted_set": Name("1", "set with which the relaxed density is the stated one"),
    "fitted_misfit": Name("1", "relative difference left between relaxed and stated spacing"),
    "kc": Name("1", "Munden's constant, loop length over course spacing"),
    "kw": Name("1", "Munden's constant, loop length over wale spacing"),
    "spacing_error": Name("1", "estimated relative error of the relaxed spacings"),
    "compared_loop_length": Name("m", "loop lengths at which the relaxed fabric is compared"),
    "compared_spacing": Name("m", "relaxed spacings at these loop lengths"),
    "residual": Name("N", "largest residual force"),
    "iterations": Name("1", "iterations of the solver"),
    "increments": Name("1", "steps of the solver since the state before"),
    "status": Name(
        None, "state of the solution",
        ("valid", "beyond_breaking_strain", "not_defined", "not_converged", "crossings_lost"),
    ),
    "numerical_error": Name(
        "1", "estimated error of the force or moment over max(its size, 1 % of the largest)"
    ),
    "change_error": Name(
        "1", "estimated error of the moment's change from the flat fabric, over the largest change"
    ),
    "assumption_effect": Name(
        "1", "relative change of the quantity with the alternative value of the assumed input"
    ),
    # measured curves, calibration and prediction
    "start_value": Name(None, "value as given, from which the fit started; unit in parameter_units"),
    "parameter_bound": Name(None, "bounds of the fit; unit in parameter_units"),
    "correlation": Name("1", "correlation of two calibrated parameters"),
    "profile_value": Name(None, "value at which the others were fitted again; unit in parameter_units"),
    "profile_misfit": Name("1", "rms misfit with the parameter at profile_value"),
    "fit_misfit": Name("1", "rms misfit of the fitted curves, as the fit weighs it"),
    "fit_evaluations": Name("1", "fabrics solved by the fit"),
    "fit_failed": Name("1", "trials of the fit that had no equilibrium or did not reach the points"),
    "measured_strain": Name("1", "measured strain, from the state under pretension"),
    "measured_strain_low": Name("1", "lower end of the band of the measured strain"),
    "measured_strain_high": Name("1", "upper end of the band of the measured strain"),
    "shifted_strain": Name("1", "measured strain, from the pretension that predicted strain counts from"),
    "shifted_strain_low": Name("1", "lower end of the band of that strain"),
    "shifted_strain_high": Name("1", "upper end of the band of that strain"),
    "shifted_transverse_strain": Name("1", "measured strain across the pull, from that pretension"),
    "measured_force_per_width": Name("N m-1", "measured force over the starting width"),
    "measured_transverse_strain": Name("1", "measured strain across the pull"),
    "measured_phase": Name(None, "phase of the measured point", ("loading", "recovery")),
    "measured_curvature": Name("m-1", "measured curvature, positive with the technical face convex"),
    "measured_moment_per_width": Name("N", "measured moment, mean of both ways, from flat"),
    "pretension": Name("N m-1", "force per width at which the measured strain is zero"),
    "model_strain": Name("1", "strain of the model at the measured force, from the pretension"),
    "model_moment_per_width": Name("N", "moment of the model there, mean of both ways, from flat"),
    "model_moment_per_width_low": Name("N", "lower end of the band of that moment"),
    "model_moment_per_width_high": Name("N", "upper end of the band of that moment"),
    "misfit_rms": Name("1", "rms of (model - measured)/measured over the points of the curve"),
    "misfit_mean": Name("1", "mean of (model - measured)/measured over the points of the curve"),
    "misfit_largest": Name("1", "largest |model - measured|/measured over the points of the curve"),
    "share_in_band": Name("1", "share of the points at which the model lies in the measured band"),
    "predicted_force_per_width": Name("N m-1", "force per width at which strains are predicted"),
    "predicted_pretension": Name("N m-1", "force per width from which predicted strain counts"),
    "predicted_strain": Name("1", "predicted strain along the pull, from the pretension if any"),
    "predicted_strain_band": Name("1", "band of the predicted strain, see band_covers"),
    "predicted_transverse_strain": Name("1", "predicted strain across the pull"),
    "predicted_transverse_strain_band": Name("1", "band of the predicted strain across, see band_covers"),
    "predicted_curvature": Name("m-1", "curvature, positive with the technical face convex"),
    "predicted_moment_per_width": Name("N", "predicted moment of first bending, from the flat fabric"),
    "predicted_moment_per_width_band": Name("N", "band of the predicted moment, see band_covers"),
    "predicted_spacing": Name("m", "predicted spacing of the fabric at rest"),
    "predicted_spacing_band": Name("m", "band of the predicted spacing, see band_covers"),
    "input_value": Name(None, "value of the input; SI unit in parameter_units"),
    "result_value": Name(None, "value of the result; unit in result_units"),
    "per_cent_per_cent": Name("1", "change of the result in per cent for one per cent of the input"),
    "per_cent_noise": Name("1", "its change when the input is changed twice as far"),
    "stated_spacing": Name("m", "spacing of the fabric at rest as stated"),
    "headline": Name(None, "the quantity itself with the values taken; unit in quantity_units"),
    # KES and yarn to fabric
    "parameter_value": Name(None, "value of the parameter; unit in value_units"),
    "kes_value": Name(None, "value of the parameter; unit in kes_units"),
    "parameter_error": Name(None, "error of the value by reading between states; unit in value_units"),
    "yarn_rigidity": Name("N m2", "bending rigidity of the yarn"),
    "swept_loop_length": Name("m", "loop length of each fabric compared"),
    "swept_diameter": Name("m", "yarn diameter of each fabric compared"),
    "swept_set": Name("1", "set of each fabric compared"),
    "fabric_rigidity": Name("N m", "KES bending rigidity B per width, mean of both sides"),
    "curl_moment": Name("N", "moment per width that holds the fabric flat"),
    "affine_rigidity": Name(
        "N m", "rigidity per width of the loop's yarn as straight pieces, each bent with the fabric"
    ),
    # verification
    "computed_value": Name("1", "value computed by the equilibrium solver"),
    "exact_value": Name("1", "exact value, for the computed angle or tension where it depends on one"),
    "relative_error": Name("1", "|computed - exact| over |exact|, over 1 where the exact value is 0"),
    "observed_order": Name("1", "order of convergence fitted to the errors above error_floor"),
    "error_limit": Name("1", "largest relative error asked for with the most elements"),
    "error_floor": Name("1", "relative error that more elements leave, about"),
}  # fmt: skip

REFERENCES = {
    "paper": "3-Dimension Simulation for Loop Structure of Weft-Knitted Fabric Considering"
    " Mechanical Properties of Yarn",
    "bisshopp": "K. E. Bisshopp and D. C. Drucker, Quarterly of Applied Mathematics 3 (1945) 272",
    "choi_lo": "K. F. Choi and T. Y. Lo, Textile Research Journal 73 (2003) 739-748",
    "munden": "D. L. Munden, Journal of the Textile Institute 50 (1959) T448-T471",
    "peirce": "F. T. Peirce, Textile Research Journal 17 (1947) 123-147",
    "hearle": "J. W. S. Hearle, P. Grosberg, S. Backer, Structural Mechanics of Fibers, Yarns, and"
    " Fabrics, Wiley 1969",
    "kawabata": "S. Kawabata, The Standardization and Analysis of Hand Evaluation, 2nd ed., 1980",
    "love": "A. E. H. Love, A Treatise on the Mathematical Theory of Elasticity, 4th ed., 1927",
    "singal": "K. Singal et al., Nature Communications 15 (2024), doi 10.1038/s41467-024-46498-z",
    "romero": "V. Romero et al., ACM Transactions on Graphics 40(4) (2021)",
    "vogel": "H. Vogel, Mathematical Biosciences 44 (1979) 179-189",
    "wang": "W. Wang et al., ACM Transactions on Graphics 27 (2008) 2",
}
