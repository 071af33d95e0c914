# Every table once more, as Excel opens it where the comma is the decimal sign: snakemake excel.


rule excel:
    input:
        [
            file
            for file in [*output_files(), *MEASURED_OUTPUT]
            if file.endswith(".csv") and "/tables/" in file
        ],
    output:
        directory=directory(results("tables/excel")),
    log:
        log_of("excel"),
    params:
        source=source_hash("knitsim.store.table"),
    script:
        "../scripts/excel.py"
