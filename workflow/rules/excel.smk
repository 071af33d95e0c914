# Every table once more, as Excel opens it where the comma is the decimal sign: snakemake excel.


rule excel:
    input:
        TABLES,
        rules.verification.output.table,
        rules.skipping.output.table,
    output:
        directory=directory(results("tables/excel")),
    log:
        log_of("excel"),
    params:
        source=source_hash("knitsim.store.table"),
    resources:
        mem_mb=1000,
        runtime=10,
    script:
        "../scripts/excel.py"
