"""``imclab gate``: plan, set, scan, status, off, simulate."""

from __future__ import annotations

import functools
import subprocess
import time
from pathlib import Path
from typing import Annotated, Any

import typer

import rig
from imclab.commands.console import Progress, emit
from imclab.commands.gate_options import (
    AsJson,
    Baud,
    JournalFile,
    LimitsFile,
    Live,
    Model,
    Port,
    Timeout,
    with_plan_options,
)

app = typer.Typer(no_args_is_help=True, help="Time the gate of an image intensifier over a serial line.")

_JOURNAL = Path("gate-journal.jsonl")
_LOOK_S = 1.0


@app.command()
@with_plan_options
def plan(
    plan: rig.GatePlan,
    *,
    plot: Annotated[Path | None, typer.Option(help="Draw the timing diagram into this file.")] = None,
    as_json: AsJson = False,
) -> None:
    """Say what delay and width a target at a distance needs; nothing is sent."""
    if plot is not None:
        from imclab.commands.gate_plot import save_timing_diagram

        save_timing_diagram(plan, plot)
    emit(rig.plan_dict(plan), f"{rig.plan_table(plan)}\n\n{rig.plan_diagram(plan)}", as_json=as_json)


@app.command("set")
@with_plan_options
def set_gate(
    plan: rig.GatePlan,
    *,
    port: Port = None,
    baud: Baud = None,
    limits: LimitsFile = None,
    live: Live = False,
    arm: Annotated[bool, typer.Option("--arm", help="Let it fire until --hold ends or Ctrl-C.")] = False,
    hold: Annotated[str | None, typer.Option(help="How long to stay armed: '10 min'.")] = None,
    journal: JournalFile = None,
    timeout: Timeout = "1 s",
    as_json: AsJson = False,
) -> None:
    """Program a gate and read it back; a dry run unless --live. It ends with the triggers off."""
    if hold is not None and not arm:
        raise typer.BadParameter("--hold is for how long to stay armed: --arm goes with it")
    box = _open(plan.model.name, port, live, limits, plan, baud=baud, journal=journal, timeout=timeout)
    with box:
        gate = box.apply(plan)
        if arm:
            box.arm()
        changes = list(rig.differences(box.inherited, box.settings()))
        sent = [block.decode("latin-1") for block in box.conversation.journal.sent]
        if arm and live:
            _stay_armed(box, plan, hold)
    data = {
        **rig.plan_dict(plan),
        "live": live,
        "generator": box.identity.text,
        "read_delay_ps": gate.delay_ps,
        "read_width_ps": gate.width_ps,
        "changes": [{"name": name, "before": before, "after": after} for name, before, after in changes],
        "recoveries": box.conversation.recoveries,
        "sent": sent,
    }
    emit(data, _set_text(data, sent), as_json=as_json)


@app.command()
@with_plan_options
def scan(
    plan: rig.GatePlan,
    *,
    start: Annotated[
        str | None,
        typer.Option("--from", help="First distance ('9 m') or delay; default just before the target."),
    ] = None,
    stop: Annotated[
        str | None, typer.Option("--to", help="Last distance or delay; default just behind the target.")
    ] = None,
    step: Annotated[str | None, typer.Option(help="Step in distance or delay.")] = None,
    points: Annotated[int | None, typer.Option(help="Number of steps, instead of --step.")] = None,
    fine: Annotated[bool, typer.Option("--fine", help="A sixth of the depth of field, not half.")] = False,
    grab: Annotated[
        str | None,
        typer.Option(help="Command at each step ({index}, {delay_ps}); prints a number or a frame's file."),
    ] = None,
    dwell: Annotated[str, typer.Option(help="How long each step stays, armed.")] = "0 s",
    out: Annotated[Path | None, typer.Option("-o", "--output-file", help="CSV of the steps.")] = None,
    port: Port = None,
    baud: Baud = None,
    limits: LimitsFile = None,
    live: Live = False,
    journal: JournalFile = None,
    timeout: Timeout = "1 s",
    as_json: AsJson = False,
) -> None:
    """Sweep the gate over a range, every step read back; a dry run unless --live."""
    if out is not None and not out.parent.is_dir():
        raise typer.BadParameter(f"-o {out}: the folder {out.parent} is not there; make it first")
    sweep = rig.plan_scan(
        plan, start=start, stop=stop, step=step, points=points, fineness="fine" if fine else "coarse"
    )
    progress = Progress(quiet=as_json)
    taken = functools.partial(_run_grab, grab) if grab and live else None
    steps: list[rig.ScanStep] = []
    box = _open(plan.model.name, port, live, limits, plan, baud=baud, journal=journal, timeout=timeout)
    box.check_range(plan, min(sweep.delays_ps), max(sweep.delays_ps))
    begin = time.monotonic()
    try:
        with box:
            for one in rig.run_scan(box, sweep, grab=taken, dwell=dwell if live else "0 s"):
                steps.append(one)
                done = f"{one.index + 1} of {len(sweep.delays_ps)}"
                progress(f"{done}: {one.read_ps} ps, {one.distance_m:.3f} m")
    finally:
        progress.close()
        if out is not None and steps:
            rig.write_steps(out, steps)
    data: dict[str, Any] = {
        "live": live,
        "steps": len(steps),
        "step_ps": sweep.step_ps,
        "step_mm": sweep.step_m * 1e3,
        "first_ps": steps[0].read_ps,
        "last_ps": steps[-1].read_ps,
        "seconds": time.monotonic() - begin,
        "recoveries": box.conversation.recoveries,
        "file": None if out is None else str(out),
        "target": _target_of(plan, steps),
    }
    emit(data, _scan_text(data), as_json=as_json)


@app.command()
def status(
    port: Port = None,
    model: Model = "dg645",
    baud: Baud = None,
    journal: Annotated[Path | None, typer.Option(help="Tell what this journal says the box holds.")] = None,
    timeout: Timeout = "1 s",
    as_json: AsJson = False,
) -> None:
    """Read all settings of a generator, changing none; or what a journal says that it holds."""
    if journal is not None:
        replayed = rig.replay(journal)
        settings: dict[str, Any] = replayed.settings
        data = {"journal": str(journal), "unconfirmed": replayed.unconfirmed, "settings": settings}
        head = f"{journal}: {'the last block was not confirmed' if replayed.unconfirmed else 'all confirmed'}"
    else:
        port = _needed(port)
        with rig.open_generator(port, model=model, baud=baud, timeout=timeout, read_only=True) as box:
            settings = box.inherited
            data = {"port": port, "generator": box.identity.text, "settings": settings}
        head = f"{data['generator']} on {port}"
    rows = [f"  {name:<24} {value}" for name, value in _flat(settings)]
    emit(data, "\n".join([head, *rows]), as_json=as_json)


@app.command()
def off(
    port: Port = None,
    model: Model = "dg645",
    output: Annotated[str | None, typer.Option(help="Output that gates the tube.")] = None,
    baud: Baud = None,
    journal: JournalFile = None,
    timeout: Timeout = "1 s",
    as_json: AsJson = False,
) -> None:
    """Stop the triggers, narrow the gate, and confirm both; exit 3 if that cannot be confirmed."""
    journal = journal or _JOURNAL
    rig.switch_off(_needed(port), model=model, output=output, baud=baud, journal=journal, timeout=timeout)
    emit(
        {"port": port, "safe": True}, f"{port}: safe, confirmed: triggers off, gate narrowed", as_json=as_json
    )


@app.command()
def simulate(
    model: Model = "dg645",
    tcp: Annotated[str | None, typer.Option(help="HOST:PORT; port 0 takes a free one.")] = None,
    pty: Annotated[bool, typer.Option("--pty", help="A pseudo-terminal.")] = False,
    link: Annotated[Path | None, typer.Option(help="With --pty: a fixed name for it.")] = None,
    baud: Annotated[int | None, typer.Option(help="Let every byte take its time.")] = None,
    serial: Annotated[str | None, typer.Option(help="The serial number that it tells.")] = None,
    seed: Annotated[int, typer.Option(help="Of the faults.")] = 0,
    fault: Annotated[
        list[str] | None, typer.Option(help="Start with a fault: 'NAME [after=N] [count=N] [argument=X]'.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Be a virtual generator, until Ctrl-C; its address is on the first line."""
    import json

    from rig.simulator.side_door import answer

    address = tcp or (None if pty or link else "127.0.0.1:0")
    wants_pty = pty or link is not None
    server = rig.simulate(
        model, tcp=address, pty=wants_pty, baud=baud, seed=seed, serial=serial, symlink=link
    )
    server.open()
    for one in fault or []:
        told = json.loads(answer(server, f"fault {one}"))
        if "error" in told:
            raise typer.BadParameter(told["error"])
    host, number = server.address or (None, None)
    door = "{}:{}".format(*server.side_door)
    data = {
        "model": model, "url": server.url, "host": host, "port": number, "pty": server.pty_name or None,
        "side_door": door,
    }  # fmt: skip
    lines = ([f"listening on socket://{host}:{number}"] if host else []) + (
        [f"pty {server.pty_name}"] if wants_pty else []
    )
    print(json.dumps(data) if as_json else "\n".join([*lines, f"side door {door}"]), flush=True)
    try:
        with rig.interruptible():
            server.run()
    finally:
        server.close()


def _open(
    model: str,
    port: str | None,
    live: bool,
    limits: Path | None,
    plan: rig.GatePlan,
    *,
    journal: Path | None,
    **chosen: Any,
) -> rig.Generator:
    """Return a generator for a live or dry run, after the plan passed the limits; nothing is opened."""
    if live and limits is None:
        raise typer.BadParameter("--live needs --limits FILE: what this rig's tube can stand (docs/gate.md)")
    known = None if limits is None else rig.load_limits(limits)
    box = rig.open_generator(
        _needed(port) if live else None,
        model=model,
        limits=known,
        journal=(journal or _JOURNAL) if live else journal,
        **chosen,
    )
    box.check_range(plan, plan.delay_ps, plan.delay_ps)
    return box


def _needed(port: str | None) -> str:
    if port is None:
        raise typer.BadParameter(
            "--port is needed: a serial device, socket://HOST:PORT or rfc2217://HOST:PORT"
        )
    return port


def _stay_armed(box: rig.Generator, plan: rig.GatePlan, hold: str | None) -> None:
    """Wait, and look every second whether the box still holds the gate."""
    seconds = None if hold is None else rig.seconds(hold)
    end = None if seconds is None else time.monotonic() + seconds
    Progress()(f"ARMED{'' if hold is None else f' for {hold}'}; Ctrl-C makes it safe", final=True)
    while end is None or time.monotonic() < end:
        time.sleep(_LOOK_S if end is None else max(0.0, min(_LOOK_S, end - time.monotonic())))
        box.check_held(plan.delay_ps)


def _run_grab(command: str, step: rig.ScanStep) -> float | None:
    """Run the user's command at a step; what it prints is a number, or the name of a frame to average."""
    words = command
    for name, value in (("index", step.index), ("delay_ps", step.read_ps), ("distance_m", step.distance_m)):
        words = words.replace(f"{{{name}}}", str(value))
    done = subprocess.run(words, shell=True, check=False, capture_output=True, text=True)
    if done.returncode:
        came = f"exit {done.returncode} of {words!r}: {done.stderr.strip()[-200:]}"
        raise rig.PlanError("scan", [rig.Fault("--grab", came, "a command that ends well")])
    if not done.stdout.strip():
        return None
    last = done.stdout.strip().splitlines()[-1]
    try:
        return float(last)
    except ValueError:
        import tifffile

        return float(tifffile.imread(last).mean())


def _target_of(plan: rig.GatePlan, steps: list[rig.ScanStep]) -> dict[str, float] | None:
    import dataclasses

    signal = [step.signal for step in steps if step.signal is not None]
    if len(signal) != len(steps):
        return None
    return dataclasses.asdict(rig.find_target(plan, [step.read_ps for step in steps], signal))


def _flat(settings: dict[str, Any], prefix: str = "") -> list[tuple[str, Any]]:
    rows: list[tuple[str, Any]] = []
    for name, value in settings.items():
        rows += _flat(value, f"{name}.") if isinstance(value, dict) else [(f"{prefix}{name}", value)]
    return rows


def _set_text(data: dict[str, Any], sent: list[str]) -> str:
    rows = [f"  {one['name']:<24} {one['before']} -> {one['after']}" for one in data["changes"]]
    box = data["generator"] if data["live"] else f"a simulated {data['generator']}"
    head = f"{box}: output {data['output']} reads {data['read_delay_ps']} ps, "
    head += f"{data['read_width_ps']} ps wide; triggers off"
    if data["live"]:
        return "\n".join([head, *rows])
    dry = ["DRY RUN: nothing was sent; --live with --port and --limits would send:"]
    changing = [block for block in sent if any("?" not in line for line in block.split())]
    return "\n".join([*dry, *(f"  {block!r}" for block in changing), head, *rows])


def _scan_text(data: dict[str, Any]) -> str:
    head = "" if data["live"] else "DRY RUN: nothing was sent. "
    head += f"{data['steps']} steps of {data['step_ps']} ps = {data['step_mm']:.2f} mm, "
    head += f"{data['first_ps']} to {data['last_ps']} ps, all read back, in {data['seconds']:.1f} s"
    if data["target"] is None:
        return head
    found = data["target"]
    metres, unsure = found["distance_m"], found["uncertainty_m"]
    return f"{head}\ntarget at {metres:.4f} m, standard uncertainty {unsure:.4f} m"
