//! Stepping does not allocate.

use allocation_counter::measure;
use mechid_integrate::*;
use mechid_model::InitialState;
use mechid_signal::{Record, Sampling};
use nalgebra::DMatrix;

fn schemes() -> Vec<Box<dyn Scheme>> {
    vec![
        Box::new(Newmark::AVERAGE_ACCELERATION),
        Box::new(CentralDifference::default()),
        Box::new(Houbolt::default()),
        Box::new(WilsonTheta::new(1.4).unwrap()),
        Box::new(WilsonTheta::new(1.4).unwrap().with_load(WilsonLoad::Interpolated)),
        Box::new(RungeKutta4::HELD),
        Box::new(RungeKutta4::LINEAR),
    ]
}

#[test]
fn a_step_allocates_nothing() {
    for dof in [1, 2, 5, 30] {
        let system = mechid_problems::random_stable(dof, 1);
        for scheme in schemes() {
            let mut stepper = scheme.prepare(&system, 1e-3).unwrap();
            let (state, load) = (vec![0.1; stepper.state_len()], vec![1.0; dof]);
            let mut change = state.clone();
            let loads = Loads { now: &load, middle: &load, next: &load, beyond: &load };
            let counted = measure(|| {
                for _ in 0..10 {
                    stepper.change(&state, &loads, &mut change);
                }
            });
            assert_eq!(counted.count_total, 0, "{} n {dof}", scheme.name());
        }
    }
}

#[test]
fn a_longer_record_takes_no_more_allocations() {
    for dof in [1, 2, 5] {
        let system = mechid_problems::random_stable(dof, 1);
        let force = |len: usize| {
            Record::new(Sampling::new(1e-3, len).unwrap(), DMatrix::from_element(len, dof, 1.0))
                .unwrap()
        };
        let (short, long) = (force(1024), force(2047));
        let rest = InitialState::rest(dof);
        for scheme in schemes() {
            let scheme = scheme.as_ref();
            let once = |force: &Record| {
                measure(|| drop(integrate(scheme, &system, force, &rest).unwrap())).count_total
            };
            assert_eq!(once(&short), once(&long), "{} n {dof}", scheme.name());
            // Lengths whose binary logarithms round down alike: as many squarings of a matrix.
            let periodic = |force: &Record| {
                measure(|| drop(integrate_periodic(scheme, &system, force).unwrap())).count_total
            };
            let (few, many) = (periodic(&short), periodic(&long));
            assert!(many < few + 200, "{} n {dof}: {few} {many}", scheme.name());
        }
    }
}
