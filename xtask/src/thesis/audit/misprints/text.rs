//! Slips of the running text, the captions and the numbering.

/// Misprints of the text: place, printed, right, reason.
pub const TEXT: &[[&str; 4]] = &[
    [
        "section 5.2",
        "(5.2.2) stands beside two equations",
        "(5.2.1) for the equation of motion",
        "the definition of NPI has the same number",
    ],
    [
        "section 5.8.1",
        "ωn = 22.3607 rad/s, of the bearing's spectra",
        "1.7992 rad/s",
        "22.3607 rad/s is √(K/M) of the single degree of freedom",
    ],
    [
        "section 5.6",
        "1.7992 rad/s as the natural frequency",
        "a damped frequency, the imaginary part of an eigenvalue with −Kyx",
        "the natural frequency of that mode is 2.4087 rad/s at ζ = 0.665; the other mode has ωd = 1.6333 rad/s, ζ = 0.054",
    ],
    [
        "table 5.6.1",
        "Fx = 100 N",
        "Fx = 0, only Fy acts",
        "the text says so below the table, and the numbers come out only so",
    ],
    [
        "section 5.8.1",
        "figures 5.8.2 to 5.8.7 discussed as spectra",
        "5.8.2–5.8.5, 5.8.7 and 5.8.8",
        "5.8.6 is a block diagram and 5.8.8 a spectrum",
    ],
    [
        "section 5.3.1",
        "a discussion numbered (5.2.1) is referred to",
        "the discussion of the time domain in section 5.2",
        "that discussion carries no number",
    ],
    [
        "captions 5.7.2–5.7.9",
        "Nt fixed",
        "Nf = 128 fixed",
        "the section fixes Nf; it means the same Nt = 256",
    ],
    [
        "section 5.2 and the papers",
        "256 cosines; in section 5.2 also N/2 components",
        "127 harmonics",
        "with 256 samples 127 harmonics lie strictly between zero and Nyquist, and with these the tables come out",
    ],
    [
        "papers of Appendix D",
        "Dt = 0.08184 (NPI 6) and 0.02728 (NPI 2)",
        "0.081846 and 0.027282",
        "cut, not rounded",
    ],
    [
        "list of references",
        "pages 645–650 of one 1996 volume given to two articles",
        "one of the two is wrong",
        "the volume was not at hand to say which",
    ],
    [
        "eq. (4.2.3) against the papers of Appendix D",
        "−Kyx in one, +Kyx in the others",
        "one sign",
        "the tables of four methods belong to +Kyx, step size and Runge-Kutta to −Kyx: the slip *stiffness sign*",
    ],
];
