"""What the result of every stage says of itself."""

from knitsim.store.writer import describe, to_json


def describe_stage(dataset, given, stage, *, title, summary, references):
    """``dataset`` with the global attributes of a result of ``stage`` (in place).

    given: the FabricInput or YarnInput that it was made from; references: keys of schema.REFERENCES.
    """
    config = given.config(stage)
    if given.settings is not None:
        dataset.attrs["settings"] = to_json(given.settings.as_dict())
    return describe(
        dataset, title=title, summary=summary, references=references, configuration=config,
        assumptions=config["assumed"], modules=[f"knitsim.stages.{stage}"],
    )  # fmt: skip
