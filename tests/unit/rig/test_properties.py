"""Every property of both families, set and read back over its whole range, on a pty and on TCP."""

from __future__ import annotations

import random
from collections.abc import Iterator
from fractions import Fraction
from typing import Any

import pytest

import rig
from rig.bnc575 import BNC575
from rig.dg645 import DG645
from rig.dialect import Names, Steps, Switch
from rig.generator import Generator
from tests.unit.rig.bad_line import generous_limits

DIALECTS = {"dg645": DG645(), "bnc575": BNC575()}
OUTPUT = {"dg645": "AB", "bnc575": "B"}  # limits keep the gate's own output, A, from negative delays


@pytest.fixture(
    scope="module", params=[("dg645", "tcp"), ("dg645", "pty"), ("bnc575", "tcp"), ("bnc575", "pty")]
)
def live(request: pytest.FixtureRequest) -> Iterator[tuple[str, Generator]]:
    model, kind = request.param
    tcp = "127.0.0.1:0" if kind == "tcp" else None
    with (
        rig.simulate(model, tcp=tcp, pty=kind == "pty") as simulated,
        rig.open_generator(simulated.url, model=model, limits=generous_limits(model)) as box,
    ):
        box.apply(rig.plan_gate("40 m", model=model))
        yield model, box


def values_of(domain: Any) -> list[Any]:
    """Both ends, the smallest steps beside them, and some between; or every name."""
    if isinstance(domain, Names):
        return list(domain.wire)
    if isinstance(domain, Switch):
        return [True, False]
    steps = getattr(domain, "steps", domain)
    if isinstance(steps, Steps):
        chosen = random.Random(1)
        low, high, step = steps.lowest, steps.highest, steps.step
        if steps is not domain:
            high = high // 2 // step * step  # rise and width share one cycle: half of it each
        native = [low, low + step, high - step, high]
        native += [chosen.randrange(low // step, high // step) * step for _ in range(4)]
        return [Fraction(value, steps.per_si) for value in native]
    return []


def test_every_number_and_name_comes_back_as_it_was_sent(live: tuple[str, Generator]) -> None:
    model, box = live
    dialect = DIALECTS[model]
    checked = 0
    wanted = [(name, None) for name in dialect.system_properties]
    wanted += [(name, OUTPUT[model]) for name in dialect.output_properties]
    for name, output in wanted:
        domain = dialect.property(name, output).domain
        for value in values_of(domain):
            if name in ("trigger_source", "link", "amplitude", "offset"):
                continue
            applied = box.set(name, value, output)
            native = domain.native(value, name)
            assert applied.sent == applied.read == domain.shown(native)
            assert box.read(name, output) == domain.shown(native)
            checked += 1
    assert checked > 45
    box.apply(rig.plan_gate("40 m", model=model))


def test_trigger_sources_links_and_levels(live: tuple[str, Generator]) -> None:
    model, box = live
    box.apply(rig.plan_gate("40 m", model=model))
    box.set("polarity", "positive")
    sources = ["internal", "external rising", "external falling"]
    sources += ["single external rising", "single external falling", "line"] if model == "dg645" else []
    for source in sources:
        assert box.arm(source).read == source == box.read("trigger_source")
    box.disarm()
    other = "C" if model == "dg645" else "B"
    for link in (other, "T0"):
        assert box.set("link", link).read == link == box.read("link")
    lowest, highest = ("0.50 V", "5.00 V") if model == "dg645" else ("2.00 V", "20.00 V")
    for level in (lowest, highest, "2.51 V"):
        assert box.set("amplitude", level).read == round(float(level.split()[0]) * 1000)
    if model == "dg645":
        for level in ("-2.00 V", "2.00 V", "0.01 V", "0 V"):
            assert box.set("offset", level).read == round(float(level.split()[0]) * 1000)
        with pytest.raises(rig.InstrumentError, match="illegal value"):
            box.set("amplitude", "5 V")
            box.set("offset", "1 V")  # level and offset together stay below 6 V
        box.set("amplitude", "2.5 V")


@pytest.mark.parametrize("delay_ps", [0, 5, 445_320, 1_999_999_999_999_995 - 5])
def test_delays_of_the_dg645_keep_every_five_picoseconds(live: tuple[str, Generator], delay_ps: int) -> None:
    model, box = live
    if model == "bnc575":
        delay_ps = min(delay_ps // 250 * 250, 999_999_999_999_750)
    else:
        box.set("width", "5 ps")
    assert box.set("delay", Fraction(delay_ps, 10**12)).read == delay_ps
    assert box.read("delay") == delay_ps
    box.set("delay", "300 ns")


def test_a_rate_is_the_nearest_period_of_a_box_that_counts_periods() -> None:
    with rig.open_generator(None, model="bnc575") as box:
        applied = box.set("trigger_rate", "3 kHz")
        assert box.read("trigger_period") == 333_330_000
        assert applied.read == pytest.approx(3000.03, abs=0.001)


@pytest.mark.parametrize("model", ["dg645", "bnc575"])
@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("delay", "2000 s"),
        ("width", "0 ns"),
        ("trigger_level", "99 V"),
        ("trigger_rate", "20 MHz"),
        ("burst_count", 0),
        ("polarity", "sideways"),
        ("shape", "round"),
        ("delay", float("nan")),
    ],
)
def test_what_the_box_cannot_hold_is_refused_before_it_is_sent(model: str, name: str, value: Any) -> None:
    with rig.open_generator(None, model=model, limits=generous_limits(model)) as box:
        box.conversation.journal.sent.clear()
        with pytest.raises(rig.PlanError):
            box.set(name, value)
        assert box.conversation.journal.sent == []


def test_save_and_recall_come_back_with_the_triggers_off() -> None:
    for model in ("dg645", "bnc575"):
        with rig.open_generator(None, model=model, limits=generous_limits(model)) as box:
            box.apply(rig.plan_gate("40 m", model=model))
            box.arm("internal")
            box.save(3)
            box.set("delay", "700 ns")
            settings = box.recall(3)
            assert settings["trigger_source"] == "off"
            assert box.read("delay") != 700_000
            with pytest.raises(rig.PlanError):
                box.save(0)


def test_the_error_queue_is_told_in_words() -> None:
    with rig.open_generator(None) as box:
        box.conversation.link.device.feed("DLAY 2,2,1")  # type: ignore[attr-defined]
        box.conversation.link.device.feed("BLAH 1")  # type: ignore[attr-defined]
        assert box.errors() == ["13: illegal link", "111: undefined command"]
        assert box.errors() == []
