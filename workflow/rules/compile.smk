# Compilation of the kernels, told apart from the run times of the tests.


# Kernels are compiled once, before jobs side by side would all compile them: by priority, the longest
# first, filling all cores.  Not as an ancient input of the other rules: below a job that is run again
# Snakemake looks for no other reason to run one (its issue 4166), so a changed kernel would leave the
# results as they were.
for number, part in enumerate(PARTS):

    rule:
        name:
            f"compile_{part}"
        output:
            timings=timings_of(f"compile_{part}"),
        log:
            log_of(f"compile_{part}"),
        params:
            part=part,
            kernels=kernel_hash(),
            small=(Path(workflow.basedir) / "config/small").as_posix(),
        priority: 100 - number
        resources:
            mem_mb=2000,
            runtime=10,
        script:
            "../scripts/compile.py"


# Before jobs on a cluster: snakemake -c4 compile, where they find the same cache.
rule compile:
    input:
        [timings_of(f"compile_{part}") for part in PARTS],


localrules:
    compile,
