//! Series of the figures: estimates and forces of one simulation, slips replayed or removed.

use mechid::force::{continuous, discretised};
use mechid::model::{Discretisation, KyxSign, SecondOrderSystem};
use mechid::plot::Panel;
use mechid::signal::{Extent, Spectrum};
use nalgebra::DMatrix;

use crate::thesis::case::{Case, Machine};
use crate::thesis::estimates::{self, Listed};
use crate::thesis::published::Method;
use crate::thesis::simulate::{Sequences, correct, slipped};

/// The bearing with −Kyx. If the slips are replayed, the simulation uses the sign of the original
/// program.
pub(crate) const BEARING: Machine = Machine::Bearing { kyx: KyxSign::Minus };

/// Reading of the dissertation: with the slips of the original programs, or without.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Reading {
    Replayed,
    Corrected,
}

impl Reading {
    pub(crate) const BOTH: [Reading; 2] = [Reading::Replayed, Reading::Corrected];

    pub(crate) fn title(self) -> &'static str {
        match self {
            Reading::Replayed => "slips of the original programs replayed",
            Reading::Corrected => "slips removed",
        }
    }

    pub(crate) fn sequences(self, case: Case, method: Method) -> Result<Sequences, String> {
        match self {
            Reading::Replayed => slipped(case, method),
            Reading::Corrected => correct(case, method),
        }
    }
}

/// Domain in which parameters are identified.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Domain {
    Time,
    Frequency,
}

impl Domain {
    pub(crate) fn name(self) -> &'static str {
        match self {
            Domain::Time => "time domain",
            Domain::Frequency => "frequency domain",
        }
    }

    /// The parameters from the sequences of one simulation, in the order of
    /// [`Machine::parameters`].
    pub(crate) fn estimate(
        self,
        reading: Reading,
        case: Case,
        method: Method,
        from: &Sequences,
    ) -> Listed {
        let single = matches!(case.machine, Machine::SingleDof { .. });
        // Tables 5.3.1 and 5.3.2 leave the coefficient of the force free in these two columns.
        let free_force = single && matches!(method, Method::Rk4 | Method::CentralDifference);
        match (self, reading) {
            (Domain::Time, _) => estimates::time(from),
            (Domain::Frequency, Reading::Corrected) => estimates::frequency(from),
            (Domain::Frequency, Reading::Replayed) if free_force => {
                estimates::frequency_offset_free_force(from)
            }
            (Domain::Frequency, Reading::Replayed) => estimates::frequency_offset(from),
        }
    }
}

/// Equation with which the force is reconstructed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Equation {
    Continuous,
    Discretised,
}

/// Amplitudes of the identified force (N), one column for each degree of freedom, on the lines 1 …
/// Nt/2 − 1.
pub(crate) struct ForceLines {
    pub(crate) omega: Vec<f64>,
    pub(crate) amplitude: Vec<Vec<f64>>,
}

/// The force identified from a simulation with the parameters identified from the same simulation.
pub(crate) fn force_lines(
    reading: Reading,
    case: Case,
    method: Method,
    domain: Domain,
    equation: Equation,
) -> Result<ForceLines, String> {
    let sequences = reading.sequences(case, method)?;
    let listed = domain.estimate(reading, case, method, &sequences)?;
    let machine = identified(&sequences, &listed)?;
    let force = match equation {
        Equation::Continuous => continuous(&machine, &sequences.response),
        Equation::Discretised => {
            discretised(&machine, &sequences.response, Discretisation::Euler, Extent::WholePeriod)
        }
    };
    let spectrum = Spectrum::from_record(force.map_err(|error| error.to_string())?.record());
    let lines = 1..case.nt.div_ceil(2);
    let column = |dof| lines.clone().map(|n| spectrum.line(n, dof).norm()).collect();
    Ok(ForceLines {
        omega: lines.clone().map(|n| spectrum.omega(n)).collect(),
        amplitude: (0..machine.dof()).map(column).collect(),
    })
}

/// The machine with the known mass and the listed stiffness and damping.
fn identified(sequences: &Sequences, listed: &[f64]) -> Result<SecondOrderSystem, String> {
    let truth = sequences.machine.system();
    let (n, entries) = (truth.dof(), truth.dof() * truth.dof());
    let mut stiffness = DMatrix::from_row_slice(n, n, &listed[..entries]);
    let damping = DMatrix::from_row_slice(n, n, &listed[entries..]);
    if let Machine::Bearing { kyx } = sequences.machine {
        // The tables list Kyx without the sign that it has in K.
        stiffness[(1, 0)] *= kyx.factor();
    }
    SecondOrderSystem::new(truth.mass().clone(), damping, stiffness)
        .map_err(|error| error.to_string())
}

/// Gives panels side by side the same range of ordinates.
pub(crate) fn same_ordinates(panels: Vec<Panel>) -> Vec<Panel> {
    let values = |panel: &Panel| {
        let curves = panel.data().iter().flat_map(|curve| curve.y().iter().copied());
        let lines =
            panel.references().iter().filter(|line| line.is_horizontal()).map(|line| line.value());
        curves.chain(lines).collect::<Vec<f64>>()
    };
    let (low, high) = panels
        .iter()
        .flat_map(values)
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
            (low.min(value), high.max(value))
        });
    panels.into_iter().map(|panel| panel.including_y(low, high)).collect()
}
