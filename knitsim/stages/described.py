"""What the result of every stage says of itself."""

from knitsim.store.results import labels_of
from knitsim.store.writer import describe, to_json


def describe_stage(
    dataset, given, stage, *, title, summary, references, settings=None, config=None, **labels
):
    """``dataset`` with the global attributes of a result of ``stage`` (in place).

    given: the FabricInput or YarnInput that it was made from; references: keys of schema.REFERENCES;
    settings: how finely the equilibrium model was solved, as plain data; config: what of ``given`` the result
    depends on, if not as the stage has it; labels: direction or calibration.
    """
    config = given.config(stage) if config is None else config
    if settings is not None:
        dataset.attrs["settings"] = to_json(settings)
    yarn = getattr(given, "yarn", given)
    if yarn is not given:
        labels |= {"fabric": given.name, "pattern": given["pattern"]}
    return describe(
        dataset, stage, labels_of(stage, yarn=yarn.name, **labels), title=title, summary=summary,
        references=references, configuration=config, assumptions=config["assumed"],
    )  # fmt: skip
