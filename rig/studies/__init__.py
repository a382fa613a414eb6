"""Studies: what a paper reports, made again on data, one file a paper."""
