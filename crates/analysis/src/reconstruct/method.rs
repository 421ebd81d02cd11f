//! Reconstruction methods, their selection and their results.

use std::f64::consts::TAU;

use mechid_force::{
    Channel, Filter, ForceError, ForceUnknowns, IdentifiedForce, Measurement, MotionNoise, Noise,
    Rule, Start, Tuning, Unexplained, continuous, continuous_nonlinear,
    continuous_nonlinear_with_noise, continuous_with_noise, discretised, discretised_with_noise,
    frequency_domain, inner_lines, kalman, regularised, starts_at_rest,
    with_uncertain_nonlinear_system, with_uncertain_system,
};
use mechid_model::{
    Discretisation, Response, ResponseQuantity, SecondOrderSystem, UncertainSystem,
};
use mechid_signal::{Extent, Record, Spectrum};

use super::motion::{complete, response};
use super::options::Method;
use crate::AnalysisError;
use crate::limits::INNOVATION_LEVEL;
use crate::machine::{Machine, NonlinearPart};
use crate::text::significant;

/// Settings of a reconstruction, resolved for a record.
pub struct Request {
    pub method: Method,
    /// Degrees of freedom with an unknown force, counted from 0.
    pub forced: Vec<usize>,
    pub lines: Option<Vec<usize>>,
    /// Frequency band of the reconstructed force, in Hz.
    pub band_hz: Option<[f64; 2]>,
    pub periodic: bool,
    pub start: Start,
    pub rule: Rule,
    /// Standard deviation of the noise on each measured channel, after averaging over the periods,
    /// in its SI unit; empty if unknown.
    pub noise: Vec<f64>,
    /// Number of averaged periods.
    pub averaged: usize,
}

/// A reconstructed force with its method.
pub struct Found {
    pub force: IdentifiedForce,
    pub how: How,
}

/// Method of a reconstruction and its chosen parameters.
pub struct How {
    pub method: &'static str,
    /// Reason for this method.
    pub why: String,
    /// `true` if the standard error includes the noise of the record.
    pub counts_noise: bool,
    /// Chosen parameters, with their units.
    pub chosen: Vec<(String, f64, &'static str)>,
    /// Unexplained part of each measured channel; `None` without surplus channels.
    pub unexplained: Option<Vec<Unexplained>>,
    /// Frequency, in Hz, below which the noise exceeds the response to the force; `None` if the
    /// method cannot decide, or if noise prevails at all frequencies.
    pub seen_from_hz: Option<f64>,
    /// Frequency band, in Hz, in which force and standard error are valid; `None`: all.
    pub band_hz: Option<[f64; 2]>,
    /// Remarks to read before using the numbers.
    pub remarks: Vec<String>,
}

/// Returns the method for a record with these channels, and the reason for it.
///
/// # Errors
/// [`AnalysisError::NonlinearMachine`] if the machine is nonlinear and the response is incomplete,
/// or if the requested method is not the equation of motion.
pub fn choose(
    request: &Request,
    machine: &Machine,
    channels: &[Channel],
) -> Result<(Method, String), AnalysisError> {
    let dofs = machine.system().dof();
    if machine.nonlinear.is_some() {
        let asked = matches!(request.method, Method::Auto | Method::Continuous);
        if !asked || !complete(channels, dofs, true) || request.forced.len() != dofs {
            return Err(machine.not_linear());
        }
        return Ok((Method::Continuous, "the machine has nonlinear terms".into()));
    }
    if request.method != Method::Auto {
        return Ok((request.method, "it was requested".into()));
    }
    let (method, why) = if request.periodic && request.lines.is_some() {
        (Method::FrequencyDomain, "whole periods, and the lines with force are given".into())
    } else if complete(channels, dofs, true) && request.forced.len() == dofs {
        (
            Method::Continuous,
            "displacement, velocity and acceleration of every degree of freedom are given".into(),
        )
    } else if request.periodic {
        (
            Method::Shrinkage,
            "the record has whole periods, but the lines with force are not given".into(),
        )
    } else {
        (Method::Kalman, "an open record".into())
    };
    Ok((method, why))
}

/// Reconstructs the force; a known uncertainty of the machine is propagated.
pub fn find(
    request: &Request,
    machine: &Machine,
    motion: &Measurement,
) -> Result<Found, AnalysisError> {
    let (method, why) = choose(request, machine, motion.channels())?;
    let known = &machine.uncertain;
    match method {
        Method::Continuous | Method::Discretised => {
            let force = equation(request, machine, motion, method)?;
            Ok(Found { force, how: How::from_equation(method, why, request, machine) })
        }
        Method::FrequencyDomain => lines(request, known, motion, why),
        Method::Kalman => smoothed(request, known, motion, why),
        Method::Auto | Method::Shrinkage => {
            filtered(request, known, motion, Filter::Shrinkage, why)
        }
        Method::Tikhonov => filtered(request, known, motion, Filter::Tikhonov(request.rule), why),
        Method::TruncatedSvd => {
            filtered(request, known, motion, Filter::TruncatedSvd(request.rule), why)
        }
    }
}

type Finder<'a> = dyn Fn(&SecondOrderSystem) -> Result<IdentifiedForce, ForceError> + 'a;

fn with_machine(
    machine: &UncertainSystem,
    find: &Finder<'_>,
) -> Result<IdentifiedForce, AnalysisError> {
    Ok(if machine.parameters().is_empty() {
        find(machine.system())?
    } else {
        with_uncertain_system(machine, find)?
    })
}

fn noise(request: &Request, unknown: Noise) -> Noise {
    if request.noise.is_empty() { unknown } else { Noise::PerChannel(request.noise.clone()) }
}

/// Reconstructs the force by the equation of motion, at each sample or from each sample to the
/// next.
pub fn equation(
    request: &Request,
    machine: &Machine,
    motion: &Measurement,
    method: Method,
) -> Result<IdentifiedForce, AnalysisError> {
    let with_acceleration = method == Method::Continuous;
    let response = response(motion, machine.system().dof(), with_acceleration)
        .ok_or(AnalysisError::ForceMotions { with_acceleration })?;
    let ends = if request.periodic { Extent::WholePeriod } else { Extent::Open };
    let linear = Discretisation::FirstOrderHold;
    let noise = motion_noise(request, motion, machine.system().dof())?;
    let in_band = |force: IdentifiedForce| match request.band_hz {
        Some(band_hz) => force.white_in_band(band_hz, ends),
        None => Ok(force),
    };
    if let (false, Some([low_hz, high_hz])) = (with_acceleration, request.band_hz) {
        return Err(AnalysisError::BandMethod { low_hz, high_hz });
    }
    if let Some(part) = &machine.nonlinear {
        return with_terms(part, &response, noise.as_ref(), &in_band);
    }
    with_machine(&machine.uncertain, &|system| match (with_acceleration, &noise) {
        (true, None) => continuous(system, &response).and_then(in_band),
        (true, Some(noise)) => continuous_with_noise(system, &response, noise).and_then(in_band),
        (false, None) => discretised(system, &response, linear, ends),
        (false, Some(noise)) => discretised_with_noise(system, &response, linear, ends, noise),
    })
}

/// Reconstructs the force of a machine with nonlinear terms, from the response corrected for the
/// phase of its channels.
fn with_terms(
    part: &NonlinearPart,
    response: &Response,
    noise: Option<&MotionNoise>,
    kept: &dyn Fn(IdentifiedForce) -> Result<IdentifiedForce, ForceError>,
) -> Result<IdentifiedForce, AnalysisError> {
    let before = |record: &Record| -> Result<Record, AnalysisError> {
        Ok(part.channels.correct(record, record)?.1)
    };
    let response = Response::new(
        before(response.displacement())?,
        before(response.velocity())?,
        before(response.acceleration())?,
    )?;
    Ok(with_uncertain_nonlinear_system(&part.uncertain, |system| match noise {
        None => continuous_nonlinear(system, &response).and_then(kept),
        Some(noise) => continuous_nonlinear_with_noise(system, &response, noise).and_then(kept),
    })?)
}

/// Returns the stated noise levels of the channels, sorted by displacement, velocity and
/// acceleration; `None` if no noise is stated.
fn motion_noise(
    request: &Request,
    motion: &Measurement,
    dofs: usize,
) -> Result<Option<MotionNoise>, AnalysisError> {
    let (channels, levels) = (motion.channels(), &request.noise);
    if levels.is_empty() {
        return Ok(None);
    }
    let noise_of = |quantity: ResponseQuantity| -> Vec<f64> {
        let find = |dof| channels.iter().position(|c| *c == Channel { dof, quantity });
        (0..dofs).filter_map(find).map(|at| levels[at]).collect()
    };
    let [x, v, a] = [
        ResponseQuantity::Displacement,
        ResponseQuantity::Velocity,
        ResponseQuantity::Acceleration,
    ]
    .map(noise_of);
    Ok(Some(MotionNoise::new(x, v, a)?))
}

impl How {
    /// Describes the reconstruction by the equation of motion, [`equation`].
    pub fn from_equation(
        method: Method,
        why: String,
        request: &Request,
        machine: &Machine,
    ) -> Self {
        let method = if machine.nonlinear.is_some() {
            "equation of motion with nonlinear terms, sample by sample"
        } else if method == Method::Continuous {
            "equation of motion, sample by sample"
        } else {
            "equation of motion from sample to sample, with a force linear between samples"
        };
        Self {
            method,
            why,
            counts_noise: !request.noise.is_empty(),
            chosen: Vec::new(),
            unexplained: None,
            seen_from_hz: None,
            band_hz: request.band_hz,
            remarks: Vec::new(),
        }
    }
}

fn lines(
    request: &Request,
    machine: &UncertainSystem,
    motion: &Measurement,
    why: String,
) -> Result<Found, AnalysisError> {
    if !request.periodic {
        return Err(AnalysisError::ForceNeedsPeriods);
    }
    let lines = request.lines.clone().unwrap_or_else(|| inner_lines(motion));
    let noise = noise(request, outside(request, motion));
    let find = |system: &SecondOrderSystem| {
        frequency_domain(system, motion, &request.forced, &lines, &noise)
    };
    let force = with_machine(machine, &find)?;
    let chosen = vec![("lines used".into(), lines.len() as f64, "")];
    let counts_noise = noise != Noise::Unknown;
    let unexplained = force.unexplained().map(<[_]>::to_vec);
    let method = "dynamic stiffness, line by line";
    let remarks = little_power_remark(motion, request).into_iter().collect();
    let (seen_from_hz, band_hz) = (None, force.band_hz());
    Ok(Found {
        force,
        how: How { method, why, counts_noise, chosen, unexplained, seen_from_hz, band_hz, remarks },
    })
}

/// Returns the source of a noise level that is not stated: the lines without force if there are
/// enough of them, otherwise an unknown source. Lines outside a band do not count as lines without
/// force, because forces that are not reconstructed may act there.
fn outside(request: &Request, motion: &Measurement) -> Noise {
    let given = request.lines.as_ref().filter(|_| request.periodic);
    let needed = mechid_force::MIN_OUTSIDE_LINES;
    if given.is_some_and(|lines| inner_lines(motion).len() >= lines.len() + needed) {
        Noise::OutsideLines
    } else {
        Noise::Unknown
    }
}

fn filtered(
    request: &Request,
    machine: &UncertainSystem,
    motion: &Measurement,
    filter: Filter,
    why: String,
) -> Result<Found, AnalysisError> {
    let forced = &request.forced;
    let extent = match (&request.lines, request.periodic) {
        (Some(lines), true) => ForceUnknowns::Lines(lines.clone()),
        (None, true) => ForceUnknowns::EveryLine,
        (_, false) => ForceUnknowns::Samples(request.start),
    };
    let noise = noise(request, outside(request, motion));
    let regular = regularised(machine.system(), motion, forced, &extent, filter, &noise)?;
    // The perturbed machines use the same regularisation parameter.
    let fixed = match (filter, regular.parameter) {
        (Filter::Tikhonov(_), Some(lambda)) => Filter::Tikhonov(Rule::Given(lambda)),
        (Filter::TruncatedSvd(_), Some(lambda)) => Filter::TruncatedSvd(Rule::Given(lambda)),
        _ => filter,
    };
    let banded = in_band_of(motion, &regular.force)?;
    let find = |system: &SecondOrderSystem| {
        if system == machine.system() {
            return Ok(regular.force.clone());
        }
        regularised(system, &banded, forced, &extent, fixed, &noise).map(|r| r.force)
    };
    let force = with_machine(machine, &find)?;
    let mut chosen = Vec::new();
    if let Some(lambda) = regular.parameter {
        chosen.push(("parameter λ".into(), lambda, "scaled channel/N"));
    }
    chosen.push(("effective number of unknowns".into(), regular.unknowns, ""));
    chosen.extend(noise_levels(motion, &regular.noise_std, request.averaged));
    let unexplained = force.unexplained().map(<[_]>::to_vec);
    let method = match filter {
        Filter::Tikhonov(_) => "Tikhonov regularisation",
        Filter::TruncatedSvd(_) => "truncated singular value decomposition",
        _ => "mean of the force given the measurement (shrinkage)",
    };
    let remarks = little_power_remark(motion, request).into_iter().collect();
    let (seen_from_hz, band_hz, counts_noise) = (regular.seen_from_hz, force.band_hz(), true);
    Ok(Found {
        force,
        how: How { method, why, counts_noise, chosen, unexplained, seen_from_hz, band_hz, remarks },
    })
}

/// Returns the measurement restricted to the band of the reconstructed force, so that a
/// reconstruction with a perturbed machine has the same band.
fn in_band_of(motion: &Measurement, force: &IdentifiedForce) -> Result<Measurement, AnalysisError> {
    Ok(match force.band_hz() {
        Some(band_hz) => motion.clone().in_band(band_hz)?,
        None => motion.clone(),
    })
}

/// Minimum share of the power of a response that must be on the given lines; below it, a remark is
/// made.
const MIN_SHARE_ON_LINES: f64 = 0.5;

/// Returns a remark about the channel with the smallest share of its power on the given lines, if
/// the share is small: the lines may refer to a period other than the window's.
fn little_power_remark(motion: &Measurement, request: &Request) -> Option<String> {
    let lines = request.lines.as_deref().filter(|_| request.periodic)?;
    let spectrum = Spectrum::from_record(motion.record());
    let power = |lines: &mut dyn Iterator<Item = usize>, channel: usize| -> f64 {
        lines.map(|n| spectrum.line(n, channel).norm_sqr()).sum()
    };
    let shares = (0..motion.channels().len()).map(|channel| {
        let total = power(&mut (1..spectrum.len()), channel);
        let on_lines = power(&mut lines.iter().copied(), channel);
        (channel, if total > 0.0 { on_lines / total } else { 1.0 })
    });
    let (channel, share) =
        shares.min_by(|a, b| a.1.total_cmp(&b.1)).filter(|c| c.1 < MIN_SHARE_ON_LINES)?;
    let (samples, step) = (motion.sampling().len(), motion.sampling().omega0() / TAU);
    Some(format!(
        "the given lines contain only {} % of the power of channel {} (without its mean); no force is computed on other lines. A line number is the number of cycles in {samples} samples, so the line spacing is {} Hz",
        significant(100.0 * share, 3),
        channel + 1,
        significant(step, 5)
    ))
}

/// Returns the noise of every measured channel, in its unit, from the noise of the mean of periods.
fn noise_levels<'a>(
    motion: &'a Measurement,
    noise: &'a [f64],
    averaged: usize,
) -> impl Iterator<Item = (String, f64, &'static str)> + 'a {
    let levels = (1..).zip(motion.channels().iter().zip(noise));
    levels.map(move |(number, (channel, level))| {
        let unit = match channel.quantity {
            ResponseQuantity::Displacement => "m",
            ResponseQuantity::Velocity => "m/s",
            ResponseQuantity::Acceleration => "m/s²",
        };
        (format!("noise of channel {number}"), level * (averaged as f64).sqrt(), unit)
    })
}

fn smoothed(
    request: &Request,
    machine: &UncertainSystem,
    motion: &Measurement,
    why: String,
) -> Result<Found, AnalysisError> {
    if request.periodic {
        return Err(AnalysisError::KalmanIsOpen);
    }
    let forced = &request.forced;
    let tuning = match request.noise.as_slice() {
        [] => Tuning::Likelihood,
        level => Tuning::NoiseKnown(level.to_vec()),
    };
    let noise_std = Some(&request.noise[..]).filter(|noise| !noise.is_empty());
    let is_at_rest = request.start == Start::InMotion
        && starts_at_rest(machine.system(), motion, forced, noise_std).unwrap_or(false);
    let (start, why) = if is_at_rest {
        (Start::FromRest, format!("{why}; the record begins at rest"))
    } else {
        (request.start, why)
    };
    let smoothed = kalman(machine.system(), motion, forced, start, &tuning)?;
    let fixed =
        Tuning::Given { noise_std: smoothed.noise_std.clone(), model: smoothed.model.clone() };
    let banded = in_band_of(motion, &smoothed.force)?;
    let find = |system: &SecondOrderSystem| {
        if system == machine.system() {
            return Ok(smoothed.force.clone());
        }
        kalman(system, &banded, forced, start, &fixed).map(|smoothed| smoothed.force)
    };
    let force = with_machine(machine, &find)?;
    let mut chosen = vec![
        ("order of the force model".into(), smoothed.model.order as f64, ""),
        ("corner of the force model".into(), smoothed.model.corner_hz, "Hz"),
    ];
    for (dof, rms) in forced.iter().zip(&smoothed.model.rms) {
        chosen.push((format!("RMS value of force {} in the model", dof + 1), *rms, "N"));
    }
    chosen.extend(noise_levels(motion, &smoothed.noise_std, 1));
    let mut unexplained = force.unexplained().map(<[_]>::to_vec);
    if request.noise.is_empty() {
        // The noise level comes from the fit and includes the unexplained part of the response.
        unexplained.iter_mut().flatten().for_each(|channel| channel.noise = None);
    }
    let method = "augmented Kalman filter and smoother, tuned by likelihood";
    let (seen_from_hz, band_hz, counts_noise) = (smoothed.seen_from_hz, force.band_hz(), true);
    let remarks = smoothed.whiteness_p_value.and_then(correlated_errors).into_iter().collect();
    Ok(Found {
        force,
        how: How { method, why, counts_noise, chosen, unexplained, seen_from_hz, band_hz, remarks },
    })
}

/// Returns a remark if the prediction errors of the force model are significantly correlated from
/// sample to sample.
fn correlated_errors(p_value: f64) -> Option<String> {
    (p_value < INNOVATION_LEVEL).then(|| {
        format!(
            "the prediction errors of the force model are correlated (p = {p_value:.1e}): the force model, \
             one band from 0 Hz to a corner frequency, does not describe the spectrum of the force, for \
             example because a weaker force acts in addition to a sinusoid, or the machine differs from \
             the given model. The standard error of the force is \
             not reliable: reconstruct the forces in separate bands (`band_hz`), or state the noise \
             (`noise`)"
        )
    })
}
