"""The live display: what a stream of sample blocks looks like to the person at the bench.

Everything here consumes blocks (`rig.live.block`) and knows no device. A session makes them from
hardware, `rig.live.replay` makes them from a recording, and neither can be told from the other.
"""
