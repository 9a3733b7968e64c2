"""Container files of others' making, read in one way by recordings and logs: strict and bounded.

MATLAB version 5 (`mat5`), HDF5 with NetCDF 4 and MATLAB 7.3 (`hdf`), Parquet (`parquet`). Readers
give plain vectors; what these mean is for the caller. Every size that a file declares goes to
the caller's check before the bytes are expanded.
"""
