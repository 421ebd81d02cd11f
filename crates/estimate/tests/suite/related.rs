//! Symmetric matrices, chains and proportional damping: fewer unknowns than entries.

use mechid_checks::Delay;
use mechid_checks::{Finding, delay_of_lines};
use mechid_estimate::frequency_domain::{equation_error, instrumental_variables, output_error};
use mechid_estimate::{EquationOfMotion, Estimate, EstimateError, Unknowns};
use mechid_model::{Matrix, ResponseQuantity, SecondOrderSystem};
use mechid_signal::{Sampling, noise};
use mechid_spectra::{FrequencyData, NoiseSpectrum};
use nalgebra::{Complex, DMatrix, DVector, dmatrix};

/// Damping factors α (1/s) and β (s).
const FACTORS: [f64; 2] = [0.4, 2e-4];

/// Returns a chain of `n` masses with proportional damping; each mass also has a spring to the
/// ground.
fn chain(n: usize) -> SecondOrderSystem {
    let vary = |at: usize, share: f64| 1.0 + share * (2.3 * at as f64).sin();
    let mass = DMatrix::from_fn(n, n, |i, j| if i == j { 2.0 * vary(i, 0.4) } else { 0.0 });
    let stiffness = DMatrix::from_fn(n, n, |i, j| match i.abs_diff(j) {
        0 => 2000.0 * (vary(i, 0.3) + vary(i + 1, 0.3)) + 900.0 * vary(i, 0.5),
        1 => -2000.0 * vary(i.max(j), 0.3),
        _ => 0.0,
    });
    let damping = &mass * FACTORS[0] + &stiffness * FACTORS[1];
    SecondOrderSystem::new(mass, damping, stiffness).unwrap()
}

/// Returns the unknowns of a chain of `n` masses, with symmetric matrices and, if `proportional`,
/// proportional damping.
fn unknowns(n: usize, proportional: bool) -> Unknowns {
    let mut unknowns = Unknowns::unknown_mass(n).unwrap();
    for matrix in Matrix::ALL {
        let reach = if matrix == Matrix::Mass { 0 } else { 1 };
        let own = matrix != Matrix::Damping || !proportional;
        for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
            if own && i.abs_diff(j) > reach {
                unknowns = unknowns.fix(matrix, i, j, 0.0).unwrap();
            }
        }
        unknowns = unknowns.symmetric(matrix).unwrap();
    }
    if proportional { unknowns.proportional_damping().unwrap() } else { unknowns }
}

/// Returns equidistant angular frequencies over the range of the modes of a machine.
fn omega(system: &SecondOrderSystem, lines: usize) -> Vec<f64> {
    let modes = system.modes().unwrap();
    let frequency = |mode: Option<&mechid_model::Mode>| mode.unwrap().natural_frequency();
    let (low, high) = (0.6 * frequency(modes.first()), 1.1 * frequency(modes.last()));
    (0..lines).map(|at| low + (high - low) * at as f64 / (lines - 1) as f64).collect()
}

/// Returns a force of 10 N at the first mass, and the exact displacements under this force.
fn exact(system: &SecondOrderSystem, omega: &[f64]) -> [DMatrix<Complex<f64>>; 2] {
    let n = system.dof();
    let force = DMatrix::from_fn(omega.len(), n, |line, dof| match dof {
        0 => Complex::from_polar(10.0, (line * line) as f64),
        _ => Complex::default(),
    });
    let mut displacement = DMatrix::zeros(omega.len(), n);
    for (line, omega) in omega.iter().enumerate() {
        let motion = system.receptance(*omega).unwrap() * force.row(line).transpose();
        displacement.row_mut(line).tr_copy_from(&motion);
    }
    [force, displacement]
}

/// Returns the exact displacements with white noise of known level: a fraction `part` of the RMS of
/// each channel.
fn measured(system: &SecondOrderSystem, omega: &[f64], part: f64, seed: u64) -> FrequencyData {
    let [force, mut displacement] = exact(system, omega);
    let (lines, n) = displacement.shape();
    let size = |column: usize| part * displacement.column(column).norm() / (lines as f64).sqrt();
    let levels: Vec<f64> = (0..n).map(size).collect();
    let sampling = Sampling::new(1.0, lines).unwrap();
    let drawn = noise::white(sampling, 2 * n, 0.5_f64.sqrt(), seed).unwrap();
    for (line, dof) in (0..lines).flat_map(|line| (0..n).map(move |dof| (line, dof))) {
        let error = Complex::new(drawn.data()[(line, 2 * dof)], drawn.data()[(line, 2 * dof + 1)]);
        displacement[(line, dof)] += error * levels[dof];
    }
    let variance = |at: usize| Complex::from(if at < n { levels[at].powi(2) } else { 0.0 });
    let covariance = DMatrix::from_diagonal(&DVector::from_fn(2 * n, |at, _| variance(at)));
    let spectrum = NoiseSpectrum::new(omega.to_vec(), vec![covariance; lines]).unwrap();
    FrequencyData::from_amplitudes(
        omega.to_vec(),
        force,
        displacement,
        ResponseQuantity::Displacement,
    )
    .and_then(|data| data.with_noise(spectrum))
    .unwrap()
}

fn largest_error(found: &Estimate, system: &SecondOrderSystem) -> f64 {
    let pairs = [
        (found.mass(), system.mass()),
        (found.damping(), system.damping()),
        (found.stiffness(), system.stiffness()),
    ];
    pairs.iter().map(|(found, truth)| (found - *truth).amax() / truth.amax()).fold(0.0, f64::max)
}

/// One force on eight masses, all unknown: the data determine only a few of the 192 entries, but
/// all 38 unknowns of a symmetric chain.
#[test]
fn one_force_determines_a_chain_of_unknown_masses() {
    let system = chain(8);
    let omega = omega(&system, 60);
    let [force, displacement] = exact(&system, &omega);
    let quantity = ResponseQuantity::Displacement;
    let data = FrequencyData::from_amplitudes(omega.clone(), force, displacement, quantity);
    let data = data.unwrap();
    for (proportional, count) in [(false, 8 + 15 + 15), (true, 8 + 15 + 2)] {
        let unknowns = unknowns(8, proportional);
        assert_eq!(unknowns.independent(), count);
        let found = equation_error(&data, &unknowns).unwrap();
        let error = largest_error(&found, &system);
        assert!(error < 1e-8, "least squares, proportional {proportional}: {error:e}");
        let found = output_error(&data, &unknowns).unwrap().estimate;
        let error = largest_error(&found, &system);
        assert!(error < 1e-8, "maximum likelihood, proportional {proportional}: {error:e}");
        assert_eq!(found.mass(), found.mass().transpose());
        assert_eq!(found.stiffness(), found.stiffness().transpose());
    }
    let all = Unknowns::unknown_mass(8).unwrap();
    let refused = equation_error(&data, &all).unwrap_err();
    assert!(matches!(refused, EstimateError::OnlyRatios { dof: 2, .. }), "{refused}");
}

/// One force acts on five masses: delays of 0.5, −1.3 and 4 samples are found, and no delay is
/// found in data without a delay.
#[test]
fn a_delay_of_the_force_on_a_chain_is_found() {
    let system = chain(5);
    let omega = omega(&system, 60);
    let dt = std::f64::consts::PI / (2.0 * omega[59]);
    let turned = |data: &FrequencyData, delay: f64| {
        let late = |line: usize| Complex::cis(-omega[line] * delay);
        let displacement = data.displacement();
        let displacement = DMatrix::from_fn(60, 5, |l, k| displacement[(l, k)] * late(l));
        let (force, quantity) = (data.force().clone(), ResponseQuantity::Displacement);
        let turned = FrequencyData::from_amplitudes(omega.clone(), force, displacement, quantity);
        turned.and_then(|turned| turned.with_noise(data.noise().unwrap().clone())).unwrap()
    };
    for proportional in [false, true] {
        let unknowns = unknowns(5, proportional);
        for seed in 0..20 {
            let data = measured(&system, &omega, 0.003, seed);
            assert_eq!(delay_of_lines(&data, dt, &unknowns), None, "seed {seed}");
        }
        for (seed, samples) in (0..).zip([0.5, -1.3, 4.0]) {
            let data = turned(&measured(&system, &omega, 0.003, seed), samples * dt);
            let found = delay_of_lines(&data, dt, &unknowns).unwrap();
            let Finding::Delay(Delay { samples: told, .. }) = found else { panic!("{found}") };
            assert!((told - samples).abs() < 0.1, "{told} for {samples}");
        }
    }
}

/// Returns the standard errors of the entries at the Cramér–Rao bound, from differences of exact
/// responses.
fn bound(system: &SecondOrderSystem, data: &FrequencyData, proportional: bool) -> DVector<f64> {
    let n = system.dof();
    let matrices = [system.mass(), system.damping(), system.stiffness()];
    // Derivatives of the matrices with respect to each independent unknown.
    let mut moves: Vec<[DMatrix<f64>; 3]> = Vec::new();
    let zero = || DMatrix::<f64>::zeros(n, n);
    for (at, matrix) in Matrix::ALL.into_iter().enumerate() {
        for (i, j) in (0..n).flat_map(|i| (i..n).map(move |j| (i, j))) {
            let reach = if matrix == Matrix::Mass { 0 } else { 1 };
            if i.abs_diff(j) > reach || proportional && matrix == Matrix::Damping {
                continue;
            }
            let mut moved = [zero(), zero(), zero()];
            (moved[at][(i, j)], moved[at][(j, i)]) = (1.0, 1.0);
            if proportional {
                let factor = FACTORS[if matrix == Matrix::Mass { 0 } else { 1 }];
                moved[1] = &moved[at] * factor;
            }
            moves.push(moved);
        }
    }
    if proportional {
        moves.push([zero(), matrices[0].clone(), zero()]);
        moves.push([zero(), matrices[2].clone(), zero()]);
    }
    let omega = data.omega();
    let mut jacobian = DMatrix::zeros(2 * n * omega.len(), moves.len());
    for (column, moved) in moves.iter().enumerate() {
        let length: f64 = moved.iter().map(|m| m.norm()).sum::<f64>();
        let step = 1e-6 * matrices[0].norm().max(matrices[2].norm() * moved[2].norm()) / length;
        let response = |by: f64| {
            let [m, c, k] = [0, 1, 2].map(|at| matrices[at] + &moved[at] * (by * step));
            exact(&SecondOrderSystem::new(m, c, k).unwrap(), omega)[1].clone()
        };
        let change = (response(1.0) - response(-1.0)) / Complex::from(2.0 * step);
        for (line, row) in change.row_iter().enumerate() {
            let noise = data.noise().unwrap().covariance(line);
            for (dof, z) in row.iter().enumerate() {
                // Real and imaginary parts have half the variance each.
                let z = z / (0.5 * noise[(dof, dof)].re).sqrt();
                let at = 2 * (n * line + dof);
                (jacobian[(at, column)], jacobian[(at + 1, column)]) = (z.re, z.im);
            }
        }
    }
    let scale: Vec<f64> = jacobian.column_iter().map(|c| c.norm()).collect();
    for (mut column, scale) in jacobian.column_iter_mut().zip(&scale) {
        column.unscale_mut(*scale);
    }
    let information = jacobian.tr_mul(&jacobian);
    let covariance = information.cholesky().unwrap().inverse();
    let free = unknowns(n, proportional).free();
    DVector::from_iterator(
        free.len(),
        free.iter().map(|p| {
            let g = DVector::from_fn(moves.len(), |at, _| {
                moves[at][p.matrix() as usize][(p.row(), p.column())] / scale[at]
            });
            g.dot(&(&covariance * &g)).sqrt()
        }),
    )
}

/// In 200 experiments on a chain of four masses with one force, the intervals have the stated
/// coverage and the scatter equals the Cramér–Rao bound.
#[test]
fn related_entries_are_estimated_at_the_bound_with_intervals_that_hold() {
    let system = chain(4);
    let omega = omega(&system, 40);
    for proportional in [false, true] {
        let unknowns = unknowns(4, proportional);
        let free = unknowns.free();
        let truth: Vec<f64> =
            free.iter().map(|p| system.matrix(p.matrix())[(p.row(), p.column())]).collect();
        let bound = bound(&system, &measured(&system, &omega, 0.01, 0), proportional);
        let runs = 200;
        let (mut inside, mut squares) = (0, DVector::<f64>::zeros(free.len()));
        let mut factors = 0;
        for seed in 0..runs {
            let data = measured(&system, &omega, 0.01, 1000 + seed);
            let found = output_error(&data, &unknowns).unwrap().estimate;
            for (at, parameter) in found.parameters().enumerate() {
                let [low, high] = parameter.interval(0.95).unwrap();
                inside += usize::from((low..=high).contains(&truth[at]));
                squares[at] += (parameter.value - truth[at]).powi(2);
                let ratio = parameter.standard_error / bound[at];
                assert!((0.8..1.25).contains(&ratio), "{}: {ratio}", parameter.parameter);
            }
            for (factor, truth) in found.proportional_damping().iter().flatten().zip(FACTORS) {
                let [low, high] = factor.interval(0.95).unwrap();
                factors += usize::from((low..=high).contains(&truth));
            }
        }
        let all = runs as f64 * free.len() as f64;
        let coverage = inside as f64 / all;
        assert!((0.93..=0.97).contains(&coverage), "proportional {proportional}: {coverage}");
        let ratio = (squares / runs as f64).map(f64::sqrt).component_div(&bound);
        let mean = ratio.mean();
        // The standard deviation of 200 runs has an uncertainty of 5 %, and the standard deviations
        // of the entries of a chain are correlated, so their mean is hardly more accurate.
        assert!((0.9..1.1).contains(&mean), "proportional {proportional}: {ratio}");
        if proportional {
            let coverage = factors as f64 / (2.0 * runs as f64);
            assert!((0.92..=0.98).contains(&coverage), "damping factors: {coverage}");
        }
    }
}

/// With noise on the recorded force in each equation, the 95 % intervals of least squares with
/// related entries contain the truth as often as stated.
#[test]
fn least_squares_of_related_entries_has_intervals_that_hold() {
    let system = chain(3);
    let unknowns = unknowns(3, false);
    let (runs, rows) = (300, 200);
    let [a, v, x] = [1.0, 2.0, 3.0].map(|shift: f64| {
        DMatrix::from_fn(rows, 3, |row, dof| (shift * (row * (dof + 2)) as f64 + shift).sin())
    });
    let force = &a * system.mass() + &v * system.damping() + &x * system.stiffness();
    let sampling = Sampling::new(1.0, rows).unwrap();
    let mut inside = 0;
    for seed in 0..runs {
        let drawn = noise::white(sampling, 3, 1.0, seed).unwrap();
        // The noise has a different size in each equation, and a common part.
        let mix = dmatrix![1.0, 0.0, 0.0; 5.0, 3.0, 0.0; 0.0, 20.0, 30.0];
        let read = &force + drawn.data() * mix.transpose();
        let mut equations = EquationOfMotion::new(3);
        equations.push_rows(a.as_view(), v.as_view(), x.as_view(), read.as_view()).unwrap();
        let found = equations.solve(&unknowns).unwrap();
        for parameter in found.parameters() {
            let p = parameter.parameter;
            let truth = system.matrix(p.matrix())[(p.row(), p.column())];
            let [low, high] = parameter.interval(0.95).unwrap();
            inside += usize::from((low..=high).contains(&truth));
        }
    }
    let coverage = inside as f64 / (runs as usize * unknowns.free().len()) as f64;
    assert!((0.93..=0.97).contains(&coverage), "{coverage}");
}

#[test]
fn relations_that_contradict_are_refused() {
    let two = || Unknowns::unknown_mass(2).unwrap();
    let fixed = two().fix(Matrix::Stiffness, 0, 1, 1.0).unwrap();
    let fixed = fixed.fix(Matrix::Stiffness, 1, 0, 2.0).unwrap();
    assert_eq!(
        fixed.symmetric(Matrix::Stiffness).unwrap_err().to_string(),
        "k21 is given as 2 and k12 as 1: a symmetric matrix needs equal values"
    );
    let damped = two().fix(Matrix::Damping, 0, 1, 0.0).unwrap();
    assert_eq!(
        damped.proportional_damping().unwrap_err().to_string(),
        "c12 cannot be given: with proportional damping every entry follows from mass and stiffness"
    );
    let known = two().symmetric(Matrix::Mass).unwrap().fix(Matrix::Mass, 0, 1, 0.5).unwrap();
    assert_eq!(known.fixed(Matrix::Mass, 1, 0), Some(0.5));
    let data = measured(&chain(2), &[10.0, 20.0, 30.0, 40.0, 50.0, 60.0, 70.0], 0.01, 1);
    let symmetric = unknowns(2, false);
    let refused = instrumental_variables(&data, &data, &symmetric).unwrap_err();
    assert!(matches!(refused, EstimateError::Related { .. }), "{refused}");
}

/// If two masses are not connected and a force acts only on the first one, the estimate reports m22
/// as undetermined, and output error returns an error.
#[test]
fn what_relations_do_not_determine_is_named() {
    let system = SecondOrderSystem::new(
        dmatrix![1.0, 0.0; 0.0, 2.0],
        dmatrix![1.0, 0.0; 0.0, 1.0],
        dmatrix![100.0, 0.0; 0.0, 200.0],
    )
    .unwrap();
    let omega: Vec<f64> = (1..20).map(f64::from).collect();
    let [force, displacement] = exact(&system, &omega);
    let quantity = ResponseQuantity::Displacement;
    let data = FrequencyData::from_amplitudes(omega, force, displacement, quantity).unwrap();
    let found = equation_error(&data, &unknowns(2, false)).unwrap();
    assert!(!found.undetermined().is_empty());
    let named: Vec<String> = found.undetermined().iter().map(|u| u.to_string()).collect();
    assert!(named.iter().any(|terms| terms.contains("m22")), "{named:?}");
    assert!(found.parameter("m11").unwrap().value.is_finite());
    let refused = output_error(&data, &unknowns(2, false)).unwrap_err();
    assert!(matches!(refused, EstimateError::Undetermined { .. }), "{refused}");
}
