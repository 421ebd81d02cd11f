//! Force reconstructed from the motion with the identified machine, compared with the measured
//! force.

use mechid_force::{self as force, Channel, IdentifiedForce, Rule, Start, channel_errors};
use mechid_model::ResponseQuantity;
use mechid_signal::{Record, SignalError, Spectrum};
use nalgebra::{Complex, DMatrix};

use crate::AnalysisError;
use crate::identify::Identified;
use crate::measurement::Block;
use crate::reconstruct::Method;
use crate::reconstruct::method::{Request, find};

/// A reconstructed force and the measured force.
pub struct Reconstruction {
    /// Name of the method.
    pub method: &'static str,
    /// Reconstructed force.
    pub force: IdentifiedForce,
    /// Measured force; in the frequency domain, its mean period on the used lines only.
    pub measured: Record,
    /// Degrees of freedom on which a force acts, counted from 0.
    pub forced: Vec<usize>,
    /// Ratio of the RMS of the difference to the RMS of the measured force, one per degree of
    /// freedom; `None` without a force.
    pub errors: Vec<Option<f64>>,
}

impl Reconstruction {
    /// Reconstructs the force line by line, on the `lines` of the mean `period`. If no lines are
    /// given, uses the method for an open record.
    ///
    /// # Errors
    /// [`AnalysisError::Force`] if the method refuses the record.
    pub(crate) fn new(
        identified: &Identified,
        period: &Block,
        lines: Option<Vec<usize>>,
    ) -> Result<Self, AnalysisError> {
        let machine = identified.machine()?;
        let force = &period.force;
        let forced: Vec<usize> =
            (0..force.channels()).filter(|c| force.column(*c).amax() > 0.0).collect();
        let request = Request {
            method: if lines.is_some() { Method::FrequencyDomain } else { Method::Auto },
            forced: forced.clone(),
            lines: lines.clone(),
            band_hz: None,
            periodic: lines.is_some(),
            start: Start::InMotion,
            rule: Rule::Likelihood,
            noise: Vec::new(),
            averaged: 1,
        };
        let result = find(&request, &machine, &motion(period)?)?;
        let measured = match &lines {
            Some(lines) => on_lines(force, lines)?,
            None => force.clone(),
        };
        let errors = channel_errors(result.force.record(), &measured)?;
        let (method, force) = (result.how.method, result.force);
        Ok(Self { method, force, measured, forced, errors })
    }
}

/// Returns all measured motions.
fn motion(source: &Block) -> Result<force::Measurement, AnalysisError> {
    let groups = [
        (&source.displacement, ResponseQuantity::Displacement),
        (&source.velocity, ResponseQuantity::Velocity),
        (&source.acceleration, ResponseQuantity::Acceleration),
    ];
    let (mut columns, mut channels) = (Vec::new(), Vec::new());
    for (record, quantity) in groups {
        let Some(record) = record else { continue };
        for dof in 0..record.channels() {
            columns.push(record.column(dof).into_owned());
            channels.push(Channel { dof, quantity });
        }
    }
    let record = Record::new(source.force.sampling(), DMatrix::from_columns(&columns))?;
    Ok(force::Measurement::new(record, channels)?)
}

/// Returns the part of a period on these lines.
fn on_lines(period: &Record, lines: &[usize]) -> Result<Record, SignalError> {
    let spectrum = Spectrum::from_record(period);
    let mut selected = DMatrix::from_element(spectrum.len(), spectrum.channels(), Complex::ZERO);
    for &n in lines {
        selected.set_row(n, &spectrum.lines().row(n));
    }
    Spectrum::from_lines(period.sampling(), selected)?.to_record()
}
