"""O'Neill et al. 2018 (grip torque and jaw angle of surgical tools), made again: study and page."""
