//! What the identified machine leaves of the measured motion.

use mechid::estimate::checks::{Correlation, cross_correlation, whiteness};
use mechid::estimate::frequency_domain::Motion;
use mechid::estimate::predict;
use mechid::estimate::time_domain::{Discretisation, Extent};
use mechid::model::{InitialState, ModelError, SecondOrderSystem};
use mechid::signal::{Record, Spectrum, measures};
use nalgebra::DMatrix;

use crate::commands::identify::Identified;
use crate::commands::identify::fit::BetweenSamples;
use crate::commands::identify::measurement::Measurement;
use crate::error::CliError;

/// Lags at which correlations are looked at, where the record is long enough.
const LAGS: usize = 25;

/// Below this share of the motion a residual is rounding, not noise.
const ROUNDING: f64 = 1e-10;

/// Measured and modelled motion over the window, without their means in the frequency domain.
pub struct Residual {
    pub kind: Motion,
    pub measured: Record,
    pub modelled: Record,
    pub residual: Record,
    pub channels: Vec<ChannelResidual>,
}

/// The residual of one motion.
pub struct ChannelResidual {
    /// RMS of the residual over RMS of the motion.
    pub share: f64,
    pub whiteness: Correlation,
    /// With each force that acts, by its degree of freedom counted from 0.
    pub forces: Vec<(usize, Correlation)>,
}

impl ChannelResidual {
    /// Whether there is nothing left but rounding.
    pub fn is_rounding(&self) -> bool {
        self.share < ROUNDING
    }
}

impl Residual {
    /// The motion under the measured force, taken from the measured motion.
    ///
    /// # Errors
    /// If the machine has no such motion, or the window is too short to judge.
    pub fn of(found: &Identified, between: Option<BetweenSamples>) -> Result<Self, CliError> {
        let (motion, kind) = found.measured.motion();
        let system = found.fitted.estimate.system()?;
        let (measured, modelled) = match found.fitted.frequency {
            Some(_) => (motion.without_mean(), steady(&found.measured, &system, kind)?),
            None => (motion.clone(), simulated(&found.measured, &system, between)?),
        };
        let residual = Record::new(measured.sampling(), measured.data() - modelled.data())?;
        let channels = (0..residual.channels())
            .map(|c| channel(&found.measured, &measured, &residual, c))
            .collect::<Result<_, _>>()?;
        Ok(Self { kind, measured, modelled, residual, channels })
    }
}

/// The periodic motion under the mean period of the force, without its mean.
fn steady(
    measured: &Measurement,
    system: &SecondOrderSystem,
    kind: Motion,
) -> Result<Record, CliError> {
    let force = Spectrum::of(&measured.force.period_mean(measured.period)?);
    let mut lines = DMatrix::zeros(force.len(), force.channels());
    for n in 1..force.len() {
        let omega = force.omega(n);
        let loads = force.lines().row(n).transpose();
        let motion = system.receptance(omega)? * loads * kind.per_displacement(omega);
        if motion.iter().any(|z| !z.is_finite()) {
            let reciprocal_condition = 0.0;
            return Err(ModelError::SingularDynamicStiffness { omega, reciprocal_condition }.into());
        }
        lines.set_row(n, &motion.transpose());
    }
    let period = Spectrum::from_lines(force.sampling(), lines).to_record();
    Ok(period.repeated(measured.periods)?)
}

/// The displacement from the measured first state on.
fn simulated(
    measured: &Measurement,
    system: &SecondOrderSystem,
    between: Option<BetweenSamples>,
) -> Result<Record, CliError> {
    let (Some(x), Some(v)) = (&measured.displacement, &measured.velocity) else {
        return Err(CliError::TimeDomainMotions);
    };
    let first = |record: &Record| record.data().row(0).transpose();
    let start = InitialState::new(first(x), first(v))?;
    let between = between.map_or(Discretisation::FirstOrderHold, BetweenSamples::discretisation);
    let response = predict(system, &measured.force, between, Extent::Open, &start)?;
    Ok(response.displacement().clone())
}

fn channel(
    source: &Measurement,
    measured: &Record,
    residual: &Record,
    channel: usize,
) -> Result<ChannelResidual, CliError> {
    let own = residual.channel(channel);
    let level = measures::rms(measured.channel(channel));
    let lags = LAGS.min(own.len() / 4).max(1);
    let acting = (0..source.force.channels()).filter(|c| source.force.column(*c).amax() > 0.0);
    Ok(ChannelResidual {
        share: if level > 0.0 { measures::rms(own) / level } else { 0.0 },
        whiteness: whiteness(own, lags)?,
        forces: acting
            .map(|c| Ok((c, cross_correlation(own, source.force.channel(c), lags)?)))
            .collect::<Result<_, CliError>>()?,
    })
}
