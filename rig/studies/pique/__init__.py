"""Piqué 2018, joint torques of a patient-side manipulator, made again: study and page."""
