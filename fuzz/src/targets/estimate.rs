//! Calls of `mechid-estimate`.

use mechid_checks as checks;
use mechid_estimate::derivatives::{
    SavitzkyGolay, spectral_from_acceleration, spectral_from_displacement,
};
use mechid_estimate::frequency_domain::{
    equation_error, equation_rows, instrumental_variables, output_error,
};
use mechid_estimate::time_domain::{TimeDomain, Transitions, equation_of_motion};
use mechid_estimate::{
    EquationOfMotion, Estimate, StartFit, Unknowns, fit_percent, fitted_start, predict,
    predict_periodic,
};
use mechid_model::{Discretisation, Matrix, Response, Terms};
use mechid_nonlinear as nonlinear;
use mechid_nonlinear::{EquationErrorOptions, SteadyExperiments};
use mechid_numerics::least_squares::LeastSquares;
use mechid_numerics::logarithm::logarithm;
use mechid_signal::Window;
use mechid_signal::{Extent, Interpolation, Record, Sampling, correlation};
use mechid_spectra::frf::{Frf, FrfAverage, FrfEstimator, Segments};
use mechid_spectra::{FrequencyData, Lines, NoiseSpectrum, Pooling, RepeatedPeriods};
use nalgebra::{Complex, DMatrix};

use super::draw::{Draw, finite, passed};

pub fn calls(bytes: &[u8]) -> Result<(), String> {
    let d = &mut Draw::new(bytes);
    match d.below(9) {
        0 => rows(d),
        1 | 2 => spectra(d),
        3 => responses(d),
        4 => steps(d),
        5 => derivatives(d),
        6 => predictions(d),
        7 => tests(d),
        _ => terms(d),
    }
}

fn unknowns(d: &mut Draw, dof: usize) -> Result<Option<Unknowns>, String> {
    let all = if d.one_in(3) {
        let rows = d.dof(dof);
        passed(Unknowns::known_mass(&d.matrix(rows, rows)))?
    } else {
        passed(Unknowns::unknown_mass(d.dof(dof)))?
    };
    let Some(all) = all else { return Ok(None) };
    let matrix = d.of(&[Matrix::Mass, Matrix::Damping, Matrix::Stiffness]);
    let at = [0; 2].map(|_| if d.one_in(8) { d.size() } else { d.below(dof) });
    match d.below(4) {
        0 => passed(all.fix(matrix, at[0], at[1], d.number())),
        1 => passed(all.release(matrix, at[0], at[1])),
        _ => Ok(Some(all)),
    }
}

fn hold(d: &mut Draw) -> Discretisation {
    d.of(&[Discretisation::Euler, Discretisation::ZeroOrderHold, Discretisation::FirstOrderHold])
}

/// Calls all methods of an estimate.
fn found<E: std::fmt::Display>(
    d: &mut Draw,
    estimate: Result<Estimate, E>,
) -> Result<Option<Estimate>, String> {
    let Some(estimate) = passed(estimate)? else { return Ok(None) };
    if let Some(bad) =
        estimate.parameters().find(|p| !p.value.is_finite() && p.standard_error.is_finite())
    {
        return Err(format!("an estimate is not finite: {bad:?} of {:?}", estimate.unknowns()));
    }
    for parameter in estimate.parameters() {
        passed(parameter.interval(d.number()))?;
    }
    passed(estimate.modes())?;
    passed(estimate.system())?;
    passed(estimate.uncertain_system())?;
    passed(estimate.parameter(d.of(&["k11", "m12", "", "x"])))?;
    Ok(Some(estimate))
}

fn rows(d: &mut Draw) -> Result<(), String> {
    let (columns, right) = (d.size(), 1 + d.below(2));
    let mut fit = LeastSquares::new(columns, right);
    let count = d.below(12);
    let width = if d.one_in(8) { d.below(5) } else { columns.min(6) };
    let (a, b) = (d.matrix(count, width), d.matrix(count, right));
    passed(fit.push_rows(a.as_view(), b.as_view()))?;
    passed(fit.solve())?;
    let dof = 1 + d.below(3);
    let mut motion = EquationOfMotion::new(if d.one_in(8) { d.size() } else { dof });
    let [x, v, a, f] = [0; 4].map(|_| {
        let width = d.dof(dof);
        d.matrix(24, width)
    });
    passed(motion.push_rows(a.as_view(), v.as_view(), x.as_view(), f.as_view()))?;
    if let Some(unknowns) = unknowns(d, dof)? {
        let estimate = motion.solve(&unknowns);
        found(d, estimate)?;
    }
    let rows = d.below(5);
    passed(logarithm(&d.matrix(rows, rows)))?;
    Ok(())
}

/// Draws force and response of one experiment, in most cases of the same length and number of
/// channels.
fn experiment(d: &mut Draw, dof: usize) -> Result<Option<[Record; 2]>, String> {
    let Some(sampling) = d.sampling()? else { return Ok(None) };
    let Some(other) = (if d.one_in(12) { d.sampling()? } else { Some(sampling) }) else {
        return Ok(None);
    };
    let channels = [d.dof(dof), d.dof(dof)];
    let (force, response) = (d.record(sampling, channels[0])?, d.record(other, channels[1])?);
    Ok(force.zip(response).map(|(force, response)| [force, response]))
}

/// Repeats a period `count` times, each time with other noise.
fn periods(d: &mut Draw, one: &Record, count: usize) -> Result<Option<Record>, String> {
    let Some(all) = passed(one.repeated(count))? else { return Ok(None) };
    let Some(noise) = d.record(all.sampling(), all.channels())? else { return Ok(Some(all)) };
    let scale = if d.one_in(4) { 0.0 } else { 1e-6 };
    passed(Record::new(all.sampling(), all.data() + noise.data() * scale))
}

fn spectra(d: &mut Draw) -> Result<(), String> {
    let dof = 1 + d.below(2);
    let Some([force, response]) = experiment(d, dof)? else { return Ok(()) };
    let (len, quantity) = (force.len(), d.quantity());
    let chosen = d.lines(len);
    let excited = d.number();
    let lines = if d.one_in(4) {
        passed(Lines::excited(&force, excited))?
    } else {
        passed(Lines::new(force.sampling(), chosen))?
    };
    let (Some(lines), Some(unknowns)) = (lines, unknowns(d, dof)?) else { return Ok(()) };
    passed(checks::steady_periods(&force, &response, d.size()))?;
    let Some(data) = passed(FrequencyData::read(&lines, &force, &response, quantity))? else {
        return Ok(());
    };
    passed(checks::before_spectral_fit(&data, &unknowns))?;
    passed(equation_rows(&data))?;
    let estimate = equation_error(&data, &unknowns);
    let estimate = found(d, estimate)?;
    if let Some(estimate) = estimate {
        passed(checks::after_spectral_fit(std::slice::from_ref(&data), &estimate, Extent::Open))?;
        passed(checks::fitted_band(&estimate, &lines))?;
    }
    let _ = checks::delay_of_lines(&data, force.sampling().dt(), &unknowns);
    let count = 1 + d.below(3);
    let (Some(force), Some(response)) = (periods(d, &force, count)?, periods(d, &response, count)?)
    else {
        return Ok(());
    };
    let Some(periods) = passed(RepeatedPeriods::new(&lines, &force, &response, quantity))? else {
        return Ok(());
    };
    let pooling = match d.below(3) {
        0 => Pooling::PerLine,
        1 => Pooling::AllLines,
        _ => Pooling::Neighbours(d.size()),
    };
    if let Some((first, second)) = passed(periods.halves())? {
        let estimate = instrumental_variables(&first, &second, &unknowns);
        found(d, estimate)?;
        passed(first.and(&data))?;
    }
    let noise = if d.one_in(3) {
        let levels = [0; 2].map(|_| {
            let count = d.dof(dof);
            (0..count).map(|_| d.number()).collect::<Vec<_>>()
        });
        let sampling = force.sampling();
        passed(NoiseSpectrum::white(sampling, lines.as_slice(), quantity, &levels[0], &levels[1]))?
            .and_then(|noise| data.with_noise(noise).ok())
    } else {
        passed(periods.mean_with_noise(pooling))?
    };
    if let Some(data) = noise {
        let estimate = output_error(&data, &unknowns).map(|fit| fit.estimate);
        if let Some(estimate) = found(d, estimate)? {
            passed(checks::after_spectral_fit(&[data], &estimate, Extent::WholePeriod))?;
        }
    }
    Ok(())
}

fn responses(d: &mut Draw) -> Result<(), String> {
    let dof = 1 + d.below(2);
    let Some([force, response]) = experiment(d, dof)? else { return Ok(()) };
    let window = d.of(&[Window::Hann, Window::Hamming, Window::Blackman, Window::Rectangular]);
    let segments = match d.below(3) {
        0 => Segments::Periods(d.size()),
        1 => Segments::hann(d.size()),
        _ => Segments::Windowed { len: d.size(), hop: d.size(), window },
    };
    let estimator = d.of(&[FrfEstimator::H1, FrfEstimator::H2, FrfEstimator::Hv]);
    let (lines, quantity) = (d.lines(segments.samples().min(64)), d.quantity());
    let frf = Frf::estimate(&force, &response, quantity, segments, lines, estimator);
    let Some(frf) = passed(frf)? else { return Ok(()) };
    let places: Vec<usize> = (0..frf.omega().len()).collect();
    let Some(unknowns) = unknowns(d, dof)? else { return Ok(()) };
    let _ = checks::coherence(&frf);
    if let Some(data) = passed(frf.data(&places))? {
        let estimate = output_error(&data, &unknowns).map(|fit| fit.estimate);
        if let Some(estimate) = found(d, estimate)? {
            passed(checks::after_response_fit(&frf, &places, &estimate, d.number()))?;
            let band = [d.number(), d.number()];
            passed(checks::linearity(&estimate, &force, &response, quantity, band))?;
        }
    }
    if let Some(lines) = passed(Lines::new(force.sampling(), [1, 2]))?
        && let Some(mut mean) = passed(FrfAverage::new(lines, [dof; 2], quantity, segments))?
    {
        passed(mean.push(&force, &response))?;
        passed(mean.frf(estimator))?;
    }
    // The table has arbitrary numbers, because a table may come from another program.
    let omega = d.numbers(5);
    let tables: Vec<DMatrix<Complex<f64>>> =
        (0..d.dof(omega.len())).map(|_| d.matrix(dof, dof).map(|v| Complex::new(v, 1.0))).collect();
    let coherence = d.matrix(omega.len(), dof);
    passed(Frf::new(omega, tables, coherence, d.number(), quantity))?;
    Ok(())
}

fn motion(d: &mut Draw, sampling: Sampling, dof: usize) -> Result<Option<Response>, String> {
    let [x, v, a] = [0; 3].map(|_| {
        let channels = d.dof(dof);
        d.record(sampling, channels)
    });
    match (x?, v?, a?) {
        (Some(x), Some(v), Some(a)) => passed(Response::new(x, v, a)),
        _ => Ok(None),
    }
}

fn steps(d: &mut Draw) -> Result<(), String> {
    let dof = 1 + d.below(2);
    let Some(sampling) = d.sampling()? else { return Ok(()) };
    let channels = d.dof(dof);
    let (Some(motion), Some(force)) = (motion(d, sampling, dof)?, d.record(sampling, channels)?)
    else {
        return Ok(());
    };
    let Some(unknowns) = unknowns(d, dof)? else { return Ok(()) };
    let (x, v, extent) = (motion.displacement(), motion.velocity(), d.extent());
    passed(checks::before_equation_of_motion(&[(&motion, &force)], &unknowns))?;
    let estimate = equation_of_motion(&motion, &force, &unknowns);
    if let Some(estimate) = found(d, estimate)? {
        passed(checks::noise_on_response(&motion, &force, &estimate))?;
    }
    let _ = checks::delay_at_samples(&motion, &force, &unknowns);
    let domain = TimeDomain::new(hold(d), extent);
    passed(checks::before_fit(domain, &[[x, v, &force]]))?;
    let _ = checks::delay_between_samples(domain, x, v, &force, &unknowns);
    let fit = domain.fit(x, v, &force, &unknowns);
    if let Some(fit) = passed(fit)? {
        passed(fit.one_step_errors(x, v, &force, extent))?;
        let _ = (fit.transition(), fit.kinematic_error());
        found(d, Ok::<_, String>(fit.into_estimate()))?;
    }
    let refinement = if d.one_in(6) { d.size() } else { d.below(4) };
    let fit = domain.fit_refined([x, v, &force], &unknowns, refinement, Interpolation::BandLimited);
    passed(fit.map(|fit| fit.into_estimate()))?;
    if let Some(mut rows) = passed(Transitions::new(d.size(), d.number()))? {
        passed(rows.push(x, v, &force, extent))?;
    }
    passed(checks::after_fit(&force, &force, x, d.size(), d.size()))?;
    Ok(())
}

fn derivatives(d: &mut Draw) -> Result<(), String> {
    let Some(sampling) = d.sampling()? else { return Ok(()) };
    let channels = d.below(3);
    let Some(record) = d.record(sampling, channels)? else { return Ok(()) };
    passed(spectral_from_acceleration(&record))?;
    passed(spectral_from_displacement(&record))?;
    if let Some(filter) = passed(SavitzkyGolay::new(d.size(), d.size()))? {
        finite(filter.differentiate(&record, d.size()))?;
        passed(filter.motion(&record))?;
        passed(filter.twice_differentiated(&record, &record))?;
    }
    Ok(())
}

fn predictions(d: &mut Draw) -> Result<(), String> {
    let dof = 1 + d.below(2);
    let Some([force, response]) = experiment(d, dof)? else { return Ok(()) };
    passed(fit_percent(&force, &response))?;
    let (Some(system), Some(start)) = (d.system(dof)?, d.start(dof)?) else { return Ok(()) };
    let (hold, extent, quantity) = (hold(d), d.extent(), d.quantity());
    passed(predict(&system, &force, hold, extent, &start))?;
    passed(predict_periodic(&system, &force))?;
    passed(fitted_start(&system, &force, hold, &[(quantity, &response)]))?;
    if let Some(mut fit) = passed(StartFit::new(&system, hold))? {
        passed(fit.push(&force, &[(quantity, &response)]))?;
        passed(fit.start())?;
    }
    Ok(())
}

fn tests(d: &mut Draw) -> Result<(), String> {
    let most = d.below(60);
    let (a, b) = (d.numbers(most), d.numbers(most));
    passed(correlation::whiteness(&a, d.size()))?;
    passed(correlation::whiteness_beyond(&a, d.size(), d.size()))?;
    passed(correlation::cross_correlation(&a, &b, d.size()))?;
    let dof = 1 + d.below(2);
    let Some([force, response]) = experiment(d, dof)? else { return Ok(()) };
    let _ = checks::periodicity(&force);
    let _ = checks::claimed_period(&force, d.size());
    for quantity in [checks::Quantity::Force, checks::Quantity::Response(d.quantity())] {
        let _ = checks::clipped_channels(quantity, &response);
        let _ = checks::constant_channels(quantity, &response);
        let _ = checks::quantised_channels(quantity, &response);
        let _ = checks::spiked_channels(quantity, &force, &response);
    }
    let (one, other) = (d.quantity(), d.quantity());
    passed(checks::kinematics(&[(one, &force), (other, &response)]))?;
    passed(checks::power(&force, &response, one))?;
    Ok(())
}

fn terms(d: &mut Draw) -> Result<(), String> {
    let dof = 1 + d.below(2);
    let Some([force, response]) = experiment(d, dof)? else { return Ok(()) };
    let (chosen, quantity) = (d.lines(force.len()), d.quantity());
    let Some(lines) = passed(Lines::new(force.sampling(), chosen))? else { return Ok(()) };
    let Some(unknowns) = unknowns(d, dof)? else { return Ok(()) };
    passed(nonlinear::distortion(&lines, &[[&force, &response]], quantity, &unknowns))?;
    let mut experiments = SteadyExperiments::new(&lines, d.dof(dof), quantity);
    passed(experiments.push(&force, &response))?;
    let text = d.of(&["k3: x1^3", "k2: x1^2, k3: x1^3", "c2: |v1| v1", "k3: (x1 - x2)^3", ""]);
    if let Some(terms) = passed(text.parse::<Terms>())? {
        let options = EquationErrorOptions::default();
        let fit = nonlinear::equation_error(&experiments, &unknowns, &terms, &options);
        if let Some(fit) = passed(fit)? {
            passed(fit.system())?;
            passed(fit.restoring_force(&d.numbers(3), &d.numbers(3)))?;
        }
    }
    Ok(())
}
