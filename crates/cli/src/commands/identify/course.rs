//! What the machine found does under a measured force.

use mechid::estimate::frequency_domain::Motion;
use mechid::estimate::time_domain::{Discretisation, Extent};
use mechid::estimate::{fitted_start, predict, predict_periodic};
use mechid::model::{Response, SecondOrderSystem};
use mechid::signal::Record;

use super::measurement::Measurement;
use crate::error::CliError;

/// How a record is predicted, in keeping with how the machine was found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Course {
    /// In the steady state under whole periods of a band-limited force, means apart.
    Steady,
    /// From sample to sample.
    Sampled { discretisation: Discretisation, extent: Extent },
}

/// One kind of motion, measured and predicted.
#[derive(Debug)]
pub struct Compared {
    pub kind: Motion,
    pub measured: Record,
    pub predicted: Record,
}

impl Course {
    /// Every motion measured beside the one predicted. An open record starts where its motion is met
    /// best.
    pub fn predict(
        self,
        system: &SecondOrderSystem,
        measured: &Measurement,
    ) -> Result<Vec<Compared>, CliError> {
        let force = &measured.force;
        let rest = mechid::model::InitialState::rest(system.dof());
        let motions = measured.motions();
        let response = match self {
            Course::Steady => predict_periodic(system, force)?,
            Course::Sampled { discretisation, extent: Extent::Open } => {
                let start = fitted_start(system, force, discretisation, &motions)?;
                predict(system, force, discretisation, Extent::Open, &start)?
            }
            Course::Sampled { discretisation, extent } => {
                predict(system, force, discretisation, extent, &rest)?
            }
        };
        let compared = |(kind, record): (Motion, &Record)| {
            let (measured, predicted) = (record.clone(), channels(&response, kind).clone());
            match self {
                // Transducers have offsets, and a spectrum's mean was not fitted.
                Course::Steady => Compared {
                    kind,
                    measured: measured.without_mean(),
                    predicted: predicted.without_mean(),
                },
                Course::Sampled { .. } => Compared { kind, measured, predicted },
            }
        };
        Ok(motions.into_iter().map(compared).collect())
    }
}

fn channels(response: &Response, kind: Motion) -> &Record {
    match kind {
        Motion::Displacement => response.displacement(),
        Motion::Velocity => response.velocity(),
        Motion::Acceleration => response.acceleration(),
    }
}
