"""Work shared among processes: this one, several of this computer, or the workers of a Dask cluster."""
