"""Zhang et al. 2022 made again: simulated seven-joint arms, study and page."""
