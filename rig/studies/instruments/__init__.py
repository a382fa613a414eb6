"""One estimator on many instruments: study and page."""
