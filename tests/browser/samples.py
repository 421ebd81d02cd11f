"""The pages that are tested in the browser; the program makes them from simulated and measured records."""

import json
import math
import random
import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def mechid(program, folder, *arguments):
    done = subprocess.run([program, *map(str, arguments)], cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, f"{arguments}: {done.stderr}"
    return done.stdout


def three_masses(program, folder):
    """Write three records of a chain of three masses; in each record the force acts on another mass."""
    for driven in (1, 2, 3):
        experiment = {
            "system": {
                "mass": [[2, 0, 0], [0, 3, 0], [0, 0, 1.5]],
                "damping": [[6, -2, 0], [-2, 5, -3], [0, -3, 4]],
                "stiffness": [[9000, -4000, 0], [-4000, 9000, -5000], [0, -5000, 7000]],
            },
            "sampling": {"samples": 512, "rate_hz": 64},
            "excitation": [{"dof": driven, "lines": "4:160", "amplitude": 2}],
            "periods": 4,
            "noise": {"displacement": {"fraction_of_rms": 0.01}, "seed": driven},
        }
        (folder / f"force{driven}.json").write_text(json.dumps(experiment))
        mechid(program, folder, "simulate", f"force{driven}.json", "--output", f"force{driven}.csv", "--quiet")
    names = (folder / "force1.csv").read_text().splitlines()[0].replace('"', "").split(",")
    return [name for name in names if name.startswith("force")], [name for name in names if name.startswith("disp")]


def trends(program, folder):
    """Write forty records of an oscillator; its stiffness rises by 4 % at the 25th, and the 12th is of another machine."""
    day = folder / "day"
    day.mkdir()
    for number in range(1, 41):
        stiffness = 142122 * (1.04 if number >= 25 else 1.0) * (1 + 0.002 * random.Random(number).gauss(0, 1))
        if number == 12:
            stiffness *= 3
        experiment = {
            "system": {"mass": 25, "damping": 188.5, "stiffness": stiffness},
            "sampling": {"samples": 128, "rate_hz": 128},
            "excitation": {"lines": "4:40", "amplitude": 2},
            "periods": 2,
            "noise": {"displacement": {"fraction_of_rms": 0.01}, "seed": number},
        }
        (folder / "rig.json").write_text(json.dumps(experiment))
        mechid(program, folder, "simulate", "rig.json", "--output", f"day/run-{number:03}.csv", "--quiet")
    analysis = {
        "channels": {"force": ["force"], "displacement": ["displacement"]},
        "window": {"period": 128},
        "identify": {"method": "maximum-likelihood"},
    }
    (folder / "analysis.json").write_text(json.dumps(analysis))
    mechid(program, folder, "fleet", "day", "--analysis", "analysis.json", "--output", "results")
    return mechid(program, folder, "trends", "results", "--output", "trends.html", "--table", "trends.csv")


def cubic(folder):
    """Write two periods of a mass on a linear and a cubic spring: a motion of sines, and the force that it needs."""
    m, c, k, cube = 2.0, 6.0, 800.0, 4e7
    rows = ["time,F,x,v,a"]
    for n in range(1024):
        t, x, v, a = n / 128, 0.0, 0.0, 0.0
        for line in range(4, 50):
            w, phase, amplitude = 2 * math.pi * line / 4, line * line / 3, 4e-4
            x += amplitude * math.cos(w * t + phase)
            v -= amplitude * w * math.sin(w * t + phase)
            a -= amplitude * w * w * math.cos(w * t + phase)
        force = m * a + c * v + k * x + cube * x**3
        rows.append(f"{t},{force:.12e},{x:.12e},{v:.12e},{a:.12e}")
    (folder / "cubic.csv").write_text("\n".join(rows) + "\n")


# Mass (kg), damping (N·s/m), stiffness (N/m) and cubic stiffness (N/m³) of the free decay, whose frequency falls as it decays.
HARDENING = (1.0, 1.2, (2 * math.pi * 10) ** 2, 4e8)


def hardening(folder):
    """Write the free decay of a mass on a hardening spring from 2 mm, by Runge-Kutta with 64 steps per sample."""
    m, c, k, cube = HARDENING

    def rate(x, v):
        return v, -(c * v + k * x + cube * x**3) / m

    noise, step = random.Random(1), 1 / 256 / 64
    rows, x, v = ["# Operator: M. Curie", "# Sensors: laser 4", "time,x"], 2e-3, 0.0
    for n in range(2048):
        rows.append(f"{n / 256},{x + noise.gauss(0, 1e-6):.9e}")
        for _ in range(64):
            x1, v1 = rate(x, v)
            x2, v2 = rate(x + step / 2 * x1, v + step / 2 * v1)
            x3, v3 = rate(x + step / 2 * x2, v + step / 2 * v2)
            x4, v4 = rate(x + step * x3, v + step * v3)
            x, v = x + step / 6 * (x1 + 2 * x2 + 2 * x3 + x4), v + step / 6 * (v1 + 2 * v2 + 2 * v3 + v4)
    (folder / "hardening.csv").write_text("\n".join(rows) + "\n")


def hardening_hz(amplitude):
    """Frequency (Hz) of the undamped oscillation: a complete elliptic integral, by the arithmetic-geometric mean."""
    m, _, k, cube = HARDENING
    a, b = math.sqrt((k + cube * amplitude**2) / m), math.sqrt((k + cube * amplitude**2 / 2) / m)
    while abs(a - b) > 1e-14 * a:
        a, b = (a + b) / 2, math.sqrt(a * b)
    return a / (2 * math.pi)


def make(program, pages, folder):
    """Write all pages into a folder; `pages` is the example program that makes pages with known numbers."""
    subprocess.run([pages, folder], check=True)
    machine = ROOT / "examples" / "machine.csv"
    usual = ("--force", "force", "--displacement", "displacement", "--period", "256", "--quiet")
    mechid(program, folder, "report", machine, *usual, "--reconstruct-force", "--output", "one.html")
    forces, motions = three_masses(program, folder)
    about = "Sensors: three laser vibrometers\nOperator: <script>alert(1)</script>\nPlace: rig 3\n"
    (folder / "about.txt").write_text(about)
    records = [f"force{n}.csv" for n in (1, 2, 3)]
    columns = ("--force", ",".join(forces), "--displacement", ",".join(motions), "--period", "512", "--quiet")
    mechid(program, folder, "report", *records, *columns, "--about", "about.txt", "--output", "three.html",
           "--method", "maximum-likelihood")
    mechid(program, folder, "report", records[0], *columns, "--output", "single.html", "--method", "maximum-likelihood")
    system = mechid(program, folder, "identify", *records, *columns[:-1], "--json")
    (folder / "system.json").write_text(system)
    mechid(program, folder, "force", "force1.csv", "--system", "system.json", *columns[2:], "--plot", "force.html")
    trends(program, folder)
    cubic(folder)
    names = ("--force", "F", "--displacement", "x", "--velocity", "v", "--acceleration", "a")
    mechid(program, folder, "report", "cubic.csv", *names[:4], "--period", 512, "--nonlinear", "k3: x1^3",
           "--output", "nonlinear.html", "--quiet")
    examples = ROOT / "examples"
    mechid(program, folder, "bearing", examples / "bearing-rig.csv", "--force", "fx,fy", "--acceleration", "ax,ay",
           "--displacement", "dx,dy", "--stator-mass", 20, "--rotation-hz", 50, "--period", 256, "--plot", "bearing.html")
    mechid(program, folder, "modes", examples / "decay.csv", "--acceleration", "a1,a2,a3", "--plot", "decay.html",
           "--shapes", "decay.unv")
    modes = (examples / "hammer-1.csv", examples / "hammer-2.csv", "--force", "force", "--force-at", "1,2",
             "--acceleration", "a1,a2", "--response-at", "1,2", "--hits", "--diagrams", "--json")
    saved = mechid(program, folder, "modes", *modes, "--plot", "modes.html", "--about", "about.txt")
    (folder / "modes.json").write_text(saved)
    mechid(program, folder, "report", "modes.json", "--output", "saved.html")
    hardening(folder)
    mechid(program, folder, "modes", "hardening.csv", "--displacement", "x", "--plot", "backbone.html")
    mechid(program, folder, "frf", examples / "hammer-1.csv", "--force", "force,0", "--acceleration", "a1,a2", "--hits",
           "--exponential-percent", 1, "--band-hz", "2:100", "--plot", "frf.html")
