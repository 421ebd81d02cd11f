//! Maximum likelihood with noise that is estimated from the residual.

use std::borrow::Cow;

use mechid_model::SecondOrderSystem;
use mechid_numerics::NumericsError;
use mechid_numerics::gauss_newton::SumOfSquares;
use mechid_numerics::time_limit;
use mechid_spectra::SpectraError;
use mechid_spectra::noise::level::{ResponseNoise, motion_level};
use mechid_spectra::noise::pulse::PulseErrors;
use mechid_spectra::sinusoids;
use mechid_spectra::sinusoids::Sinusoid;
use mechid_spectra::{FrequencyData, NoiseModel, NoiseSpectrum, Pooling};
use nalgebra::{Complex, DMatrix, DVector};

use super::Whitened;
use super::initial_estimates::InitialEstimates;
use super::misfit::Misfit;
use super::multi_start::{GlobalMinimum, search, thinned};
use super::output_error_fit::{
    OutputErrorFit, Scale, entries, finish, parts, plausible, sampled_weight_inflation, spare,
    uncertain_weights,
};
use super::pulse_fit::PulseFit;
use crate::limits::{
    COLOURED_ROUNDS, MAX_LEVERAGES, MAX_ROUNDS, NOISE_KEPT, NOISE_LEAST, PULSE_ROUNDS,
    PULSE_SETTLED, RESIDUAL_ROUNDING, SINUSOID_ROUNDS, SINUSOID_TOLERANCE, WEIGHT_TOLERANCE,
};
use crate::{EstimateError, Unknowns};

/// A fit, and the noise that gives its weights.
#[derive(Clone)]
pub(super) struct Weighted {
    pub(super) fit: GlobalMinimum,
    pub(super) noise: NoiseSpectrum,
}

/// Estimates the parameters and, in alternation, the noise of each channel of the motion: white
/// noise of unknown level, or noise with a spectrum from the residual. The noise of the forces is
/// as stated. The search begins at a minimum `from` of nearly the same data, or at all initial
/// estimates.
pub(super) fn with_unknown_noise(
    data: &FrequencyData,
    unknowns: &Unknowns,
    nominal: Option<&SecondOrderSystem>,
    from: Option<GlobalMinimum>,
    pooling: Pooling,
) -> Result<OutputErrorFit, EstimateError> {
    if pooling == Pooling::PerLine {
        return Err(SpectraError::TooFewAverages { got: 1, needed: 2 }.into());
    }
    let (white, is_rounding) = with_white_noise(data, unknowns, nominal, from)?;
    let pulses = if is_rounding { None } else { without_pulses(data, unknowns, &white) };
    let (corrected, white, is_rounding) = match &pulses {
        Some(pulses) => (&pulses.data, pulses.white.clone(), pulses.is_rounding),
        None => (data, white, is_rounding),
    };
    let mut with_sinusoids =
        FitWithSinusoids { data: Cow::Borrowed(corrected), sinusoids: Vec::new(), white };
    if !is_rounding {
        with_sinusoids.find(corrected, unknowns, nominal)?;
    }
    let FitWithSinusoids { data: reduced, sinusoids, white } = with_sinusoids;
    let coloured = match pooling {
        Pooling::AllLines => None,
        _ if is_rounding => None,
        _ => {
            let next =
                |before: &Weighted| spectrum_of_residual(&reduced, unknowns, before, pooling);
            reweighted(&reduced, unknowns, &white, next)?
        }
    };
    let sinusoid_unknowns = sinusoids.iter().flatten().map(Sinusoid::unknowns).sum();
    let (weighted, is_white) = coloured.map_or((white, true), |coloured| (coloured, false));
    let Some(WithoutPulses { amplitudes, .. }) = &pulses else {
        let subtracted = Subtracted { sinusoid_unknowns, pulses: None };
        let fit = finished(&reduced, unknowns, (weighted, is_white), subtracted)?;
        return Ok(OutputErrorFit { sinusoids, ..fit });
    };
    // The amplitudes of the pulses are estimated again with the final weights.
    let (searches, steps) = (weighted.fit.searches, weighted.fit.minimum.steps);
    let with_pulses = data.without_sinusoids(&sinusoids);
    let (pulses, data, weighted) = with_pulse_fit(&with_pulses, unknowns, weighted, amplitudes)?
        .ok_or(EstimateError::NotConverged { searches, steps })?;
    let pulse_amplitudes = pulses.amplitudes.clone();
    let subtracted = Subtracted { sinusoid_unknowns, pulses: Some(pulses) };
    let fit = finished(&data, unknowns, (weighted, is_white), subtracted)?;
    Ok(OutputErrorFit { sinusoids, pulse_amplitudes, ..fit })
}

/// Errors of the data, such as sinusoids, that were estimated and subtracted from the data before
/// the last fit.
struct Subtracted {
    /// Number of unknowns of the sinusoids.
    sinusoid_unknowns: usize,
    pulses: Option<PulseFit>,
}

/// Data without the errors of their force pulses, and a fit to them with white noise.
struct WithoutPulses {
    /// Most likely amplitudes of the pulse errors.
    amplitudes: Vec<f64>,
    data: FrequencyData,
    white: Weighted,
    /// `true` if the residual is only rounding.
    is_rounding: bool,
}

/// Alternates between an estimate of the errors of the force pulses and a fit, with white noise, to
/// the data without these errors. The first fit assumes independent errors on all lines. `None` if
/// there are no pulses or too many, or if the first round fails.
fn without_pulses(
    data: &FrequencyData,
    unknowns: &Unknowns,
    white: &Weighted,
) -> Option<WithoutPulses> {
    if !PulseFit::is_possible(data, unknowns) {
        return None;
    }
    let patterns: usize = data.pulse_errors().iter().map(PulseErrors::count).sum();
    let round = |before: &[f64], fit: Weighted| -> Option<WithoutPulses> {
        let (PulseFit { amplitudes, .. }, data, Weighted { fit, .. }) =
            with_pulse_fit(data, unknowns, fit, before).ok()??;
        let (white, is_rounding) = with_white_noise(&data, unknowns, None, Some(fit)).ok()?;
        Some(WithoutPulses { amplitudes, data, white, is_rounding })
    };
    let mut last = round(&vec![0.0; patterns], white.clone())?;
    for _ in 1..PULSE_ROUNDS {
        if last.is_rounding {
            break;
        }
        // If a round fails, the result is that of the round before.
        let Some(next) = round(&last.amplitudes, last.white.clone()) else { break };
        let pairs = next.amplitudes.iter().zip(&last.amplitudes);
        let change = pairs.map(|(next, last)| (next - last).abs()).fold(0.0, f64::max);
        last = next;
        if change <= PULSE_SETTLED {
            break;
        }
    }
    Some(last)
}

/// Estimates the errors of pulses, linearised at the amplitudes `before`, and fits the data without
/// these errors; the noise of the responses does not change. `None` as for [`PulseFit::new`].
fn with_pulse_fit(
    data: &FrequencyData,
    unknowns: &Unknowns,
    Weighted { fit, noise }: Weighted,
    before: &[f64],
) -> Result<Option<(PulseFit, FrequencyData, Weighted)>, EstimateError> {
    let level = fit.minimum.cost / spare(data, unknowns).max(1) as f64;
    let theta = &fit.minimum.parameters;
    let Some(pulses) = PulseFit::new(data, unknowns, theta, (&noise, level), before) else {
        return Ok(None);
    };
    let corrected = data.without_pulse_errors(&pulses.amplitudes)?;
    let noise = noise.with_force_variance(corrected.force_variance());
    let mut misfit = Misfit::new(&corrected, unknowns, &noise)?;
    let fit = fit.followed(&mut misfit)?;
    drop(misfit);
    Ok(Some((pulses, corrected, Weighted { fit, noise })))
}

/// Estimates the parameters from responses whose noise is white, proportional to the response, or
/// the sum of both. Such noise occurs in tables of frequency responses, because averaged responses
/// often have the same coherence on all lines.
pub(super) fn with_response_noise(
    data: &FrequencyData,
    unknowns: &Unknowns,
) -> Result<OutputErrorFit, EstimateError> {
    let (white, is_rounding) = with_white_noise(data, unknowns, None, None)?;
    let next = |before: &Weighted| response_noise(data, unknowns, before);
    let proportional = if is_rounding { None } else { reweighted(data, unknowns, &white, next)? };
    let weighted = proportional.map_or((white, true), |proportional| (proportional, false));
    finished(data, unknowns, weighted, Subtracted { sinusoid_unknowns: 0, pulses: None })
}

/// Chooses the noise of each channel from the residual of a fit; `None` if the noise of all
/// channels is white.
fn response_noise(
    data: &FrequencyData,
    unknowns: &Unknowns,
    before: &Weighted,
) -> Result<Option<NoiseSpectrum>, EstimateError> {
    let mut misfit = Misfit::new(data, unknowns, &before.noise)?;
    misfit.try_at(&before.fit.minimum.parameters).ok_or(NumericsError::Overflow)?;
    misfit.accept();
    let errors = misfit.errors();
    let modelled = data.displacement() - &errors;
    let scale = |row: usize| data.measured().per_displacement(data.omega()[row]).norm_sqr();
    let power = |of: &DMatrix<Complex<f64>>, row: usize, channel: usize| {
        scale(row) * of[(row, channel)].norm_sqr()
    };
    let of_channel = |channel: usize| {
        let pairs = (0..data.len())
            .map(|row| (power(&errors, row, channel), power(&modelled, row, channel)));
        ResponseNoise::choose(&pairs.collect::<Vec<_>>())
    };
    let channels: Vec<ResponseNoise> = (0..data.dof()).map(of_channel).collect();
    if channels.iter().all(|noise| noise.relative == 0.0) {
        return Ok(None);
    }
    let n = data.dof();
    let covariance = (0..data.len()).map(|row| {
        DMatrix::from_fn(2 * n, 2 * n, |i, j| {
            let is_output = i == j && i < n;
            let variance = if is_output {
                channels[i].variance(power(&modelled, row, i)) / scale(row)
            } else {
                0.0
            };
            Complex::from(variance)
        })
    });
    let noise = NoiseSpectrum::new(data.omega().to_vec(), covariance.collect())?;
    let with_white = channels.iter().any(|noise| noise.white > 0.0);
    Ok(Some(noise.with_model(NoiseModel::Proportional { with_white })))
}

/// Returns the result of a fit to `data`; the errors in the last argument have already been
/// subtracted from these data. The flag is `true` if the noise of the fit is white.
fn finished(
    data: &FrequencyData,
    unknowns: &Unknowns,
    (Weighted { fit, noise }, is_white): (Weighted, bool),
    Subtracted { sinusoid_unknowns, pulses }: Subtracted,
) -> Result<OutputErrorFit, EstimateError> {
    let mut misfit = Misfit::new(data, unknowns, &noise)?;
    misfit.try_at(&fit.minimum.parameters).ok_or(NumericsError::Overflow)?;
    misfit.accept();
    let of_pulses = pulses.as_ref().map_or(0.0, |pulses| pulses.determined.round());
    let free = spare(data, unknowns).saturating_sub(sinusoid_unknowns + of_pulses as usize);
    let level = fit.minimum.cost / free.max(1) as f64;
    let inflation = if is_white {
        1.0
    } else {
        sampled_weight_inflation(noise.degrees_of_freedom(), data.dof())?
    };
    let scale = Scale {
        level,
        inflation,
        weights: uncertain_weights(data, unknowns, &fit.minimum.parameters, &noise),
        with_pulses: pulses.map(|pulses| pulses.covariance),
        degrees_of_freedom: free,
        misfit_ratio: 1.0,
        deviance: None,
        noise: if is_white { vec![NoiseModel::White] } else { noise.models().to_vec() },
        spectrum: noise.clone(),
    };
    finish(data, unknowns, &mut misfit, &fit, scale)
}

/// Fit with white noise to open records. The sinusoids that the residual of this fit shows are
/// subtracted from the records.
struct FitWithSinusoids<'a> {
    /// Data without the sinusoids.
    data: Cow<'a, FrequencyData>,
    sinusoids: Vec<Vec<Sinusoid>>,
    white: Weighted,
}

impl<'a> FitWithSinusoids<'a> {
    /// Alternates between an estimate of the sinusoids in the open records of `data` and a fit to
    /// the data without these sinusoids.
    fn find(
        &mut self,
        data: &'a FrequencyData,
        unknowns: &Unknowns,
        nominal: Option<&SecondOrderSystem>,
    ) -> Result<(), EstimateError> {
        for round in 0..SINUSOID_ROUNDS {
            let residual = {
                let mut misfit = Misfit::new(data, unknowns, &self.white.noise)?;
                misfit.try_at(&self.white.fit.minimum.parameters).ok_or(NumericsError::Overflow)?;
                misfit.accept();
                misfit.errors()
            };
            let (independent, _) = parts(data, &self.white.fit.minimum.parameters);
            let [m, c, k] = unknowns.assemble(entries(unknowns, independent).as_slice());
            let system = SecondOrderSystem::new(m, c, k).ok();
            let sinusoids = sinusoids::find(data, &residual, system.as_ref(), &self.sinusoids);
            if sinusoids.iter().all(Vec::is_empty) && self.sinusoids.is_empty() {
                break;
            }
            let reduced = data.without_sinusoids(&sinusoids);
            let change = (reduced.displacement() - self.data.displacement()).norm();
            // The first fit was made with the sinusoids in the data and may have ended at a wrong
            // minimum, so the first round searches anew.
            let from = (round > 0).then(|| self.white.fit.clone());
            self.white = with_white_noise(&reduced, unknowns, nominal, from)?.0;
            (self.data, self.sinusoids) = (Cow::Owned(reduced), sinusoids);
            if change <= SINUSOID_TOLERANCE * residual.norm() {
                break;
            }
        }
        Ok(())
    }
}

/// Fits with white noise of unknown level on each channel, and returns whether the residual is only
/// rounding. The search begins at a minimum `from` of nearly the same data, or at all initial
/// estimates.
fn with_white_noise(
    data: &FrequencyData,
    unknowns: &Unknowns,
    nominal: Option<&SecondOrderSystem>,
    from: Option<GlobalMinimum>,
) -> Result<(Weighted, bool), EstimateError> {
    let measured = measured_size(data, data.displacement());
    let known_force = data.force_variance().iter().all(|variance| *variance == 0.0);
    let (mut levels, mut last) = (measured.clone(), from);
    let mut rounds = 0;
    loop {
        rounds += 1;
        let noise = white_noise(data, &levels)?;
        let mut misfit = Misfit::new(data, unknowns, &noise)?;
        let fit = match last {
            None => {
                let spare = spare(data, unknowns) as f64;
                let fewer = thinned(data, unknowns, &noise);
                let starts = InitialEstimates::new(data, unknowns, &noise).with_nominal(nominal);
                let thin = fewer.as_ref().map(|(data, noise)| Misfit::new(data, unknowns, noise));
                let plausible = plausible(None, spare, spare);
                search(&mut misfit, thin.transpose()?.as_mut(), &starts, plausible)?
            }
            Some(before) => before.followed(&mut misfit)?,
        };
        let sizes = levels_of(data, &misfit);
        // With an exact force only the ratios between the noise levels of the channels matter: the
        // residual gives the common level.
        let common = if known_force { sizes[0] / levels[0] } else { 1.0 };
        let settled =
            sizes.iter().zip(&levels).all(|(f, l)| (f - l * common).abs() <= WEIGHT_TOLERANCE * f);
        // If the residual is only rounding, its level does not converge.
        let exact = sizes.iter().zip(&measured).all(|(f, x)| *f <= RESIDUAL_ROUNDING * x);
        // With a wrong model, the level of a channel may decrease in every round, until the number
        // of rounds ends the search. The fit is then a minimum for its weights, and the residual
        // shows the error of the model.
        let is_last = settled || exact || (known_force && data.dof() == 1) || rounds == MAX_ROUNDS;
        if is_last || time_limit::is_over() {
            drop(misfit);
            return Ok((Weighted { fit, noise }, exact));
        }
        last = Some(fit);
        // A channel without any residual must not take all the weight.
        let least = sizes.iter().zip(&levels).map(|(f, l)| f / l).fold(0.0, f64::max) * 1e-6;
        levels = sizes.iter().zip(&levels).map(|(f, l)| f.max(l * least)).collect();
    }
}

/// Fits with the noise that `next` estimates from the residual of the previous fit; `None` if this
/// residual is white.
fn reweighted(
    data: &FrequencyData,
    unknowns: &Unknowns,
    white: &Weighted,
    next: impl Fn(&Weighted) -> Result<Option<NoiseSpectrum>, EstimateError>,
) -> Result<Option<Weighted>, EstimateError> {
    let mut last: Option<Weighted> = None;
    for _ in 0..COLOURED_ROUNDS {
        if time_limit::is_over() {
            break;
        }
        let before = last.as_ref().unwrap_or(white);
        let Some(noise) = next(before)? else { return Ok(None) };
        let mut misfit = Misfit::new(data, unknowns, &noise)?;
        match before.fit.clone().followed(&mut misfit) {
            Ok(fit) => last = Some(Weighted { fit, noise }),
            // The result is the fit of the previous round, with the noise of that round, if this
            // round fails.
            Err(_) => break,
        }
    }
    Ok(last)
}

/// Estimates the noise spectrum from the residual. The noise is separate for each channel, or it is
/// the response to unmeasured forces. At each line the noise of the previous round is multiplied by
/// the ratio of the residual power to its expected value, which includes the stated noise of the
/// force. `None` if the spectrum is white.
fn spectrum_of_residual(
    data: &FrequencyData,
    unknowns: &Unknowns,
    before: &Weighted,
    pooling: Pooling,
) -> Result<Option<NoiseSpectrum>, EstimateError> {
    let (n, theta) = (data.dof(), &before.fit.minimum.parameters);
    let mut misfit = Misfit::new(data, unknowns, &before.noise)?;
    misfit.try_at(theta).ok_or(NumericsError::Overflow)?;
    misfit.accept();
    let (errors, leverage) = (misfit.errors(), leverage(data, unknowns, before));
    let by_force = misfit.variance_by_force();
    let covariance = data.omega().iter().enumerate().map(|(row, omega)| {
        let scale = data.measured().per_displacement(*omega).norm_sqr();
        let mut covariance = DMatrix::zeros(2 * n, 2 * n);
        for channel in 0..n {
            let variance = before.noise.covariance(row)[(channel, channel)].re;
            let share = variance / (variance + by_force[(row, channel)]);
            let squared_error = share * errors[(row, channel)].norm_sqr();
            // A line without residual would have an unbounded weight.
            let power = scale * squared_error.max(NOISE_LEAST * variance);
            let residual_share =
                leverage.as_ref().map_or(1.0, |h| (1.0 - h[(row, channel)]).max(NOISE_KEPT));
            covariance[(channel, channel)] = Complex::from(power / residual_share);
        }
        covariance
    });
    let covariance = covariance.collect();
    let mut of_forces = misfit.gain().insert_columns(n, n, 1.0);
    for (mut row, omega) in of_forces.row_iter_mut().zip(data.omega()) {
        row.columns_mut(0, n).scale_mut(data.measured().per_displacement(*omega).norm_sqr());
    }
    let (omega, measured, forces) = (data.omega(), data.measured(), Some(&of_forces));
    let noise = NoiseSpectrum::from_measured(omega, covariance, measured, 1, pooling, forces)?;
    let is_white = noise.models() == [NoiseModel::White];
    Ok((!is_white).then(|| noise.with_force_variance(data.force_variance())))
}

/// Returns the leverage of each row and channel, rows × n: the fraction of the noise that the
/// parameters fit. `None` for large fits, where the leverage is small.
pub(super) fn leverage(
    data: &FrequencyData,
    unknowns: &Unknowns,
    fit: &Weighted,
) -> Option<DMatrix<f64>> {
    let (n, rows) = (data.dof(), data.len());
    if 2 * n * rows * unknowns.free().len() > MAX_LEVERAGES {
        return None;
    }
    let (independent, tau) = parts(data, &fit.fit.minimum.parameters);
    let (data, entries) = (data.without_transient(tau), entries(unknowns, independent));
    let covariance = |row: usize| fit.noise.covariance(row).clone();
    let mut sensitivity = Whitened::new(&data, unknowns, &entries, covariance)?.sensitivity;
    for mut column in sensitivity.column_iter_mut() {
        let length = column.norm();
        if length > 0.0 {
            column /= length;
        }
    }
    let q = sensitivity.qr().q();
    let part = |at: usize| q.row(at).norm_squared();
    Some(DMatrix::from_fn(rows, n, |row, channel| {
        let at = 2 * (n * row + channel);
        0.5 * (part(at) + part(at + 1))
    }))
}

/// Returns the root mean square of displacement amplitudes, per channel, in the measured quantity.
fn measured_size(data: &FrequencyData, amplitudes: &DMatrix<Complex<f64>>) -> Vec<f64> {
    let power = |column: usize| {
        let terms = amplitudes
            .column(column)
            .into_iter()
            .zip(data.omega())
            .map(|(x, w)| (x * data.measured().per_displacement(*w)).norm_sqr());
        terms.sum::<f64>()
    };
    (0..data.dof()).map(|c| (power(c) / data.len() as f64).sqrt().max(f64::MIN_POSITIVE)).collect()
}

/// Returns white noise with the level of each channel estimated from the residual at the parameters
/// `theta`.
pub(super) fn white_noise_at(
    data: &FrequencyData,
    unknowns: &Unknowns,
    theta: &DVector<f64>,
) -> Result<NoiseSpectrum, EstimateError> {
    let any = white_noise(data, &measured_size(data, data.displacement()))?;
    let mut misfit = Misfit::new(data, unknowns, &any)?;
    misfit.try_at(theta).ok_or(NumericsError::Overflow)?;
    misfit.accept();
    white_noise(data, &levels_of(data, &misfit))
}

/// Estimates the standard deviation of the noise of each channel, in the measured quantity.
fn levels_of(data: &FrequencyData, misfit: &Misfit<'_>) -> Vec<f64> {
    let exact_force = data.force_variance().iter().all(|variance| *variance == 0.0);
    if exact_force {
        measured_size(data, &misfit.errors())
    } else {
        levels_with_force_noise(data, misfit)
    }
}

/// Estimates the standard deviation of the noise of each channel, in the measured quantity, by
/// maximum likelihood with the stated noise of the forces.
fn levels_with_force_noise(data: &FrequencyData, misfit: &Misfit<'_>) -> Vec<f64> {
    let (errors, by_force) = (misfit.errors(), misfit.variance_by_force());
    let level = |channel: usize| {
        let scale = |row: usize| data.measured().per_displacement(data.omega()[row]).norm_sqr();
        let power = |row: usize| scale(row) * errors[(row, channel)].norm_sqr();
        let known = |row: usize| scale(row) * by_force[(row, channel)];
        motion_level((0..data.len()).map(|row| (power(row), known(row))))
    };
    (0..data.dof()).map(level).collect()
}

/// Returns white noise with the given levels of the measured quantity, and the stated noise of the
/// forces.
fn white_noise(data: &FrequencyData, levels: &[f64]) -> Result<NoiseSpectrum, EstimateError> {
    let n = data.dof();
    let covariance = data.omega().iter().map(|w| {
        let scale = data.measured().per_displacement(*w).norm();
        DMatrix::from_fn(2 * n, 2 * n, |i, j| {
            let level = if i == j && i < n { levels[i] / scale } else { 0.0 };
            Complex::from(level * level)
        })
    });
    let noise = NoiseSpectrum::new(data.omega().to_vec(), covariance.collect())?;
    Ok(noise.with_force_variance(data.force_variance()))
}
