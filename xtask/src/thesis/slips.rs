//! The dissertation's departures from its own equations, as named data.
//!
//! The library knows none of them. The reproduction applies them to correct library
//! output, and prints the correct result next to the slipped one.

use mechid::signal::Record;
use nalgebra::DMatrix;

/// A named departure from the dissertation's own equations.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Slip {
    /// The displacement of t + Dt is stored with the velocity, acceleration and force of t.
    CentralDifferenceLead,
    /// The response of t + Dt is stored with the index of t.
    WilsonLoadLag,
    /// Harmonic n has the frequency (n + 1)·ω0 instead of n·ω0.
    HarmonicOffset,
    /// Four programs use +Kyx; the fifth program, and the formula for the step size, use −Kyx.
    StiffnessSign,
    /// The forces of the four Runge-Kutta stages belong to wrong instants.
    RungeKuttaStageLoads,
    /// The coefficient of the force is estimated in the frequency-domain fit, although it is known.
    FreeForceCoefficient,
    /// A minus sign is lost or reversed in print.
    LostSigns,
}

impl Slip {
    /// Every slip, in the order of the audit page.
    pub const ALL: [Slip; 7] = [
        Slip::CentralDifferenceLead,
        Slip::WilsonLoadLag,
        Slip::HarmonicOffset,
        Slip::StiffnessSign,
        Slip::RungeKuttaStageLoads,
        Slip::FreeForceCoefficient,
        Slip::LostSigns,
    ];

    /// The slips that the reproduction of a table replays.
    pub fn for_table(table: &str) -> Vec<Self> {
        let frequency =
            table.starts_with("5.3.") || table.starts_with("5.7.") || table.starts_with('A');
        let bearing = !table.starts_with("5.2.") && !table.starts_with("5.3.");
        let newmark_alone = table == "5.3.3";
        let free_force = matches!(table, "5.3.1" | "5.3.2");
        let lost = matches!(table, "5.6.9" | "5.6.17" | "5.3.2");
        Self::ALL
            .into_iter()
            .filter(|slip| match slip {
                Slip::CentralDifferenceLead | Slip::WilsonLoadLag | Slip::RungeKuttaStageLoads => {
                    !newmark_alone
                }
                Slip::HarmonicOffset => frequency,
                Slip::StiffnessSign => bearing,
                Slip::FreeForceCoefficient => free_force,
                Slip::LostSigns => lost,
            })
            .collect()
    }

    /// Returns the name of the slip on the audit page.
    pub fn name(self) -> &'static str {
        match self {
            Slip::CentralDifferenceLead => "central-difference lead",
            Slip::WilsonLoadLag => "Wilson load lag",
            Slip::HarmonicOffset => "harmonic offset",
            Slip::StiffnessSign => "stiffness sign",
            Slip::RungeKuttaStageLoads => "Runge-Kutta stage loads",
            Slip::FreeForceCoefficient => "free force coefficient",
            Slip::LostSigns => "lost signs",
        }
    }

    /// Returns the printed numbers that the slip affects.
    pub fn printed_numbers(self) -> &'static str {
        match self {
            Slip::CentralDifferenceLead => "all central-difference columns",
            Slip::WilsonLoadLag => "all Wilson θ columns",
            Slip::HarmonicOffset => "every frequency-domain table",
            Slip::StiffnessSign => "bearing tables, the four direct methods",
            Slip::RungeKuttaStageLoads => "all Runge-Kutta columns",
            Slip::FreeForceCoefficient => {
                "tables 5.3.1 and 5.3.2, Runge-Kutta and central-difference columns"
            }
            Slip::LostSigns => {
                "Wilson θ columns of 5.6.9 and 5.6.17; central-difference column of 5.3.2"
            }
        }
    }

    /// Returns a description of the computation in the original programs.
    pub fn original_computation(self) -> &'static str {
        match self {
            Slip::CentralDifferenceLead => {
                "the displacement at t + Dt is stored with the velocity, acceleration and force of t"
            }
            Slip::WilsonLoadLag => {
                "the response of t + Dt is stored with index t, so it is regressed on a force one sample late"
            }
            Slip::HarmonicOffset => {
                "harmonic n is given ω = (n + 1)·ω0, for n = 0 … Nt/2 − 1, the mean (n = 0) among them"
            }
            Slip::StiffnessSign => {
                "the stiffness matrix has +Kyx in its second row, while the step size follows from −Kyx"
            }
            Slip::RungeKuttaStageLoads => {
                "the stages of step k are loaded with F0 F0 F0 F0 (k = 0), F0 F1 F1 F2 (k = 1) and F_k F_{k+1} F_{k+1} F_{k+1} (k ≥ 2)"
            }
            Slip::FreeForceCoefficient => {
                "the force is a third regressor with a free coefficient beside K and C, instead of a known right-hand side"
            }
            Slip::LostSigns => "the minus sign of a whole column is lost (or, in 5.6.17, reversed)",
        }
    }

    /// Returns a description of the computation that the dissertation's own equations require.
    pub fn required_computation(self) -> &'static str {
        match self {
            Slip::CentralDifferenceLead => "x, v, a and F of the same instant",
            Slip::WilsonLoadLag => "response and force of the same instant",
            Slip::HarmonicOffset => "ω = n·ω0 and n ≥ 1",
            Slip::StiffnessSign => "one sign for all programs, −Kyx as in eq. (4.2.3)",
            Slip::RungeKuttaStageLoads => {
                "F at t, t + Dt/2, t + Dt/2, t + Dt; between samples at least the linear value"
            }
            Slip::FreeForceCoefficient => "the coefficient of the measured force is one",
            Slip::LostSigns => "the sign the least squares give",
        }
    }
}

/// The force of the original Runge-Kutta program: at the samples, and in the middle of the step
/// that follows each sample.
///
/// Written out, the four stages of step k were given F0 F0 F0 F0 (k = 0), F0 F1 F1 F2 (k = 1) and
/// F_k F_{k+1} F_{k+1} F_{k+1} (k ≥ 2), every period anew. That is a classical step on a force
/// whose sample 1 repeats sample 0, and whose mid-step values are taken half a step late (half a
/// step early in the first two steps).
pub fn stage_loads(force: &Record) -> (Record, Record) {
    let n = force.len();
    let samples =
        DMatrix::from_fn(n, force.channels(), |k, c| force.channel(c)[if k == 1 { 0 } else { k }]);
    let middles = DMatrix::from_fn(n, force.channels(), |k, c| {
        force.channel(c)[if k < 2 { k } else { (k + 1) % n }]
    });
    let record = |data| Record::new(force.sampling(), data).expect("samples of a finite record");
    (record(samples), record(middles))
}

/// Returns the record one sample early: sample k of the result is sample k + 1 of the input,
/// cyclically.
pub fn one_sample_early(record: &Record) -> Record {
    let n = record.len();
    let data = DMatrix::from_fn(n, record.channels(), |k, c| record.channel(c)[(k + 1) % n]);
    Record::new(record.sampling(), data).expect("a permutation of finite samples")
}
