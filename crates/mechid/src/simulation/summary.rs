//! Summary of a simulation, as text and as JSON.

use std::f64::consts::TAU;
use std::fmt;

use mechid_analysis::text::{compact, significant, text_table};
use mechid_io::{ResponseKind, SystemMatrices};
use mechid_model::{Instability, ModelError, Term, Terms};
use mechid_signal::{Record, message};
use serde::Serialize;

use super::{Multiplier, Simulation};

/// Summary of a [`Simulation`]; `Display` writes the summary as text, `Serialize` writes the same
/// content as data.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SimulationSummary {
    /// Scheme that computed the response, with its parameters.
    pub scheme: String,
    /// Conventions that the scheme uses.
    pub conventions: Vec<SchemeConvention>,
    /// Kind of the response.
    pub response: ResponseKind,
    /// Number of samples.
    pub samples: usize,
    /// Number of periods of the force.
    pub periods: usize,
    /// Sampling rate, in Hz.
    pub sample_rate_hz: f64,
    /// Number of degrees of freedom of the machine.
    pub degrees_of_freedom: usize,
    /// Oscillating modes of the machine (of its linear part if it is nonlinear), in rising order of
    /// frequency; none for a sparse machine.
    pub modes: Vec<SimulatedMode>,
    /// Channels of the record, in the order of the record.
    pub channels: Vec<SimulatedChannel>,
    /// The fastest growing free response of an unstable machine.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub instability: Option<FreeGrowth>,
    /// The largest Floquet multiplier of the periodic response of a nonlinear machine.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub multiplier: Option<LargestMultiplier>,
    /// Mass, damping and stiffness matrix, in SI units; `None` for a sparse machine.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub system: Option<SystemMatrices>,
    /// Nonlinear terms of the machine.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub nonlinear: Option<SimulatedTerms>,
}

/// Convention that a scheme uses where the literature has several.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct SchemeConvention {
    /// Subject of the convention.
    pub what: &'static str,
    /// Choice that the scheme uses.
    pub choice: &'static str,
}

/// A mode of the machine.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SimulatedMode {
    /// Natural frequency, in Hz.
    pub natural_frequency_hz: f64,
    /// Damping ratio.
    pub damping_ratio: f64,
}

/// A channel of the record.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SimulatedChannel {
    /// Name of the column of the channel.
    pub column: String,
    /// SI unit of the samples of the channel.
    pub unit: &'static str,
    /// RMS value with noise, in `unit`.
    pub rms: f64,
    /// RMS value of the noise, in `unit`.
    pub noise_rms: f64,
}

/// The fastest growing free response.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FreeGrowth {
    /// Real and imaginary part of the pole, in rad/s.
    pub pole: [f64; 2],
    /// Growth rate, in 1/s.
    pub growth_rate: f64,
    /// Time in which the response doubles, in s.
    pub doubling_time_s: f64,
    /// Text that describes the growth of the response.
    pub text: String,
}

/// Largest ratio of a disturbance of a periodic response after one period to the disturbance before
/// it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LargestMultiplier {
    /// Real and imaginary part of the factor, pure numbers.
    pub value: [f64; 2],
    /// Modulus of the factor: below 1 disturbances decay (pure number).
    pub modulus: f64,
    /// Error of the factor, including the error due to the time step if it is known (pure number).
    pub error: f64,
    /// Error of the factor due to the time step of the scheme (pure number); `None` if it is not
    /// known.
    pub scheme_error: Option<f64>,
    /// Text with the modulus of the factor, its error, and the stability of the response.
    pub text: String,
}

/// Nonlinear terms and their coefficients.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SimulatedTerms {
    /// The terms.
    pub terms: Terms,
    /// Coefficients in their SI units, one per term.
    pub coefficients: Vec<f64>,
}

/// One quantity at several degrees of freedom, without and with noise.
#[derive(Debug, Clone, Copy)]
pub(super) struct Group<'a> {
    pub name: &'static str,
    pub unit: &'static str,
    /// Degree of freedom of each channel, counted from 0.
    pub dofs: &'a [usize],
    pub truth: &'a Record,
    pub measured: &'a Record,
    /// Number of degrees of freedom of the machine.
    dof: usize,
}

impl Simulation {
    /// Returns names and samples of the columns of the measured record, in SI units: force of each
    /// forced degree of freedom, displacement, velocity and acceleration of each output.
    pub fn columns(&self) -> Vec<(String, &[f64])> {
        let mut columns = Vec::new();
        for group in self.groups() {
            let record = group.measured;
            let channel = |at: usize| (group.column(at), record.channel(at));
            columns.extend((0..record.channels()).map(channel));
        }
        columns
    }

    /// Summarises the machine, the response and the record.
    ///
    /// # Errors
    /// [`ModelError`] if the modes of the machine cannot be computed.
    pub fn summary(&self) -> Result<SimulationSummary, ModelError> {
        let modes = self.system.dense().map(|system| system.modes()).transpose()?;
        let convention =
            |c: &mechid_integrate::Convention| SchemeConvention { what: c.what, choice: c.choice };
        Ok(SimulationSummary {
            scheme: self.scheme.clone(),
            conventions: self.conventions.iter().map(convention).collect(),
            response: self.response_kind.clone(),
            samples: self.force.len(),
            periods: self.periods,
            sample_rate_hz: self.force.sampling().rate_hz(),
            degrees_of_freedom: self.system.dof(),
            modes: modes
                .iter()
                .flat_map(|modes| modes.iter())
                .map(|mode| SimulatedMode {
                    natural_frequency_hz: mode.natural_frequency() / TAU,
                    damping_ratio: mode.damping_ratio(),
                })
                .collect(),
            channels: self.groups().iter().flat_map(SimulatedChannel::from_group).collect(),
            instability: self.instability.as_ref().map(FreeGrowth::from_instability),
            multiplier: self.multiplier.map(LargestMultiplier::from_multiplier),
            system: self.system.dense().map(SystemMatrices::from),
            nonlinear: self.nonlinear.clone(),
        })
    }

    pub(super) fn groups(&self) -> [Group<'_>; 4] {
        let (truth, measured) = (&self.response, &self.measured_response);
        let (forced, outputs, dof) = (&self.forced, &self.outputs, self.system.dof());
        [
            ("force", "N", forced, &self.force, &self.measured_force),
            ("displacement", "m", outputs, truth.displacement(), measured.displacement()),
            ("velocity", "m/s", outputs, truth.velocity(), measured.velocity()),
            ("acceleration", "m/s²", outputs, truth.acceleration(), measured.acceleration()),
        ]
        .map(|(name, unit, dofs, truth, measured)| Group {
            name,
            unit,
            dofs,
            truth,
            measured,
            dof,
        })
    }
}

impl Group<'_> {
    /// Returns the name of the column of a channel, counted from 0; it includes the number of the
    /// degree of freedom if there are several.
    fn column(&self, channel: usize) -> String {
        self.named(channel, '_')
    }

    /// Returns the name of a channel, counted from 0, with the number of its degree of freedom
    /// after `separator`.
    pub fn named(&self, channel: usize, separator: char) -> String {
        match self.dof {
            1 => self.name.to_string(),
            _ => format!("{}{separator}{}", self.name, self.dofs[channel] + 1),
        }
    }
}

impl SimulatedChannel {
    /// Creates the channels of a group, one for each degree of freedom.
    fn from_group(group: &Group<'_>) -> Vec<Self> {
        let Group { unit, truth, measured, .. } = *group;
        let channel = |dof: usize| {
            let noise = measured.column(dof) - truth.column(dof);
            let per_sample = (measured.len() as f64).sqrt();
            Self {
                column: group.column(dof),
                unit,
                rms: measured.column(dof).norm() / per_sample,
                noise_rms: noise.norm() / per_sample,
            }
        };
        (0..measured.channels()).map(channel).collect()
    }
}

impl FreeGrowth {
    fn from_instability(instability: &Instability) -> Self {
        Self {
            pole: [instability.eigenvalue().re, instability.eigenvalue().im],
            growth_rate: instability.growth_rate(),
            doubling_time_s: instability.doubling_time(),
            text: instability.to_string(),
        }
    }
}

impl LargestMultiplier {
    fn from_multiplier(multiplier: Multiplier) -> Self {
        let Multiplier { value, error: of_steps, scheme_error } = multiplier;
        let modulus = value.norm();
        let error = of_steps + scheme_error.unwrap_or(0.0);
        let lacking = match scheme_error {
            Some(_) => "",
            None => "; ± does not include the error of the time step, which is not known",
        };
        let becomes = match modulus {
            _ if modulus + error < 1.0 => "the response is stable",
            _ if modulus - error > 1.0 => "the response is at the limit of stability",
            _ => "the stability of the response is not known",
        };
        let text = format!(
            "each period multiplies a disturbance of the response by at most {} ± {} (the largest Floquet \
             multiplier): {becomes}{lacking}",
            significant(modulus, 4),
            significant(error, 1),
        );
        Self { value: [value.re, value.im], modulus, error, scheme_error, text }
    }
}

impl SimulatedTerms {
    fn each(&self) -> impl Iterator<Item = (&Term, &f64)> {
        self.terms.iter().zip(&self.coefficients)
    }
}

impl fmt::Display for SimulationSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let kind = match self.response {
            ResponseKind::Periodic => "periodic response",
            ResponseKind::FromRest => "from rest",
            ResponseKind::From(_) => "from a given motion",
        };
        let samples = message::count(self.samples, "sample");
        let periods = message::count(self.periods, "period");
        writeln!(f, "{samples} at {} Hz, {periods}, {kind}", compact(self.sample_rate_hz, 8))?;
        writeln!(f, "scheme: {}", self.scheme)?;
        for SchemeConvention { what, choice } in &self.conventions {
            writeln!(f, "  {what}: {choice}")?;
        }
        for (term, coefficient) in self.nonlinear.iter().flat_map(SimulatedTerms::each) {
            let value = significant(*coefficient, 6);
            writeln!(f, "nonlinear term {term}, {} = {value} {}", term.name(), term.unit())?;
        }
        if self.system.is_none() {
            writeln!(
                f,
                "{} in sparse matrices",
                message::count(self.degrees_of_freedom, "degree of freedom")
            )?;
        }
        let header = |cells: [&str; 3]| cells.map(String::from).to_vec();
        let mode = match self.nonlinear {
            Some(_) => "mode of the linear part",
            None => "mode",
        };
        let mut rows = vec![header([mode, "natural frequency (Hz)", "damping ratio (%)"])];
        for (number, mode) in (1..).zip(&self.modes) {
            let cells = [mode.natural_frequency_hz, 100.0 * mode.damping_ratio];
            let mut row = vec![format!("{number}")];
            row.extend(cells.map(|v| significant(v, 5)));
            rows.push(row);
        }
        match self.system {
            None => writeln!(f)?,
            Some(_) => write!(f, "\n{}\n", text_table(&rows))?,
        }
        let mut rows = vec![header(["column", "RMS", "noise RMS"])];
        for c in &self.channels {
            let cells = [c.rms, c.noise_rms].map(|v| format!("{} {}", significant(v, 4), c.unit));
            let mut row = vec![c.column.clone()];
            row.extend(cells);
            rows.push(row);
        }
        f.write_str(&text_table(&rows))?;
        if let Some(multiplier) = &self.multiplier {
            writeln!(f, "\n{}", multiplier.text)?;
        }
        match &self.instability {
            Some(growth) => writeln!(f, "\nwarning: the machine is unstable, {}", growth.text),
            None => Ok(()),
        }
    }
}
