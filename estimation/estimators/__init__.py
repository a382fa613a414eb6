"""The kinds of estimator behind `estimation.estimator`, one a file."""
