"""Tables of numbers in files: CSV, Parquet and netCDF; pandas, xarray and pyarrow are loaded when they are needed."""
