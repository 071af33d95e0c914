def output_files():
    return []
