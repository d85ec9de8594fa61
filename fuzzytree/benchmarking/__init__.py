"""Error against run time: what each way of running a model costs, and what it gives."""
