"""The live display: what a stream of sample blocks looks like to the person at the bench.

Everything here consumes blocks (`rig.live.block`) and is independent of devices. A session makes
them from hardware, `rig.live.replay` from a recording; the display treats both alike.
"""
