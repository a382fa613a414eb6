"""Del Sol et al. 2014, external forces of a hydraulic arm, made again: study and page."""
