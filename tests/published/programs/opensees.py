"""Displacements of three storeys by the integrators of OpenSeesPy 3.7.1: opensees.csv."""

import math

import openseespy.opensees as ops

DT, STEPS = 0.01, 60
FORCE = [30 * math.sin(18 * k * DT) + 12 * math.sin(47 * k * DT) for k in range(STEPS + 2)]
STOREYS = [(2.0, 5000.0, 6.0), (3.0, 4000.0, 4.0), (1.5, 3000.0, 5.0)]
# TRBDF2 needs two steps of the analysis, of half the length, for each of its steps.
INTEGRATORS = [
    ("Newmark 1/2 1/4", 1, ("Newmark", 0.5, 0.25)),
    ("Newmark 1/2 1/6", 1, ("Newmark", 0.5, 1 / 6)),
    ("HHT 8/9", 1, ("HHT", 8 / 9)),
    ("GeneralizedAlpha 2/3 5/9", 1, ("GeneralizedAlpha", 2 / 3, 5 / 9)),
    ("WilsonTheta 1.42", 1, ("WilsonTheta", 1.42)),
    ("Houbolt", 1, ("Houbolt",)),
    ("CentralDifference", 1, ("CentralDifference",)),
    ("TRBDF2", 2, ("TRBDF2",)),
]

print("scheme,step,degree of freedom,displacement")
for name, parts, integrator in INTEGRATORS:
    ops.wipe()
    ops.model("basic", "-ndm", 1, "-ndf", 1)
    ops.node(0, 0.0)
    ops.fix(0, 1)
    for i, (mass, stiffness, damping) in enumerate(STOREYS, 1):
        ops.node(i, 0.0)
        ops.mass(i, mass)
        ops.uniaxialMaterial("Elastic", i, stiffness, damping)
        ops.element("zeroLength", i, i - 1, i, "-mat", i, "-dir", 1)
    ops.timeSeries("Path", 1, "-dt", DT, "-values", *FORCE)
    ops.pattern("Plain", 1, 1)
    ops.load(2, 1.0)
    ops.constraints("Plain")
    ops.numberer("Plain")
    ops.system("FullGeneral")
    ops.test("NormDispIncr", 1e-14, 20, 0)
    ops.algorithm("Linear")
    ops.integrator(*integrator)
    ops.analysis("Transient")
    for step in range(1, STEPS + 1):
        ops.analyze(parts, DT / parts)
        if step % 6 == 0 or (name == "Houbolt" and step < 3):
            for node in (1, 2, 3):
                print(f"{name},{step},{node},{ops.nodeDisp(node, 1)!r}")
