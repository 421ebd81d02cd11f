//! Misprints of the equations; the library follows the corrected ones.

/// Misprints of equations: place, printed, right, reason.
pub const EQUATIONS: &[[&str; 4]] = &[
    ["after (3.3.1.4)", "X at t − Dt", "X at t + Dt", "the central difference solves for it"],
    ["table 3.2, B3", "time t", "time t + Dt", "Houbolt's equilibrium is at t + Dt"],
    ["(3.3.3.5)", "a velocity without its instant", "the velocity at t", "the instant is lost"],
    [
        "table 3.3, B1–B3",
        "the block of Houbolt's method",
        "the block of Wilson's θ method",
        "table 3.2 repeated; the load belongs at t + θDt",
    ],
    ["table 3.4, a0", "1/(α Dt)²", "1/(α Dt²)", "the equations above it"],
    [
        "table 3.4, B3",
        "the acceleration's bracket; the velocity as Ẋ − a4 Ẋ − a7 Ẍ",
        "Ẋ + a6 Ẍ(t) + a7 Ẍ(t + Dt)",
        "the printed form is no update of a velocity",
    ],
    ["(3.3.5.2)", "X = f(Ẋ, Ẍ, t)", "Ẍ = f(X, Ẋ, t)", "the equation of motion"],
    ["(3.3.6.7)", "half a step in the fourth stage", "a full step", "Runge-Kutta of fourth order"],
    ["(4.2.3) against (21) of the papers", "−Kyx and +Kyx", "one sign", "see *stiffness sign*"],
    ["(4.3.1)", "range of the index, k > 1", "l < n", "the sum runs over the earlier lines"],
    [
        "(4.3.3), (4.3.4)",
        "a phase with a stray 1, without integer part and modulus",
        "π (⌊n²/2N⌋ mod 2)",
        "as printed the spectrum is not flat",
    ],
    ["(4.4.2)", "b + ε", "b − ε", "(4.4.3) defines ε = b − Aφ"],
    ["(4.5.28), rows 5 and 6", "Dt", "Dt/M", "the input matrix of (4.5.27)"],
    [
        "(23) of the papers",
        "Cxy and Cyx interchanged, M/Dt",
        "(4.5.28) with Dt/M",
        "the equation of motion",
    ],
    ["(4.6.12), last harmonic", "X_n N ω", "X_N N ω", "the row of harmonic N"],
    [
        "(4.6.24), (4.6.25)",
        "the index n missing; X in the inertia of the Y equation",
        "F_n; Y",
        "the equation of motion along Y",
    ],
    ["(4.6.31), last row", "−Y_N N ω", "−X_N N ω", "(4.6.30)"],
    [
        "before (4.6.31)",
        "(4.6.26) and (4.6.29)",
        "(4.6.26) to (4.6.29)",
        "four equations are meant",
    ],
    [
        "(4.7.1)",
        "the inverse of B; reference to (4.5.28)",
        "the velocity rows of (4.5.27)",
        "B has rows of zeros and no inverse",
    ],
    ["(4.7.2), entry (1, 2)", "Dt/M", "Dt", "the displacement row of the state equation"],
    [
        "(4.7.2), (4.7.3), (25) of the papers",
        "no sign between the two bracketed terms",
        "minus",
        "the force is the difference of the two",
    ],
    [
        "(4.8.2), (4.8.3), (24) of the papers",
        "dots lost, in the papers also reversed",
        "M Ẍ + C Ẋ + K X",
        "the equation of motion",
    ],
    ["first (5.2.2)", "(5.2.2)", "(5.2.1)", "the number occurs twice"],
];
