"""Studies: what a paper reports, made again on data, one folder a paper."""
