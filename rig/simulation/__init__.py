"""The simulated rig: motor, gearhead, cable, jaw, load motor and sensors, in compiled code.

Time is virtual: a call advances the rig by as many 1 ms ticks as asked, and the same seed gives
the same counts whatever the calls are cut into.

What the simulation does not model:

- the motor's voltage, back electromotive force and the limits they set: the drive is a current
  source with a lag and a limit (at the speeds of the reference campaigns the supply is far away);
- heat: no parameter changes with temperature or wear;
- the instrument's wrist: one grasper degree of freedom, no pitch and no roll;
- the gear differential's own shape: the reference gearhead shows about 25 mrad of lost motion and a
  4 mrad wave along the spindle. The plain plant has one linear stiffness fitted through both; the
  hidden effects `gear_backlash` and `gear_eccentricity` bring them back;
- torque that depends on the jaw angle with no load (about 20 mN m a radian at the spindle is
  measured): the hidden effect `jaw_spring` brings it back;
- the load unit's own dynamics: its torque follows its current with a lag, and the torque sensor at
  the jaw does not ring (59 Hz after a load step on the reference rig);
- tissue and objects between the jaws other than stiff stops;
- dynamics of the sensors: each channel is the quantity at its sensor at the sampling instant, plus
  noise, offset, drift, quantum and limit. The force-sensing resistor is linear: no creep, no
  hysteresis;
- jitter of the 1 kHz interrupt: ticks are exactly 1 ms apart.
"""
