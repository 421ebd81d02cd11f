//! Alternative model that explains the residual of a fit.

use std::fmt::{self, Formatter};

use mechid_model::{Discretisation, ResponseQuantity};
use nalgebra::{Complex, DMatrix};

use super::digits::three_digits;
use super::finding::{Channel, Check, Names};
use super::limits::{DELAY_REMAINING, SIGNIFICANCE, WINDOW_REACH};
use super::line_correlation::correlation_of_lines;
use super::{Subject, Verdict};

/// Alternative model that explains the residual of the fit.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Alternative {
    /// Difference from the fitted model.
    #[cfg_attr(feature = "serde", serde(flatten))]
    pub cause: Cause,
    /// Fraction of the residual power that remains with the alternative model.
    pub remaining: f64,
}

/// Difference of an alternative model from the fitted model.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize),
    serde(tag = "cause", rename_all = "snake_case")
)]
#[non_exhaustive]
pub enum Cause {
    /// Delay between force and response.
    Delay {
        /// Delay, in s; negative if the response is early.
        seconds: f64,
    },
    /// Damping forces in phase with the velocity that do not grow with the frequency.
    StructuralDamping {
        /// Loss factor, a ratio.
        loss_factor: f64,
    },
    /// Responses of another quantity than stated.
    Quantity {
        /// Quantity that fits the responses.
        quantity: ResponseQuantity,
        /// Quantity that is stated for the responses.
        stated: ResponseQuantity,
    },
    /// Responses in records of another quantity than stated.
    RecordedQuantity {
        /// Quantity that fits the responses.
        quantity: ResponseQuantity,
        /// Quantity that is stated for the responses.
        stated: ResponseQuantity,
    },
    /// Magnitudes that are levels in dB.
    Decibels,
    /// Force that is held or linear between its samples.
    BetweenSamples {
        /// Behaviour of the force between its samples: held or linear.
        between_samples: Discretisation,
    },
    /// Channels with a first-order high-pass.
    AcCoupling {
        /// Affected channels.
        channels: Vec<Channel>,
        /// Corner frequency, in Hz.
        corner_hz: f64,
    },
}

impl Check for Alternative {
    fn subject(&self) -> Subject {
        match self.cause {
            Cause::Delay { .. } => Subject::Delay,
            _ => Subject::Alternative,
        }
    }

    fn verdict(&self) -> Verdict {
        Verdict::Bad
    }

    fn value(&self) -> f64 {
        self.remaining
    }

    fn sentence(&self, names: &Names<'_>, f: &mut Formatter<'_>) -> fmt::Result {
        match &self.cause {
            Cause::Delay { seconds } => {
                let direction = if *seconds > 0.0 { "late" } else { "early" };
                write!(f, "the response is {:.3e} s {direction}", seconds.abs())?;
            }
            Cause::StructuralDamping { loss_factor } => write!(
                f,
                "structural damping with a loss factor of {} explains the responses: the damping force does not grow \
                 with the frequency",
                three_digits(*loss_factor)
            )?,
            Cause::Quantity { quantity, stated } => {
                write!(f, "the responses are those of {quantity} per force, not of {stated}")?;
            }
            Cause::RecordedQuantity { quantity, stated } => {
                write!(f, "the responses are those of {quantity}, not of {stated}")?;
            }
            Cause::Decibels => f.write_str("the magnitudes are levels in dB")?,
            Cause::BetweenSamples { between_samples: Discretisation::ZeroOrderHold } => {
                f.write_str("the force is held between its samples")?;
            }
            Cause::BetweenSamples { .. } => {
                f.write_str("the force is linear between its samples")?
            }
            Cause::AcCoupling { channels, corner_hz } => {
                let names = channels.iter().map(|channel| names.channel(*channel));
                let corner_hz = three_digits(*corner_hz);
                let names = names.collect::<Vec<_>>().join(", ");
                write!(f, "AC coupling: a first-order high-pass at {corner_hz} Hz in {names}")?;
            }
        }
        let percent = match 100.0 * self.remaining {
            percent if percent < 0.01 => "less than 0.01".into(),
            percent => format!("{percent:.2}"),
        };
        write!(f, "; after this correction {percent} % of the residual power remains. ")?;
        f.write_str(match &self.cause {
            Cause::Delay { .. } => {
                "Possible causes: a filter, a scanning converter, a trigger; correct the phase of the responses"
            }
            Cause::StructuralDamping { .. } => {
                "Viscous damping has the same effect near one resonance: choose a narrow band (`band_hz`)"
            }
            Cause::Quantity { .. } => "State what was measured (`quantity`)",
            Cause::RecordedQuantity { quantity, .. } => match quantity {
                ResponseQuantity::Displacement => "Name their columns as `displacement`",
                ResponseQuantity::Velocity => "Name their columns as `velocity`",
                ResponseQuantity::Acceleration => "Name their columns as `acceleration`",
            },
            Cause::Decibels => "State the unit in the header, as in magnitude [dB]",
            Cause::BetweenSamples { .. } => {
                "This is usual in records of a simulation: state it with `between_samples`"
            }
            Cause::AcCoupling { .. } => {
                "State the coupling with `ac_coupling`, or measure all channels with the same coupling"
            }
        })
    }
}

/// Measured and modelled responses, rows × channels in the unit of the channel.
#[derive(Debug, Clone)]
pub struct ModelledResponses {
    /// Measured responses, rows × channels (unit of the channel).
    pub measured: DMatrix<Complex<f64>>,
    /// Modelled responses, rows × channels (unit of the channel).
    pub modelled: DMatrix<Complex<f64>>,
    /// Logarithm of the Jacobian of a conversion: area of the converted responses in the complex
    /// plane per area of the original responses (pure number); 0 without a conversion.
    pub log_area: f64,
}

impl ModelledResponses {
    /// Returns the power of the residual; each residual is first divided by the standard
    /// `deviation` of its noise, if known. A model whose responses are far too large explains as
    /// much as no model, so the result is at most the power of the measured responses.
    fn power(&self, deviation: Option<&DMatrix<f64>>) -> f64 {
        let residual = weighted(&(&self.measured - &self.modelled), deviation).norm_squared();
        residual.min(weighted(&self.measured, deviation).norm_squared())
    }

    /// Returns the ratio of the residual power to the power of the measured responses.
    fn unexplained(&self, deviation: Option<&DMatrix<f64>>) -> f64 {
        self.power(deviation) / weighted(&self.measured, deviation).norm_squared()
    }

    /// Returns whether the residuals of all channels are uncorrelated from line to line within
    /// every stretch of rising `omega` (rad/s). Each residual is first divided by the standard
    /// `deviation` of its noise (unit of the channel), if known.
    ///
    /// # Source
    /// Pintelon & Schoukens, *System Identification: A Frequency Domain Approach*, the chapter on
    /// model validation.
    pub fn is_white(&self, omega: &[f64], deviation: Option<&DMatrix<f64>>) -> bool {
        let residual = weighted(&(&self.measured - &self.modelled), deviation);
        let first = |row: &usize| *row == 0 || omega[*row] < omega[row - 1];
        let starts: Vec<usize> = (0..omega.len()).filter(first).collect();
        let ends = starts.iter().skip(1).copied().chain([omega.len()]);
        let sweeps: Vec<(usize, usize)> = starts.iter().copied().zip(ends).collect();
        let count = (sweeps.len() * residual.ncols()) as f64;
        residual.column_iter().all(|channel| {
            sweeps.iter().all(|(start, end)| {
                let lines = &channel.as_slice()[*start..*end];
                let correlation = correlation_of_lines(lines, &[], WINDOW_REACH + 1);
                correlation.is_none_or(|c| c.p_value * count > SIGNIFICANCE)
            })
        })
    }
}

fn weighted(z: &DMatrix<Complex<f64>>, deviation: Option<&DMatrix<f64>>) -> DMatrix<Complex<f64>> {
    match deviation {
        Some(deviation) => z.zip_map(deviation, |z, deviation| z / deviation),
        None => z.clone(),
    }
}

/// Returns the index of the model in `others` that explains the responses best, and the fraction of
/// the residual power of `fitted` that remains with this model. `None` unless this model is more
/// likely than `fitted`, and its residual is noise or has less than a quarter of the power. `omega`
/// (rad/s) are the frequencies of the rows, `deviation` is the standard deviation of the noise if
/// known, in the unit of the original responses.
///
/// # Source
/// The likelihood of complex normal noise of unknown level; the limits are ours.
pub fn better_model(
    omega: &[f64],
    deviation: Option<&DMatrix<f64>>,
    fitted: &ModelledResponses,
    others: &[ModelledResponses],
) -> Option<(usize, f64)> {
    // A converted response has another noise level than the original.
    let deviation_of =
        |model: &ModelledResponses| deviation.filter(|_| model.measured == fitted.measured);
    let evidence = |model: &ModelledResponses| {
        let power = |responses: &ModelledResponses| responses.power(deviation_of(model));
        model.log_area + model.measured.len() as f64 * (power(fitted) / power(model)).ln()
    };
    let candidates = others.iter().enumerate().map(|(at, model)| (at, model, evidence(model)));
    let (at, model, evidence) = candidates
        .filter(|candidates| !candidates.2.is_nan())
        .max_by(|a, b| a.2.total_cmp(&b.2))?;
    let noise = deviation_of(model);
    let remaining = model.unexplained(noise) / fitted.unexplained(noise);
    let explains = remaining <= DELAY_REMAINING || model.is_white(omega, noise);
    (evidence > -SIGNIFICANCE.ln() && remaining < 1.0 && explains).then_some((at, remaining))
}
