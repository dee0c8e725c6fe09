"""Many clips on dask.distributed: what is to be done, each clip in a process that can be killed, records, a summary."""
