# Tables, figures and ParaView files: all read result files only.


rule tables:
    input:
        results=[*yarn_files(), *fabric_files()],
        timings=[
            timings_of(name)
            for name in [
                *(f"compile_{part}" for part in ("yarn", "fabric", "figures")),
                *(f"yarn_{yarn}" for yarn in STUDY.yarns),
                *(f"loop_{fabric}" for fabric in STUDY.fabrics),
                *(
                    f"{test}_{fabric}_{direction}"
                    for test in FABRIC_TESTS
                    for fabric in fabrics_with(test)
                    for direction in directions(fabric, test)
                ),
            ]
        ],
    output:
        timing=results("tables/timing.csv"),
        assumptions=results("tables/assumptions.csv"),
        corrections=results("tables/corrections.csv"),
    log:
        log_of("tables"),
    params:
        assumptions=json.dumps([row.as_dict() for row in STUDY.assumptions()]),
        source=source_hash("knitsim.stages.tables"),
    script:
        "../scripts/tables.py"


def tests_of(wildcards):
    fabric = wildcards.fabric
    return [
        path
        for test in FABRIC_TESTS
        if fabric in fabrics_with(test)
        for path in expand(
            getattr(rules, test).output.result, fabric=fabric, direction=directions(fabric, test)
        )
    ]


rule vtk:
    input:
        results=tests_of,
    output:
        directory=directory(results("vtk/{fabric}")),
    log:
        log_of("vtk_{fabric}"),
    params:
        source=source_hash("knitsim.stages.vtk_states"),
    script:
        "../scripts/vtk.py"


def output_files():
    return [*rules.tables.output, *expand(rules.vtk.output.directory, fabric=STUDY.fabrics)]
