//! Stepping does not allocate.

use allocation_counter::measure;
use mechid_integrate::*;
use mechid_model::{InitialState, SparseSystem, band, triplets};
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
        Box::new(GeneralisedAlpha::new(0.8).unwrap()),
        Box::new(Bathe::HALVES),
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
            let loads = Loads { time: 0.0, now: &load, middle: &load, next: &load, beyond: &load };
            let counted = measure(|| {
                for _ in 0..10 {
                    stepper.change(&state, &loads, &mut change).unwrap();
                }
            });
            assert_eq!(counted.count_total, 0, "{} n {dof}", scheme.name());
        }
    }
}

#[test]
fn a_step_of_a_large_system_allocates_nothing() {
    let n = 300;
    let stiffness = band(n, &[(-7, -400.0), (-1, -900.0), (0, 3000.0), (1, -900.0), (7, -400.0)]);
    let shuffled = |i: usize| i * 7 % n;
    let scattered =
        triplets(n, stiffness.triplet_iter().map(|(i, j, v)| (shuffled(i), shuffled(j), *v)));
    // No order of the degrees of freedom gives a narrow band with these entries.
    let far = (0..n).flat_map(|i| [(i, (i * i + 1) % n), (i, (7 * i + 3) % n)]);
    let far = far.flat_map(|(i, j)| [(i, j, -300.0), (j, i, -300.0)]);
    let wide = triplets(n, far.chain((0..n).map(|i| (i, i, 4000.0)))).unwrap();
    for stiffness in [stiffness.clone(), scattered.unwrap(), wide] {
        let (mass, damping) = (band(n, &[(0, 1.0)]), &stiffness * 1e-4);
        let linear = SparseSystem::new(mass, damping, stiffness).unwrap();
        let film = ForceFunction::new(vec![4, 9], |t, x, v, g| {
            g[0] = 50.0 * (x[0] - x[1]).powi(3) + 3.0 * v[0] + t.sin();
            g[1] = -g[0];
        });
        let gap = TermForces::new(&"k: gap(x3, 0.05)".parse().unwrap(), &[3e3]).unwrap();
        let nonlinear = SystemWithForces::new(&linear).with(film).unwrap().with(gap).unwrap();
        for (system, scheme) in schemes()
            .iter()
            .flat_map(|s| [&linear as &dyn System, &nonlinear].map(|system| (system, s)))
        {
            let mut stepper = scheme.prepare(system, 1e-3).unwrap();
            let (state, load) = (vec![0.1; stepper.state_len()], vec![1.0; n]);
            let mut change = state.clone();
            let loads = Loads { time: 0.0, now: &load, middle: &load, next: &load, beyond: &load };
            let counted = measure(|| {
                for _ in 0..10 {
                    stepper.change(&state, &loads, &mut change).unwrap();
                }
            });
            assert_eq!(counted.count_total, 0, "{}", scheme.name());
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
            // The binary logarithms of the lengths round down to the same number, so that a matrix
            // is squared equally often.
            let periodic = |force: &Record| {
                measure(|| drop(integrate_periodic(scheme, &system, force).unwrap())).count_total
            };
            let (few, many) = (periodic(&short), periodic(&long));
            assert!(many < few + 200, "{} n {dof}: {few} {many}", scheme.name());
        }
    }
}
