//! Reconstruction of the unknown force on a known machine.
//!
//! | File | What it does |
//! |---|---|
//! | `options` | settings, as values |
//! | `motion` | the measured responses |
//! | `method` | the choice of the method, and its result |
//! | `modal` | the force by the modes of a test |
//! | `rest` | the test of rest at the ends of a record |
//! | `chunks` | the reconstruction of a record that is not in memory |
//! | `shown` | the band in which responses without a displacement show a force |
//! | `unexplained`, `periods`, `kinematics` | warnings about the result |
//! | `tally`, `peak_line` | levels and strongest line of the force |
//! | `summary` | the result: numbers and remarks |

mod chunks;
mod kinematics;
pub(crate) mod method;
mod modal;
mod motion;
pub mod options;
mod peak_line;
mod periods;
mod rest;
mod scatter;
mod shown;
pub mod summary;
mod tally;
mod unexplained;

use std::fmt;
use std::ops::Range;

use mechid_force::{IdentifiedForce, Start};
use mechid_signal::Sampling;
use serde::{Serialize, Serializer};

use self::kinematics::KinematicConsistency;
use self::method::{Found, How, Request};
pub use self::modal::reconstruct_with_modes;
use self::motion::Recorded;
pub use self::options::{Method, ParameterRule, Reconstruct};
use self::summary::{Chosen, ForceRow, ForceSummary};
use self::tally::{Take, Tally};
pub use self::unexplained::Measured;
use crate::machine::Machine;
use crate::measurement::Measurement;
use crate::{AnalysisError, time_limit};

/// Reconstructed force on a machine, with its method.
///
/// [`Display`](fmt::Display) formats the result for a reader, `serde` for programs.
#[derive(Debug)]
pub struct Reconstructed {
    summary: ForceSummary,
    force: IdentifiedForce,
    forced: Vec<usize>,
    lines: Option<Vec<usize>>,
}

/// Consecutive samples of a reconstructed force.
#[derive(Debug)]
pub struct ForceChunk<'a> {
    /// Time axis of the whole force.
    pub sampling: Sampling,
    /// Reconstructed force; only the samples in the range `samples` are new.
    pub force: &'a IdentifiedForce,
    /// Samples of `force` after those of the previous chunk.
    pub samples: Range<usize>,
    /// `true` if the standard error of the force includes the noise of the record.
    pub counts_noise: bool,
}

impl ForceChunk<'_> {
    /// Returns the columns of a table with their names: the force and, if known, its standard
    /// error, in N. If the standard error does not include the noise of the record, it covers only
    /// the uncertainty of the machine, and its name says so.
    pub fn columns(&self) -> Vec<(String, &[f64])> {
        let dofs = self.force.record().channels();
        let name = |base: &str, dof| numbered(base, dof, dofs);
        let record = self.force.record();
        let mut columns: Vec<(String, &[f64])> =
            (0..dofs).map(|dof| (name("force", dof), record.channel(dof))).collect();
        if let Some(error) = self.force.standard_error() {
            let base =
                if self.counts_noise { "standard_error" } else { "standard_error_of_machine" };
            columns.extend((0..dofs).map(|dof| (name(base, dof), error.channel(dof))));
        }
        for (_, column) in &mut columns {
            *column = &column[self.samples.clone()];
        }
        columns
    }
}

/// Returns `base`, or `base_1`, `base_2` … with several degrees of freedom.
pub fn numbered(base: &str, dof: usize, dofs: usize) -> String {
    if dofs == 1 { base.into() } else { format!("{base}_{}", dof + 1) }
}

/// Reconstructs the force on a known machine from its measured response.
///
/// The window is treated as whole periods if the measurement has a period or `lines` are given
/// (periods are averaged), otherwise as an open record. The standard error of the force includes
/// the uncertainty of an identified machine.
///
/// # Errors
/// [`AnalysisError::MotionCount`] or [`AnalysisError::NoMotion`] if the responses do not match the
/// machine, [`AnalysisError::NoiseCount`], [`AnalysisError::Forced`], unmet requirements of the
/// method ([`AnalysisError::ForceMotions`], [`AnalysisError::ForceNeedsPeriods`],
/// [`AnalysisError::KalmanIsOpen`], [`AnalysisError::BandMethod`]), and its numerical failure.
pub fn reconstruct(
    run: &Measurement,
    machine: &Machine,
    how: &Reconstruct,
) -> Result<Reconstructed, AnalysisError> {
    reconstruct_with(run, machine, how, &mut |_| Ok(()))
}

/// Reconstructs a force like [`reconstruct`], and passes the force to `take`.
///
/// # Errors
/// As [`reconstruct`], and the errors of `take`.
pub fn reconstruct_with(
    run: &Measurement,
    machine: &Machine,
    how: &Reconstruct,
    take: &mut Take<'_>,
) -> Result<Reconstructed, AnalysisError> {
    let task = Task::new(run, machine, how)?;
    let (summary, force) = task.find(machine, how, true, take)?;
    let Some(force) = force else { return Err(AnalysisError::NoMotion) };
    let Request { forced, lines, .. } = task.request;
    Ok(Reconstructed { summary, force, forced, lines })
}

/// Reconstructs the force of a record of any length: it passes the force to `take` chunk by chunk,
/// in order, and stores only the samples that the method needs.
///
/// # Errors
/// As [`reconstruct`], and the errors of `take`.
pub fn reconstruct_in_chunks(
    run: &Measurement,
    machine: &Machine,
    how: &Reconstruct,
    take: &mut Take<'_>,
) -> Result<ForceSummary, AnalysisError> {
    Ok(Task::new(run, machine, how)?.find(machine, how, false, take)?.0)
}

impl Reconstructed {
    /// Returns the numbers and remarks.
    pub fn summary(&self) -> &ForceSummary {
        &self.summary
    }

    /// Returns the force with its standard error and its spectrum.
    pub fn force(&self) -> &IdentifiedForce {
        &self.force
    }

    /// Returns the degrees of freedom with a reconstructed force, counted from 0.
    pub fn forced(&self) -> &[usize] {
        &self.forced
    }

    /// Returns the spectral lines of the reconstructed force; `None`: all.
    pub fn lines(&self) -> Option<&[usize]> {
        self.lines.as_deref()
    }
}

impl fmt::Display for Reconstructed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.summary.fmt(f)
    }
}

impl Serialize for Reconstructed {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.summary.serialize(serializer)
    }
}

/// Part of a summary that concerns the system.
struct System<'a> {
    name: &'a str,
    /// Names of the forces, one for each place where they may act.
    forces: Vec<String>,
    /// `true` if the uncertainty of the system is known.
    uncertain: bool,
}

/// A reconstruction before its computation.
struct Task {
    recorded: Recorded,
    request: Request,
}

impl Task {
    fn new(run: &Measurement, machine: &Machine, how: &Reconstruct) -> Result<Self, AnalysisError> {
        let periodic = run.window_settings().period.is_some() || how.lines.is_some();
        let recorded = Recorded::new(run, machine.system().dof(), periodic)?;
        let request = Request::new(how, &recorded, machine.system().dof(), periodic)?;
        Ok(Self { recorded, request })
    }

    /// Reconstructs the force, in chunks if the method allows it and the whole force is not
    /// requested. Returns the force unless it is computed in chunks.
    fn find(
        &self,
        machine: &Machine,
        settings: &Reconstruct,
        all_at_once: bool,
        take: &mut Take<'_>,
    ) -> Result<(ForceSummary, Option<IdentifiedForce>), AnalysisError> {
        let Self { recorded, request } = self;
        let dofs = machine.system().dof();
        let mut tally = Tally::new(recorded.sampling, dofs, request.periodic, take)?;
        let (method, why) = method::choose(request, machine, &recorded.channels)?;
        let mut rates = KinematicConsistency::new(&recorded.channels);
        let (mut how, force) = if !all_at_once && chunks::supports_chunks(method, request, machine)
        {
            chunks::find(request, machine, recorded, method, &mut |chunk, force, kept| {
                rates.push(chunk);
                tally.push(force, kept, !request.noise.is_empty())
            })?;
            (How::from_equation(method, why, request, machine), None)
        } else {
            let mut window = recorded.hold()?;
            if let Some(band_hz) = request.band_hz {
                window.motion = window.motion.in_band(band_hz)?;
            }
            rates.push(&window.motion);
            let Found { force, mut how } = method::find(request, machine, &window.motion)?;
            tally.push_all(&force, how.counts_noise)?;
            how.remarks.extend(periods::remark(recorded, &window));
            periods::add_scatter(how.unexplained.as_mut(), recorded, &window);
            (how, Some(force))
        };
        how.remarks.extend(shown::remark(&recorded.channels, request, &how));
        how.remarks.extend(rates.remarks(recorded.columns()));
        let forces = (0..dofs).map(|dof| machine.names.force_name(dof)).collect();
        let system = System { name: &machine.name, forces, uncertain: !machine.is_exact() };
        Ok((self.summary(&system, settings, &how, &tally), force))
    }

    fn summary(
        &self,
        system: &System<'_>,
        settings: &Reconstruct,
        how: &How,
        tally: &Tally<'_>,
    ) -> ForceSummary {
        let Self { recorded, request } = self;
        let mut remarks = recorded.unit_notes();
        remarks.extend(tally.remark());
        remarks.extend(how.remarks.iter().cloned());
        remarks.extend(time_limit::remark());
        let unexplained = how.unexplained.as_deref();
        let channels = Measured::all(recorded, unexplained);
        let System { name, forces, uncertain } = system;
        remarks.extend(unexplained::remark(&channels, unexplained, request, forces.len()));
        let forces = tally.forces(forces, &request.forced);
        remarks.extend(forces.iter().filter_map(ForceRow::doubt));
        if *uncertain && !how.counts_noise {
            remarks.push(
                "the standard error includes the uncertainty of the machine, not the noise of the record: state this noise with `noise`"
                    .to_owned(),
            );
        }
        if !*uncertain {
            remarks.push(
                "the machine is treated as exactly known: its file has no covariance".to_owned(),
            );
        }
        ForceSummary {
            file: recorded.file().to_owned(),
            machine: (*name).to_owned(),
            method: how.method,
            why: how.why.clone(),
            samples: recorded.sampling.len(),
            periods: request.periodic.then_some(recorded.periods),
            sample_rate_hz: recorded.sampling.rate_hz(),
            machine_uncertainty: *uncertain,
            noise_uncertainty: how.counts_noise,
            chosen: how
                .chosen
                .iter()
                .map(|(name, value, unit)| Chosen { name: name.clone(), value: *value, unit })
                .collect(),
            channels,
            band_hz: how.band_hz,
            forces,
            remarks,
            analysis: settings.clone(),
        }
    }
}

impl Request {
    fn new(
        how: &Reconstruct,
        recorded: &Recorded,
        dofs: usize,
        periodic: bool,
    ) -> Result<Self, AnalysisError> {
        let (levels, columns) = (how.noise.len(), recorded.columns().len());
        if levels > 0 && levels != columns {
            return Err(AnalysisError::NoiseCount { levels, columns });
        }
        if let Some(dof) = how.forced.iter().copied().find(|dof| !(1..=dofs).contains(dof)) {
            return Err(AnalysisError::Forced { dof, dofs });
        }
        let lines = how.lines.as_ref().map(|spec| spec.lines(recorded.sampling));
        Ok(Self {
            method: how.method,
            forced: match how.forced.as_slice() {
                [] => (0..dofs).collect(),
                some => some.iter().map(|dof| dof - 1).collect(),
            },
            lines: lines.transpose()?,
            band_hz: how.band_hz.map(|band| [band.low_hz, band.high_hz]),
            periodic,
            start: if how.at_rest { Start::FromRest } else { Start::InMotion },
            rule: how.rule.rule(),
            noise: recorded.levels(&how.noise),
            averaged: recorded.periods,
        })
    }
}
