"""Drivers written by others, unchanged, against the simulated generators.

They live in an environment of their own, never in this project's: ``pip install srsinst.dg645 qcsapphire
instrumentkit`` there, start ``imclab gate simulate --model dg645 --tcp 127.0.0.1:0`` and another with
``--model bnc575 --pty`` here, and run this file there with both addresses::

    python tests/figures/rig_peers.py 127.0.0.1:PORT /dev/pts/N
"""

from __future__ import annotations

import sys


def maker_of_the_dg645(address: str) -> int:
    """Set and read through SRS's own driver; return how many readings agreed."""
    from srsinst.dg645 import DG645  # type: ignore[import-not-found]

    host, _, port = address.rpartition(":")
    box = DG645("tcpip", host, int(port))
    agreed = 0
    try:
        assert "DG645" in box.check_id()[0]
        agreed += 1
        box.reset()
        for name, value in (("trigger_rate", 1234.5), ("trigger_level", 2.5), ("holdoff", 3e-6)):
            setattr(box.trigger, name, value)
            assert abs(float(getattr(box.trigger, name)) / value - 1) < 1e-9, name
            agreed += 1
        box.trigger.trigger_source = "ext rising"
        assert box.trigger.trigger_source == "ext rising"
        for delay in (0.0, 445.32e-9, 1.5):
            box.delays.delay["A"]["T0"] = delay
            reference, after = box.delays.delay["A"]
            assert (int(reference), round((float(after) - delay) * 1e12)) == (0, 0)
            agreed += 1
        box.outputs.amplitude["AB"] = 3.5
        assert float(box.outputs.amplitude["AB"]) == 3.5
        box.outputs.offset["AB"] = -0.5
        assert float(box.outputs.offset["AB"]) == -0.5
        agreed += 2
        box.burst.burst_count = 7
        assert int(box.burst.burst_count) == 7
        agreed += 1
    finally:
        box.disconnect()
    return agreed


def instrument_kit(address: str) -> int:
    """Set and read through InstrumentKit; return how many readings agreed."""
    import instruments  # type: ignore[import-not-found]
    import quantities  # type: ignore[import-not-found]

    host, _, port = address.rpartition(":")
    box = instruments.srs.SRSDG645.open_tcpip(host, int(port))
    box.trigger_rate = quantities.Quantity(500, "Hz")
    assert float(box.trigger_rate) == 500
    box.trigger_source = box.TriggerSource.external_rising
    assert box.trigger_source == box.TriggerSource.external_rising
    box.channel["B"].delay = (box.channel["A"], quantities.Quantity(3, "ns"))
    reference, after = box.channel["B"].delay
    assert (reference, float(after)) == (box.Channels.A, 3e-9)
    box.output["AB"].level_amplitude = quantities.Quantity(4.0, "V")
    assert float(box.output["AB"].level_amplitude) == 4.0
    box.output["AB"].polarity = box.LevelPolarity.negative
    assert box.output["AB"].polarity == box.LevelPolarity.negative
    return 5


def quantum_composers(port: str) -> int:
    """Set and read through qcsapphire; return how many readings agreed."""
    import qcsapphire  # type: ignore[import-not-found]

    pulser = qcsapphire.Pulser(port)
    assert pulser.query(":PULSE1:WIDTH 0.000025") == "ok"
    assert float(pulser.pulse1.width()) == 25e-6
    assert pulser.pulse1.polarity("INV") == "ok"
    assert pulser.pulse1.polarity() == "INV"
    assert pulser.pulse0.state(1) == "ok"
    assert pulser.pulse0.state() == "1"
    try:
        pulser.query(":PULSE1:BLAH?")
    except Exception as refusal:
        assert "keyword" in str(refusal)
    pulser.close()
    return 4


if __name__ == "__main__":
    print(f"srsinst.dg645: {maker_of_the_dg645(sys.argv[1])} readings agree")
    print(f"InstrumentKit: {instrument_kit(sys.argv[1])} readings agree")
    print(f"qcsapphire: {quantum_composers(sys.argv[2])} readings agree")
