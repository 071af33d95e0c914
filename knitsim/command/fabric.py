"""``knitsim fabric``: one fabric from a few options, at rest and pulled, bent or sheared."""

import sys
from pathlib import Path

from knitsim.errors import InputError

# Options by the keyword that each stands for, and what it is.
YARN = {
    "diameter_mm": "of the yarn", "friction": "between yarns", "bending_rigidity_N_mm2": "of the yarn",
    "fibres": "in the section", "density_g_per_cm3": "of the fibre",
}  # fmt: skip
FABRIC = {
    "wales_per_cm": "", "courses_per_cm": "", "loop_length_mm": "", "tightness_factor": "tex^0.5/cm",
    "mass_per_area_g_per_m2": "", "set": "0, a straight yarn, to 1",
}  # fmt: skip
DIRECTIONS = ("course", "wale")


def fabric_options(parser):
    """Options of ``knitsim fabric``."""
    parser.epilog = (
        "knitsim fabric --count 30/1 --wales-per-cm 14 --courses-per-cm 20 --loop-length-mm 2.9 "
        "--pull course=0.3 --bend wale.  Every other key of config/README.md is an option as well: "
        "--wales-per-inch 36, --pattern rib_1x1, or --yarn KEY=VALUE, --fabric KEY=VALUE.  What is not "
        "stated is assumed, and said so."
    )
    parser.add_argument("--count", metavar="30/1 or Ne=30", help="Ne, Nm, tex, dtex, den")
    for name, about in (*YARN.items(), *FABRIC.items()):
        parser.add_argument(_flag(name), metavar="VALUE", help=about or None, dest=name)
    parser.add_argument("--yarn", action="append", default=[], metavar="KEY=VALUE")
    parser.add_argument("--fabric", action="append", default=[], metavar="KEY=VALUE")
    parser.add_argument(
        "--pull", action="append", default=[], metavar="DIRECTION[=STRAIN]",
        help="course or wale; to 50 gf/cm without a strain, and back",
    )  # fmt: skip
    parser.add_argument("--bend", action="append", default=[], choices=DIRECTIONS)
    parser.add_argument("--shear", action="store_true")
    parser.add_argument("--no-friction", action="store_true", help="between the yarns")
    parser.add_argument("--accuracy", help="relative error asked for, 0.01 by default")
    parser.add_argument("--csv", metavar="FILE.csv", help="every state of the tests")
    parser.add_argument("--png", metavar="FILE.png", help="the curves of the tests, or the loops")


def _flag(name):
    return "--" + name.replace("_", "-")


def fabric(given, more):
    """Compute the fabric and print it; more: options that are keys of a yarn or a fabric."""
    import knitsim as ks
    from knitsim.study.trade import far_from_stated

    for file, ending in ((given.csv, ".csv"), (given.png, ".png")):
        if file and Path(file).suffix.lower() != ending:
            raise InputError(f"--{ending[1:]}", repr(file), f"must end in {ending}")
        if file and not Path(file).absolute().parent.is_dir():
            raise InputError(file, None, f"there is no directory {Path(file).parent}")
    of_yarn, of_fabric = _options(more)
    yarn = ks.Yarn(
        **_count(given.count) if given.count else {}, **_keys(given, YARN, [*given.yarn, *of_yarn])
    )
    made = ks.Fabric(yarn, **_keys(given, FABRIC, [*given.fabric, *of_fabric]))
    tests = [_pull(ks, one, not given.no_friction) for one in given.pull]
    tests += [ks.Bend(direction, friction=not given.no_friction) for direction in given.bend]
    tests += [ks.Shear(friction=not given.no_friction)] if given.shear else []
    print(yarn, made, sep="\n")
    rest = ks.relax(made, accuracy=given.accuracy and _value(given.accuracy))
    notes = far_from_stated(made, rest.wale_spacing, rest.course_spacing)
    print(rest, *(f"note: {one}" for one in notes), sep="\n", flush=True)
    results = []
    for test in tests:
        results.append(test.run(rest))
        print(results[-1])
        try:
            print(ks.kes(results[-1]), flush=True)
        except InputError as error:  # a curve too short to be read
            print(f"KES: not read: {error}")
    print("assumed: " + "; ".join(_assumed(made)))
    if given.csv:
        _write_csv(results or [rest], given.csv)
    if given.png:
        _draw(results or [rest], given.png)
    return 0


def _options(more):
    """(of the yarn, of the fabric): KEY=VALUE of options that are keys, such as --wales-per-inch 36."""
    from knitsim.study import schema, trade

    yarn, fabric = (
        {one.name.lower(): one.name for one in (*section.keys, *section.sections)}
        for section in (schema.YARN, schema.FABRIC)
    )
    found, words = ([], []), list(more)
    while words:
        option, sign, value = words.pop(0).partition("=")
        if not option.startswith("--") or not (sign or words):
            raise InputError(
                "knitsim fabric", repr(option), "must be --KEY VALUE; see knitsim fabric --help"
            )
        name = option[2:].replace("-", "_").lower()
        # What is called otherwise here is said by the check of the one that has it.
        meant = {name, *(one.lower() for one in trade.MEANT.get(name, ()))}
        of_yarn = bool(meant & set(yarn)) and not meant & set(fabric)
        key = (yarn if of_yarn else fabric).get(name, name)
        found[0 if of_yarn else 1].append(f"{key}={value if sign else words.pop(0)}")
    return found


def _count(text):
    """Keywords of a count: ``30/1`` and the like as they stand, ``Ne=30`` by its unit."""
    unit, _, value = text.rpartition("=")
    return {f"count_{unit}": _value(value)} if unit else {"count": text}


def _keys(given, names, more):
    found = {
        name: _value(getattr(given, name)) for name in names if getattr(given, name) is not None
    }
    for text in more:
        name, sign, value = text.partition("=")
        if not sign:
            raise InputError("knitsim fabric", text, "must be KEY=VALUE")
        found[name] = _value(value)
    return found


def _value(text):
    """A value as a file would hold it: numbers, true and false, lists and sections."""
    import yaml

    from knitsim.study.yaml_file import parsed

    try:
        return parsed(text, "knitsim fabric")
    except yaml.YAMLError:
        return text


def _pull(ks, text, friction):
    direction, _, strain = text.partition("=")
    if not strain:
        return ks.Pull(direction, to_force_gf_per_cm=50.0, friction=friction, recovery=friction)
    return ks.Pull(direction, to_strain=_value(strain), friction=friction, recovery=friction)


def _assumed(made):
    rows = [row for row in made.assumptions() if not row.path.startswith("scene")]
    # What no key changes stands in config/README.md.
    return [
        f"{row.key.replace('_', ' ')} {row.value:.4g}" if isinstance(row.value, float)
        else f"{row.key.replace('_', ' ')} {row.value}"
        for row in rows if row.path
    ]  # fmt: skip


def _write_csv(results, file):
    import pandas as pd

    from knitsim.files import replacing

    frames = []
    for result in results:
        frame = result.to_dataframe()
        about = result.to_dataset().variables
        units = {name: one.attrs.get("units") for name, one in about.items()}
        frame = frame.rename(columns={n: f"{n} ({units[n]})" for n in frame if units.get(n)})
        kind = getattr(result, "KIND", "rest")
        frame.insert(0, "test", f"{kind} {getattr(result, 'direction', '')}".strip())
        frames.append(frame)
    with replacing(file) as partial:
        pd.concat(frames).to_csv(partial, index=False, lineterminator="\n")
    print(f"states: {file}", file=sys.stderr)


def _draw(results, file):
    from knitsim.figures import style
    from knitsim.files import replacing

    with style.context():
        rows = -(-len(results) // 2)
        fig, axes = style.figure(height_mm=65.0 * rows, columns=min(2, len(results)), rows=rows)
        for result, ax in zip(results, axes.flat, strict=False):
            result.plot(ax)
        for ax in axes.flat[len(results) :]:
            ax.set_axis_off()
        with replacing(file) as partial:
            fig.savefig(partial, format=Path(file).suffix.removeprefix(".") or "png")
    print(f"picture: {file}", file=sys.stderr)
