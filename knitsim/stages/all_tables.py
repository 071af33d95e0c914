"""Every table that the workflow gathers from all result files."""

from knitsim.stages.calibration_tables import write_tables as write_measured
from knitsim.stages.curve_table import curve_table
from knitsim.stages.kes_table import curl_table, kes_table
from knitsim.stages.sensitivity import write_table as write_sensitivity
from knitsim.stages.summary import write_summary
from knitsim.stages.tables import assumption_table, correction_table, timing_table
from knitsim.store.results import RESULTS


def write_tables(study, files, tables):
    """Write the ``tables`` {name: path} of a Study.

    files: lists of paths by what they are: ``results`` of tests, ``kes``, ``measured``, ``timings``.
    """
    results, kes = files["results"], files["kes"]
    timing_table(files["timings"], tables["timing"])
    assumption_table(study, results, tables["assumptions"])
    correction_table(results, tables["corrections"])
    kes_table(kes, tables["kes"])
    curl_table(results, tables["curl"])
    curve_table(results, tables["load_extension"])
    if "calibration" in tables:
        write_measured(files["measured"], tables["calibration"], tables["prediction"])
    if "sensitivity" in tables:
        kind = RESULTS["sensitivity"].kind
        write_sensitivity([f for f in results if f.parent.name == kind], tables["sensitivity"])
    write_summary(study, [*results, *files["measured"]], kes, tables["summary"])
