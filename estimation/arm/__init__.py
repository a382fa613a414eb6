"""Arms: kinematics, torque regressors and their identification, as functions on arrays.

Rigid-body algorithms come from Pinocchio, an optional dependency (extra `arm`).
"""
