"""Who does a piece of work: this process, several of this computer, or the workers of a Dask cluster."""
