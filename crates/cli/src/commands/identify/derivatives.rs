//! Velocity and acceleration where only one of displacement and acceleration was measured.

use std::ops::Range;
use std::str::FromStr;

use mechid::estimate::derivatives::{
    SavitzkyGolay, spectral_from_acceleration, spectral_from_displacement,
};
use mechid::model::Response;
use mechid::signal::Record;

use super::measurement::{Measurement, joined};
use crate::error::CliError;

/// How the motions that were not measured are found.
#[derive(Debug, Clone, PartialEq)]
pub enum Derivatives {
    /// By the spectrum of whole periods.
    Spectral,
    /// By a sliding polynomial.
    SavitzkyGolay(SavitzkyGolay),
}

impl FromStr for Derivatives {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == "spectral" {
            return Ok(Self::Spectral);
        }
        let numbers: Option<Vec<usize>> = text
            .strip_prefix("savitzky-golay:")
            .and_then(|rest| rest.split(':').map(|n| n.parse().ok()).collect());
        let Some([window, order]) = numbers.as_deref() else {
            return Err("write spectral or savitzky-golay:WINDOW:ORDER, such as \
                        savitzky-golay:11:4"
                .into());
        };
        if window % 2 == 0 {
            return Err(format!("the window has a middle: an odd number of samples, not {window}"));
        }
        if *order < 2 {
            return Err(format!(
                "two derivatives need a polynomial of order 2 or more, not {order}"
            ));
        }
        let filter = SavitzkyGolay::new(window / 2, *order).map_err(|e| e.to_string())?;
        Ok(Self::SavitzkyGolay(filter))
    }
}

/// What a fit sample by sample takes.
#[derive(Debug)]
pub struct Prepared {
    pub displacement: Record,
    pub velocity: Record,
    pub acceleration: Option<Record>,
    pub force: Record,
    /// All of these are second derivatives of what they are called.
    pub twice_differentiated: bool,
}

impl Prepared {
    fn new(response: Response, force: Record) -> Self {
        Self {
            displacement: response.displacement().clone(),
            velocity: response.velocity().clone(),
            acceleration: Some(response.acceleration().clone()),
            force,
            twice_differentiated: false,
        }
    }

    /// What was measured, completed if that was asked for.
    ///
    /// # Errors
    /// [`CliError::TimeDomainMotions`] if something is missing, [`CliError::NothingToDerive`] if
    /// nothing is.
    pub fn of(measured: &Measurement, derivatives: Option<&Derivatives>) -> Result<Self, CliError> {
        let force = &measured.force;
        let motions = (&measured.displacement, &measured.velocity, &measured.acceleration);
        match (motions, derivatives) {
            ((Some(x), Some(v), a), None) => Ok(Self {
                displacement: x.clone(),
                velocity: v.clone(),
                acceleration: a.clone(),
                force: force.clone(),
                twice_differentiated: false,
            }),
            (_, None) => Err(CliError::TimeDomainMotions),
            ((Some(x), None, None), Some(Derivatives::Spectral)) => {
                Ok(Self::new(spectral_from_displacement(x)?, force.clone()))
            }
            ((None, None, Some(a)), Some(Derivatives::Spectral)) => {
                Ok(Self::new(spectral_from_acceleration(a)?, force.without_mean()))
            }
            ((Some(x), None, None), Some(Derivatives::SavitzkyGolay(filter))) => {
                Ok(Self::new(filter.motion(x)?, force.clone()))
            }
            ((None, None, Some(a)), Some(Derivatives::SavitzkyGolay(filter))) => {
                let (response, force) = filter.twice_differentiated(a, force)?;
                Ok(Self { twice_differentiated: true, ..Self::new(response, force) })
            }
            _ => Err(CliError::NothingToDerive),
        }
    }

    /// Some of the samples, counted from 0.
    pub fn window(self, samples: Range<usize>) -> Result<Self, CliError> {
        if samples == (0..self.force.len()) {
            return Ok(self);
        }
        let cut = |record: &Record| record.window(samples.start, samples.len());
        Ok(Self {
            displacement: cut(&self.displacement)?,
            velocity: cut(&self.velocity)?,
            acceleration: self.acceleration.as_ref().map(cut).transpose()?,
            force: cut(&self.force)?,
            ..self
        })
    }

    /// These samples and after them the first of others.
    pub fn followed_by(&self, others: &Self) -> Result<Self, CliError> {
        let join = |own: &Record, other: &Record| joined(own, &other.window(0, 1)?);
        let pair = self.acceleration.as_ref().zip(others.acceleration.as_ref());
        Ok(Self {
            displacement: join(&self.displacement, &others.displacement)?,
            velocity: join(&self.velocity, &others.velocity)?,
            acceleration: pair.map(|(own, other)| join(own, other)).transpose()?,
            force: join(&self.force, &others.force)?,
            ..*self
        })
    }

    /// Displacement, velocity and acceleration together, if there is an acceleration.
    pub fn response(&self) -> Result<Option<Response>, CliError> {
        let Some(a) = &self.acceleration else { return Ok(None) };
        Ok(Some(Response::new(self.displacement.clone(), self.velocity.clone(), a.clone())?))
    }

    /// Displacement, velocity and force.
    pub fn states(&self) -> [&Record; 3] {
        [&self.displacement, &self.velocity, &self.force]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ways_to_differentiate_are_written_out() {
        let filter = SavitzkyGolay::new(5, 4).unwrap();
        assert_eq!("spectral".parse(), Ok(Derivatives::Spectral));
        assert_eq!("savitzky-golay:11:4".parse(), Ok(Derivatives::SavitzkyGolay(filter)));
        for text in [
            "",
            "savitzky-golay",
            "savitzky-golay:11",
            "savitzky-golay:10:4",
            "euler:3:2",
            "savitzky-golay:11:4:1",
            "savitzky-golay:11:1",
            "savitzky-golay:3:4",
            "savitzky-golay:1:2",
        ] {
            assert!(text.parse::<Derivatives>().is_err(), "{text}");
        }
    }
}
