//! Proposals of the dissertation for later work, and the library's answer to them.

use mechid::force::{Measurement, Noise, frequency_domain, inner_lines};
use mechid::model::{Discretisation, ResponseQuantity};
use mechid::signal::Interpolation;

use super::super::published::Method::{Newmark, Rk4};
use super::super::simulate::correct;
use super::appendices::refined_errors;
use super::evidence::Source;
use super::markdown::{number, table};
use super::rerun::{Domain, Equation, Parameters, force, sdof};

/// Returns the section of the audit page on the proposals for later work.
///
/// # Errors
/// The message of the computation that fails.
pub fn section() -> Result<String, String> {
    let rows = [noise(), taylor()?, spectra()?, splines()?, criterion(), experiment()];
    Ok(format!(
        "## What the dissertation proposes for later (6.2)\n\n{}",
        table(&["No.", "Suggestion", "What there is now"], rows)
    ))
}

fn row(number: &str, suggestion: &str, answer: String) -> Vec<String> {
    vec![number.to_owned(), suggestion.to_owned(), answer]
}

fn noise() -> Vec<String> {
    row(
        "S1",
        "Noise on the outputs, and an estimator that stands it, such as instrumental variables.",
        "`mechid::estimate::frequency_domain`: `instrumental_variables` and the maximum-likelihood \
         `output_error`, with the noise level from repeated periods (`RepeatedPeriods`); \
         `mechid::signal` adds white and coloured noise. Bias, scatter and coverage of thousands of \
         experiments against the bound no estimator can beat: \
         the book, “Which estimator”. Least squares is biased there, \
         instrumental variables is not, maximum likelihood is both unbiased and nearly the best \
         possible."
            .to_owned(),
    )
}

fn taylor() -> Result<Vec<String>, String> {
    let rms = |equation| {
        let identified = force(Source::Corrected, sdof(3.4), Rk4, Parameters::Exact, equation)?;
        Ok::<String, String>(number(identified.rms()))
    };
    Ok(row(
        "S2",
        "The discretised force equation with more terms of the Taylor series.",
        format!(
            "`mechid::force::discretised_by_taylor` with one to eight terms, and \
             `mechid::force::discretised` with `ZeroOrderHold` and `FirstOrderHold`. More terms \
             alone do not help: on Runge-Kutta data at NPI 3.4 the rms deviation of |F̂/F| is {} with one term, {} with eight, {} with the exact exponential \
             for a force that is linear over a step, as it was. See [claim 24](#claim-24) and \
             the book, “Which force method”.",
            rms(Equation::Discretised(Discretisation::Euler))?,
            rms(Equation::Taylor(8))?,
            rms(Equation::Discretised(Discretisation::FirstOrderHold))?
        ),
    ))
}

fn spectra() -> Result<Vec<String>, String> {
    let case = sdof(8.0);
    let sequences = correct(case, Rk4)?;
    let measured = Measurement::from_record(
        ResponseQuantity::Displacement,
        sequences.response.displacement().clone(),
    );
    let machine = case.machine.system();
    let lines = inner_lines(&measured);
    let identified = frequency_domain(&machine, &measured, &[0], &lines, &Noise::Unknown)
        .map_err(|e| e.to_string())?;
    let spectral = mechid::force::relative_error(identified.record(), &sequences.force)
        .map_err(|e| e.to_string())?;
    let stepped =
        force(Source::Corrected, case, Rk4, Parameters::From(Domain::Time), Equation::Continuous)?;
    Ok(row(
        "S3",
        "The force from the spectra of the response, against the time domain.",
        format!(
            "`mechid::force::frequency_domain`: from any channels, at the excited lines, with a \
             standard error. From the Runge-Kutta displacement alone and the true machine (NPI 8) \
             the relative error is {}, all of it the integrator's; the continuous equation needs \
             displacement, velocity and acceleration, and with the machine identified by Euler's \
             rule deviates by {} rms. With noise `regularised` and `kalman` follow: \
             the book, “Which force method”.",
            number(spectral),
            number(stepped.rms())
        ),
    ))
}

fn splines() -> Result<Vec<String>, String> {
    let errors = |points, kind| {
        let errors = refined_errors(points, kind, 8.0)?;
        Ok::<String, String>(format!("{}, {}", number(errors[0]), number(errors[1])))
    };
    Ok(row(
        "S4",
        "Intermediate points by cubic or spline interpolation instead of straight lines.",
        format!(
            "`mechid::signal::resample::refine` with `Linear`, `NaturalSpline`, `NotAKnotSpline`, \
             `Pchip` and `BandLimited`. Errors of K, C with Euler's rule at NPI 8, Nt = 128: {} \
             without points, {} with two on straight lines, {} with two on a spline. Points between \
             samples hold no new information; the exact discretisation makes them needless.",
            errors(0, Interpolation::Linear)?,
            errors(2, Interpolation::Linear)?,
            errors(2, Interpolation::NotAKnotSpline)?
        ),
    ))
}

fn criterion() -> Vec<String> {
    row(
        "S5",
        "The step-size criterion of Oliveira (1997) in every method.",
        "Not implemented: the dissertation does not describe it and the paper was not at hand. In \
         its place `mechid::integrate` derives from the stepping code of each scheme what a step \
         costs (`accuracy`: period elongation and amplitude decay) and allows (`critical_step`), \
         and the table [which step](#which-step) shows it for identification."
            .to_owned(),
    )
}

fn experiment() -> Vec<String> {
    row(
        "S6",
        "Validation on a real machine.",
        format!(
            "`mechid::io` reads measured records and the program's `identify` works on them, with \
             intervals and checks of the fit; `crates/estimate/tests/suite/silverbox.rs` runs on a public \
             measured benchmark where its data are present. The bearing itself has not been \
             measured: the {} and other motions here are computed.",
            Newmark.name()
        ),
    )
}
