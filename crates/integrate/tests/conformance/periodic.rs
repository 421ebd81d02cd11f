//! The periodic steady state.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use mechid_integrate::*;
use mechid_model::{InitialState, Response, Sdof, SecondOrderSystem};
use mechid_signal::{Multisine, Phases, Record, Sampling};
use nalgebra::{Complex, DMatrix, DVector};

use crate::common::*;

/// Returns the steady state of the scheme's recurrence, computed for each spectral line: (e^{iωΔt}
/// I − A) Z = Σ B e^{iωτ} F, with direct sums for the Fourier transforms.
fn by_lines(scheme: &dyn Scheme, system: &SecondOrderSystem, force: &Record) -> [DMatrix<f64>; 3] {
    let (len, n) = (force.len(), force.channels());
    let dt = force.sampling().dt();
    let mut stepper = scheme.prepare_unchecked(system, dt).unwrap();
    let transition = Transition::from_stepper(stepper.as_mut());
    let states = transition.change.nrows();
    // In units of Δt² for displacements and of Δt for velocities, all entries have similar sizes.
    let units = DVector::from_fn(states, |i, _| dt.powi(2 - (i / n).min(2) as i32));
    let mut parts = [(); 3].map(|()| DMatrix::zeros(len, n));
    for line in 0..len {
        let turn = |k: usize| {
            let angle = std::f64::consts::TAU * ((k * line) % len) as f64 / len as f64;
            Complex::from_polar(1.0, angle)
        };
        let spectrum = DVector::from_fn(n, |c, _| {
            let sum: Complex<f64> =
                force.channel(c).iter().enumerate().map(|(k, f)| turn(k).conj() * f).sum();
            sum / len as f64
        });
        // e^{iωΔt} − 1 without cancellation: 2i sin(ωΔt/2) e^{iωΔt/2}.
        let half = std::f64::consts::PI * line as f64 / len as f64;
        let less_one = Complex::new(0.0, 2.0 * half.sin()) * Complex::from_polar(1.0, half);
        let matrix = DMatrix::from_diagonal_element(states, states, less_one)
            - DMatrix::from_fn(states, states, |i, j| {
                Complex::from(transition.change[(i, j)] * units[j] / units[i])
            });
        let mut rhs = DVector::zeros(states);
        for (instant, b) in &transition.loads {
            let shift = match instant {
                Instant::Now => turn(0),
                Instant::Next => turn(1),
                Instant::Beyond => turn(2),
                Instant::Middle => unreachable!("sampled schemes only"),
            };
            rhs += b.map(Complex::from) * &spectrum * shift;
        }
        rhs.iter_mut().zip(&units).for_each(|(entry, unit)| *entry /= *unit);
        let mut state = matrix.lu().solve(&rhs).unwrap();
        state.iter_mut().zip(&units).for_each(|(entry, unit)| *entry *= *unit);
        for k in 0..len {
            for (p, part) in parts.iter_mut().enumerate() {
                for c in 0..n {
                    part[(k, c)] += (state[p * n + c] * turn(k)).re;
                }
            }
        }
    }
    parts
}

/// Largest difference from the line-by-line answer, each quantity relative to its largest value.
fn error(response: &Response, judge: &[DMatrix<f64>; 3]) -> f64 {
    parts(response).iter().zip(judge).map(|(r, j)| (*r - j).amax() / j.amax()).fold(0.0, f64::max)
}

fn schroeder(dt: f64, len: usize, dof: usize) -> Record {
    let one = Multisine::flat(1..=len / 2 - 1, 1.0, Phases::SchroederBinary)
        .unwrap()
        .sample(Sampling::new(dt, len).unwrap())
        .unwrap();
    // Each channel has the signal of the previous channel shifted by 5 samples, so that F(0)
    // differs between channels.
    let data = DMatrix::from_fn(len, dof, |k, c| one.channel(0)[(k + 5 * c) % len]);
    Record::new(one.sampling(), data).unwrap()
}

#[test]
fn the_repeating_response_is_exact_at_any_damping() {
    for zeta in [0.4, 1e-2, 1e-4, 1e-6, 1e-8] {
        let system = Sdof::from_modal(10.0, zeta, 22.36).unwrap().system();
        for len in [60, 255, 256] {
            let force = schroeder(2e-3, len, 1);
            for scheme in schemes() {
                let response = integrate_periodic(scheme.as_ref(), &system, &force).unwrap();
                let error = error(&response, &by_lines(scheme.as_ref(), &system, &force));
                // The natural frequency is between lines, so that no resonance amplifies rounding
                // errors.
                assert!(error < 1e-12, "{} ζ {zeta} N {len}: {error:e}", scheme.name());
            }
        }
    }
}

#[test]
fn coupled_systems_of_any_size_repeat() {
    let random = |dof| mechid_problems::random_stable(dof, 7);
    let systems = [(random(2), 64), (random(3), 50), (random(8), 48), (chain(50, 1e-3), 24)];
    for (system, len) in systems {
        let dof = system.dof();
        let force = schroeder(1e-3, len, dof);
        for scheme in schemes() {
            let response = integrate_periodic(scheme.as_ref(), &system, &force).unwrap();
            let error = error(&response, &by_lines(scheme.as_ref(), &system, &force));
            assert!(error < 1e-12, "{} n {dof}: {error:e}", scheme.name());
        }
    }
}

/// A chain with natural frequencies of 14 to 62 rad/s, and the damping ratio `zeta` at 45 rad/s.
fn chain(dof: usize, zeta: f64) -> SecondOrderSystem {
    let stiffness = DMatrix::from_fn(dof, dof, |i, j| match i.abs_diff(j) {
        0 => 2000.0,
        1 => -900.0,
        _ => 0.0,
    });
    let damping = &stiffness * (2.0 * zeta / 45.0);
    SecondOrderSystem::new(DMatrix::identity(dof, dof), damping, stiffness).unwrap()
}

#[test]
fn waiting_gives_the_same() {
    // A period of the force is about 3.6 natural periods. With ζ = 0.4 the transient is far below
    // rounding after 58 periods of the force.
    let system = Sdof::from_modal(10.0, 0.4, 22.36).unwrap().system();
    let (len, periods) = (128, 60);
    let one = schroeder(8e-3, len, 1);
    let long = Record::from_channel(
        Sampling::new(8e-3, len * periods).unwrap(),
        one.channel(0).repeat(periods),
    )
    .unwrap();
    for scheme in schemes() {
        let name = scheme.name();
        let response = integrate_periodic(scheme.as_ref(), &system, &one).unwrap();
        let waited =
            integrate(scheme.as_ref(), &system, &long, &mechid_model::InitialState::rest(1))
                .unwrap();
        for (now, then) in parts(&response).iter().zip(parts(&waited)) {
            let then = then.rows((periods - 2) * len, len);
            assert!((*now - then).amax() < 1e-12 * now.amax(), "{name}");
        }
    }
}

#[test]
fn a_response_at_resonance_still_closes() {
    // With central difference, an oscillator with ω = 2 sin(θ/2)/Δt oscillates by the angle θ per
    // step. Here θ = 2π·3/64, so that the resonance is on line 3 of 64; ζ = 1e-9.
    let (dt, len) = (0.01, 64);
    let omega = 2.0 / dt * (std::f64::consts::PI * 3.0 / 64.0).sin();
    let system = Sdof::from_modal(1.0, 1e-9, omega).unwrap().system();
    let scheme = CentralDifference::default();
    let force = schroeder(dt, len, 1);
    let response = integrate_periodic(&scheme, &system, &force).unwrap();
    // The last step must lead back to the first sample.
    let (x, v, a) = (response.displacement(), response.velocity(), response.acceleration());
    let end = len - 1;
    let half_step = v.channel(0)[end] + 0.5 * dt * a.channel(0)[end];
    let closed = x.channel(0)[end] + dt * half_step;
    assert!((closed - x.channel(0)[0]).abs() < 1e-12 * x.column(0).amax());
    // The line at resonance has the amplitude F/(c ω'), where ω' = sin θ/Δt is the ratio of v to x.
    // Because K is rounded, only about seven digits of the damping ratio of 1e-9 are known. The
    // other lines add about 1e-8 of this amplitude.
    let seen = (std::f64::consts::TAU * 3.0 / 64.0).sin() / dt;
    let expected = 1.0 / (2e-9 * omega * seen);
    assert!((x.column(0).amax() / expected - 1.0).abs() < 1e-5);
}

#[test]
fn what_does_not_repeat_is_refused() {
    let force = schroeder(0.01, 64, 1);
    let omega = 2.0 / 0.01 * (std::f64::consts::PI * 3.0 / 64.0).sin();
    let undamped = Sdof::from_modal(1.0, 0.0, omega).unwrap().system();
    let refused = integrate_periodic(&CentralDifference::default(), &undamped, &force);
    assert!(matches!(refused, Err(IntegrateError::NoPeriodicState { .. })), "{refused:?}");
    let one = |v: f64| DMatrix::from_element(1, 1, v);
    for damping in [0.0, 3.0] {
        let free = SecondOrderSystem::new(one(2.0), one(damping), one(0.0)).unwrap();
        for scheme in schemes() {
            let refused = integrate_periodic(scheme.as_ref(), &free, &force);
            assert!(
                matches!(refused, Err(IntegrateError::NoPeriodicState { .. })),
                "{}: {refused:?}",
                scheme.name()
            );
        }
    }
}

/// A scheme that counts the steps taken.
#[derive(Debug)]
struct Counted<'a>(&'a dyn Scheme, Arc<AtomicUsize>);

struct CountedStepper(Box<dyn Stepper>, Arc<AtomicUsize>);

impl Scheme for Counted<'_> {
    fn name(&self) -> String {
        self.0.name()
    }

    fn conventions(&self) -> Vec<Convention> {
        self.0.conventions()
    }

    fn prepare_unchecked(
        &self,
        system: &dyn System,
        dt: f64,
    ) -> Result<Box<dyn Stepper>, IntegrateError> {
        let stepper = self.0.prepare_unchecked(system, dt)?;
        Ok(Box::new(CountedStepper(stepper, Arc::clone(&self.1))))
    }
}

impl Stepper for CountedStepper {
    fn dof(&self) -> usize {
        self.0.dof()
    }

    fn state_len(&self) -> usize {
        self.0.state_len()
    }

    fn instants(&self) -> &'static [Instant] {
        self.0.instants()
    }

    fn change(
        &mut self,
        state: &[f64],
        loads: &Loads<'_>,
        change: &mut [f64],
    ) -> Result<(), IntegrateError> {
        self.1.fetch_add(1, Ordering::Relaxed);
        self.0.change(state, loads, change)
    }

    fn start(
        &mut self,
        initial: &InitialState,
        early: &[Vec<f64>],
        motions: &mut [Vec<f64>],
        state: &mut [f64],
    ) -> Result<(), IntegrateError> {
        self.0.start(initial, early, motions, state)
    }
}

#[test]
fn two_passes_do() {
    let (dof, len) = (5, 2000);
    let force = schroeder(1e-3, len, dof);
    for zeta in [0.4, 1e-2, 1e-4, 1e-6, 1e-8] {
        let system = chain(dof, zeta);
        for scheme in schemes() {
            let steps = Arc::new(AtomicUsize::new(0));
            let counted = Counted(scheme.as_ref(), Arc::clone(&steps));
            integrate_periodic(&AllowUnstable(&counted), &system, &force).unwrap();
            // In addition to two passes, a few steps are taken from unit states to read the
            // matrices of the scheme.
            let passes = steps.load(Ordering::Relaxed) as f64 / len as f64;
            assert!(passes < 2.1, "{} ζ {zeta}: {passes} passes", scheme.name());
        }
    }
}
