//! Nonlinear forces, judged by closed forms.

use mechid_integrate::*;
use mechid_model::{InitialState, Sdof, SecondOrderSystem, SparseSystem, band};
use mechid_signal::{Record, Sampling};
use nalgebra::{DMatrix, DVector, dvector};

use crate::common::*;

fn still(dt: f64, len: usize, dof: usize) -> Record {
    Record::new(Sampling::new(dt, len).unwrap(), DMatrix::zeros(len, dof)).unwrap()
}

fn oscillator(m: f64, c: f64, k: f64) -> SecondOrderSystem {
    let one = |v: f64| DMatrix::from_element(1, 1, v);
    SecondOrderSystem::new(one(m), one(c), one(k)).unwrap()
}

fn released(x: f64, v: f64) -> InitialState {
    InitialState::new(dvector![x], dvector![v]).unwrap()
}

fn is_at_rest(scheme: &dyn Scheme) -> bool {
    scheme.conventions().iter().any(|c| c.choice.contains("at rest"))
}

/// All schemes that take nonlinear systems.
fn nonlinear_schemes() -> Vec<Box<dyn Scheme>> {
    schemes().into_iter().filter(|s| s.name() != "matrix exponential").collect()
}

/// sn, cn, dn of u for the parameter m = k², by the descending Landen transformation.
///
/// # Source
/// Abramowitz & Stegun, *Handbook of Mathematical Functions* (1964), section 16.4.
fn jacobi(u: f64, m: f64) -> [f64; 3] {
    let (mut a, mut b, mut c) = (1.0, (1.0 - m).sqrt(), m.sqrt());
    let mut ratios = vec![];
    while c > f64::EPSILON {
        (a, b, c) = (0.5 * (a + b), (a * b).sqrt(), 0.5 * (a - b));
        ratios.push(c / a);
    }
    let mut angle = f64::powi(2.0, ratios.len() as i32) * a * u;
    for ratio in ratios.iter().rev() {
        angle = 0.5 * (angle + (ratio * angle.sin()).asin());
    }
    let (sn, cn) = angle.sin_cos();
    [sn, cn, (1.0 - m * sn * sn).sqrt()]
}

/// Returns x, ẋ and ẍ of ẍ + k x + κ x³ = 0, released at x = `amplitude`: x = amplitude · cn(Ωt).
fn duffing(k: f64, cubic: f64, amplitude: f64, t: f64) -> [f64; 3] {
    let omega = (k + cubic * amplitude * amplitude).sqrt();
    let m = 0.5 * cubic * amplitude * amplitude / (omega * omega);
    let [sn, cn, dn] = jacobi(omega * t, m);
    let x = amplitude * cn;
    [x, -amplitude * omega * sn * dn, -(k * x + cubic * x.powi(3))]
}

/// Checks the closed form itself: Jacobi's functions against the series of sn, and the motion
/// against the differential equation.
///
/// # Source
/// Abramowitz & Stegun, *Handbook of Mathematical Functions* (1964), 16.22.1.
#[test]
fn the_elliptic_functions_are_right() {
    for (u, m) in [(0.05_f64, 0.81_f64), (0.1, 0.4), (-0.1, 0.0)] {
        let [sn, cn, dn] = jacobi(u, m);
        let series = u - (1.0 + m) * u.powi(3) / 6.0 + (1.0 + 14.0 * m + m * m) * u.powi(5) / 120.0
            - (1.0 + 135.0 * m + 135.0 * m * m + m.powi(3)) * u.powi(7) / 5040.0;
        assert!((sn - series).abs() < 1e-11, "{sn} {series}");
        assert!((sn * sn + cn * cn - 1.0).abs() < 1e-15);
        assert!((dn * dn + m * sn * sn - 1.0).abs() < 1e-15);
    }
    for t in [0.3, 1.7, 9.0] {
        let h = 1e-4;
        let [x, v, a] = duffing(1.0, 3.0, 1.2, t);
        let [ahead, behind] = [t + h, t - h].map(|t| duffing(1.0, 3.0, 1.2, t));
        assert!(((ahead[0] - behind[0]) / (2.0 * h) - v).abs() < 1e-6 * v.abs().max(1.0));
        assert!(((ahead[1] - behind[1]) / (2.0 * h) - a).abs() < 1e-6 * a.abs().max(1.0), "{x}");
    }
}

#[test]
fn duffings_oscillator_converges_with_the_order_of_each_scheme() {
    let linear = oscillator(1.0, 0.0, 1.0);
    let cubic = terms("k3: x1^3", &[3.0]);
    let system = SystemWithForces::new(&linear).with(cubic).unwrap();
    let end = 3.0;
    let truth = duffing(1.0, 3.0, 1.2, end);
    for scheme in nonlinear_schemes() {
        let (scheme, name) = (scheme.as_ref(), scheme.name());
        let errors = |steps: usize| {
            let none = still(end / steps as f64, steps + 1, 1);
            let response = integrate(scheme, &system, &none, &released(1.2, 0.0)).unwrap();
            let found = parts(&response).map(|part| part[(steps, 0)]);
            std::array::from_fn::<f64, 3, _>(|i| (found[i] - truth[i]).abs())
        };
        let (coarse, fine) = (errors(400), errors(1600));
        let has = |choice: &str| scheme.conventions().iter().any(|c| c.choice.contains(choice));
        for i in 0..3 {
            let order = (coarse[i] / fine[i]).log2() / 2.0;
            let expected = match () {
                () if name.starts_with("Newmark (β = 0.3025") || is_at_rest(scheme) => 1.0,
                () if name.starts_with("Runge") => 4.0,
                // Without damping, the Fox–Goodwin scheme is Numerov's method, of fourth order
                // except for the velocity.
                () if name.contains("Fox") && i != 1 => 4.0,
                () if i == 2 && has("carried") => 1.0,
                () => 2.0,
            };
            assert!((order - expected).abs() < 0.15, "{name} {i}: {order} {coarse:?} {fine:?}");
        }
    }
}

/// Returns the frequency of Duffing's free motion (the backbone curve), 2π over its period, in
/// rad/s, by the arithmetic-geometric mean.
///
/// # Source
/// Abramowitz & Stegun, *Handbook of Mathematical Functions* (1964), section 17.6.
fn backbone(k: f64, cubic: f64, amplitude: f64) -> f64 {
    let square = k + cubic * amplitude * amplitude;
    let m = cubic * amplitude * amplitude / (2.0 * square);
    let (mut a, mut b) = (1.0, (1.0 - m).sqrt());
    for _ in 0..8 {
        (a, b) = (0.5 * (a + b), f64::sqrt(a * b));
    }
    square.sqrt() * a
}

/// A force equal to the damping force sustains the undamped free motion at the frequency of the
/// backbone curve; this motion is the reference for the orbit. Harmonic balance with one harmonic
/// gives this frequency within 2.2 % at any amplitude.
///
/// # Source
/// Nayfeh & Mook, *Nonlinear Oscillations* (1979), section 4.1.
#[test]
fn an_orbit_whose_losses_are_made_up_for_lies_on_the_backbone() {
    let (k, cubic, c) = (1.0, 1.0, 1.0);
    let linear = oscillator(1.0, c, k);
    let spring = terms("k3: x1^3", &[cubic]);
    let system = SystemWithForces::new(&linear).with(spring).unwrap();
    for amplitude in [0.2, 1.0, 3.0] {
        let omega = backbone(k, cubic, amplitude);
        let balanced = (k + 0.75 * cubic * amplitude * amplitude).sqrt();
        assert!((balanced / omega - 1.0).abs() < 0.023, "{amplitude}: {balanced} {omega}");
        let error = |len: usize| {
            let sampling = Sampling::new(std::f64::consts::TAU / omega / len as f64, len).unwrap();
            let truth = |t: f64| duffing(k, cubic, amplitude, t);
            let force = sampling.times().map(|t| c * truth(t)[1]).collect();
            let force = Record::from_channel(sampling, force).unwrap();
            let start = released(amplitude, 0.0);
            let newmark = Newmark::AVERAGE_ACCELERATION;
            let orbit = periodic_orbit(&newmark, &system, &force, &start, 0).unwrap();
            let x = orbit.response().displacement();
            let missed = sampling.times().zip(x.channel(0)).map(|(t, x)| (x - truth(t)[0]).abs());
            missed.fold(0.0, f64::max) / amplitude
        };
        let [coarse, fine] = [400, 800].map(error);
        assert!(((coarse / fine).log2() - 2.0).abs() < 0.1, "{amplitude}: {coarse:e} {fine:e}");
    }
}

/// Springs and dampers between the second and the fourth of five masses, and a force that depends
/// on time. The external force is such that each mass has the chosen response x = a sin(ωt + φ).
#[test]
fn a_chosen_response_is_met_with_local_forces_in_many_degrees_of_freedom() {
    let n = 5;
    let linear = mechid_problems::random_stable(n, 3);
    let connection = terms(
        "k2: (x2-x4)^2, k3: (x2-x4)^3, c3: (v2-v4)^3, f: tanh((v2-v4)/0.5)",
        &[-30.0, 200.0, 1.5, 3.0],
    );
    let driven = ForceFunction::new(vec![3, 0], |t, x, v, g| {
        g[0] = 20.0 * x[0] * x[1] * (3.0 * t).sin();
        g[1] = 5.0 * v[0] * v[1] + 2.0 * t.cos();
    });
    let system = SystemWithForces::new(&linear).with(connection).unwrap().with(driven).unwrap();
    let chosen = |t: f64| -> [DVector<f64>; 3] {
        let angle = |i: usize| ((1.0 + 0.7 * i as f64) * t + i as f64, 1.0 + 0.7 * i as f64);
        let size = |i: usize| 0.5 - 0.1 * i as f64;
        [
            DVector::from_fn(n, |i, _| size(i) * angle(i).0.sin()),
            DVector::from_fn(n, |i, _| size(i) * angle(i).1 * angle(i).0.cos()),
            DVector::from_fn(n, |i, _| -size(i) * angle(i).1.powi(2) * angle(i).0.sin()),
        ]
    };
    let force = |t: f64, f: &mut [f64]| {
        let [x, v, a] = chosen(t);
        let mut sum = linear.mass() * a + linear.damping() * &v + linear.stiffness() * &x;
        for part in system.nonlinear_forces() {
            let pick =
                |from: &DVector<f64>| part.dofs().iter().map(|&i| from[i]).collect::<Vec<_>>();
            let mut g = vec![0.0; part.dofs().len()];
            part.force(t, &pick(&x), &pick(&v), &mut g);
            part.dofs().iter().zip(g).for_each(|(&i, g)| sum[i] += g);
        }
        f.copy_from_slice(sum.as_slice());
    };
    let start = InitialState::new(chosen(0.0)[0].clone(), chosen(0.0)[1].clone()).unwrap();
    let mut all = nonlinear_schemes();
    all.push(Box::new(RungeKutta4::SUPPLIED));
    for scheme in all.iter().filter(|s| !is_at_rest(s.as_ref())) {
        let (scheme, name) = (scheme.as_ref(), scheme.name());
        let has = |choice: &str| scheme.conventions().iter().any(|c| c.choice.contains(choice));
        let error = |steps: usize| {
            let sampling = Sampling::new(1.0 / steps as f64, steps + 1).unwrap();
            let response = integrate_function(scheme, &system, sampling, &start, force).unwrap();
            let end = response.displacement().data().row(steps).transpose();
            (end - &chosen(1.0)[0]).norm()
        };
        let order = (error(500) / error(1000)).log2();
        let expected = match () {
            () if name.starts_with("Newmark (β = 0.3025") || has("held") => 1.0,
            () if has("supplied") => 4.0,
            () => 2.0,
        };
        assert!((order - expected).abs() < 0.15, "{name}: {order}");
    }
}

/// The same force is given as terms with tangents, as a function without tangents, and as a
/// function of more degrees of freedom than necessary, with dense and with sparse matrices. The
/// response must not change.
#[test]
fn reduction_and_tangents_do_not_change_the_response() {
    let n = 30;
    let chain = band(n, &[(-1, -900.0), (0, 2000.0), (1, -900.0)]);
    let sparse = SparseSystem::new(band(n, &[(0, 1.0)]), &chain * 1e-3, chain).unwrap();
    let dense = mechid_model::Matrix::Mass;
    let matrix = |which| DMatrix::from(sparse.matrix(which));
    let dense = SecondOrderSystem::new(
        matrix(dense),
        matrix(mechid_model::Matrix::Damping),
        matrix(mechid_model::Matrix::Stiffness),
    )
    .unwrap();
    let law = |e: f64| 3e3 * e * e + 4e4 * e.powi(3);
    let element = || terms("k2: (x21-x5)^2, k3: (x21-x5)^3", &[3e3, 4e4]);
    let function = ForceFunction::new(vec![4, 20], move |_, x, _, g| {
        g[1] = law(x[1] - x[0]);
        g[0] = -g[1];
    });
    let wide = ForceFunction::new((0..n).collect(), move |_, x, _, g| {
        g.fill(0.0);
        g[20] = law(x[20] - x[4]);
        g[4] = -g[20];
    });
    let systems: [(&str, SystemWithForces<'_>); 4] = [
        ("terms", SystemWithForces::new(&sparse).with(element()).unwrap()),
        ("dense", SystemWithForces::new(&dense).with(element()).unwrap()),
        ("function", SystemWithForces::new(&sparse).with(function).unwrap()),
        ("wide", SystemWithForces::new(&dense).with(wide).unwrap()),
    ];
    let force = force(Sampling::new(5e-3, 200).unwrap(), n);
    for scheme in nonlinear_schemes() {
        let scheme = scheme.as_ref();
        let rest = InitialState::rest(n);
        let [first, others @ ..] = &systems;
        let truth = integrate(scheme, &first.1, &force, &rest).unwrap();
        let plain = integrate(scheme, &sparse, &force, &rest).unwrap();
        let apart = |one: &mechid_model::Response, other: &mechid_model::Response| {
            (one.displacement().data() - other.displacement().data()).amax()
                / one.displacement().data().amax()
        };
        assert!(apart(&truth, &plain) > 1e-3, "the force matters");
        for (name, system) in others {
            let found = integrate(scheme, system, &force, &rest).unwrap();
            let gap = apart(&truth, &found);
            assert!(gap < 1e-11, "{}, {name}: {gap:e}", scheme.name());
        }
    }
}

/// Systems with one or two degrees of freedom are simulated in steps of fixed size; a simulation of
/// selected degrees of freedom uses the steps of the scheme itself. Both must give the same
/// response.
#[test]
fn steps_of_fixed_size_are_those_of_the_scheme() {
    let one = oscillator(1.0, 0.4, 400.0);
    let two = SecondOrderSystem::new(
        DMatrix::from_row_slice(2, 2, &[1.0, 0.1, 0.0, 2.0]),
        DMatrix::from_row_slice(2, 2, &[0.5, -0.1, 0.2, 0.4]),
        DMatrix::from_row_slice(2, 2, &[900.0, -300.0, -200.0, 700.0]),
    )
    .unwrap();
    let follows = |t: f64, x: f64, v: f64| 3e6 * (x - 0.01 * (5.0 * t).sin()).powi(3) + v * v.abs();
    let systems = [
        ("cubic", SystemWithForces::new(&one).with(terms("k3: x1^3", &[4e5])).unwrap()),
        ("stop", SystemWithForces::new(&one).with(terms("k: gap(x1, 0.002)", &[2e3])).unwrap()),
        (
            "friction and a spring",
            SystemWithForces::new(&two)
                .with(terms("f: tanh(v1/0.05)", &[0.3]))
                .unwrap()
                .with(terms("k2: x1^2, k3: x1^3", &[2e4, 4e5]))
                .unwrap(),
        ),
        (
            "a function of time",
            SystemWithForces::new(&two)
                .with(ForceFunction::new(vec![1], move |t, x, v, g| g[0] = follows(t, x[0], v[0])))
                .unwrap(),
        ),
    ];
    for scheme in nonlinear_schemes() {
        for (name, system) in &systems {
            let (scheme, n) = (scheme.as_ref(), system.dof());
            let force = force(Sampling::new(0.01, 400).unwrap(), n);
            let rest = InitialState::rest(n);
            let all: Vec<usize> = (0..n).collect();
            let dofs = SelectedDofs { forced: &all, observed: &all };
            let fixed = integrate(scheme, system, &force, &rest).unwrap();
            let own = integrate_selected(scheme, system, dofs, &force, &rest).unwrap();
            let linear = integrate(scheme, &system.matrices(), &force, &rest).unwrap();
            for ((fixed, own), linear) in
                parts(&fixed).into_iter().zip(parts(&own)).zip(parts(&linear))
            {
                let (size, what) = (own.amax(), format!("{}, {name}", scheme.name()));
                assert!(
                    (fixed - own).amax() < 1e-9 * size,
                    "{what}: {:e}",
                    (fixed - own).amax() / size
                );
                assert!((linear - own).amax() > 1e-2 * size, "{what}: the force matters");
            }
        }
    }
}

/// A linear spring and damper, given as a nonlinear force, have the effect of terms in K and C.
#[test]
fn a_linear_spring_is_a_part_of_the_stiffness() {
    let soft = Sdof::new(2.0, 0.3, 50.0).unwrap().system();
    let stiff = Sdof::new(2.0, 0.5, 80.0).unwrap().system();
    let spring_and_damper =
        |_: f64, x: &[f64], v: &[f64], g: &mut [f64]| g[0] = 30.0 * x[0] + 0.2 * v[0];
    let system =
        SystemWithForces::new(&soft).with(ForceFunction::new(vec![0], spring_and_damper)).unwrap();
    let force = force(Sampling::new(0.02, 500).unwrap(), 1);
    for scheme in nonlinear_schemes() {
        let scheme = scheme.as_ref();
        let start = if is_at_rest(scheme) { InitialState::rest(1) } else { moving(1) };
        let one = integrate(scheme, &system, &force, &start).unwrap();
        let other = integrate(scheme, &stiff, &force, &start).unwrap();
        for (one, other) in parts(&one).into_iter().zip(parts(&other)) {
            assert!((one - other).amax() < 1e-10 * other.amax(), "{}", scheme.name());
        }
    }
}

/// The displacement is linear in time between the two stops, and half a sine in contact with a
/// stop. After one period the mass must be back at x = 0, and its largest displacement must agree
/// with the closed form.
#[test]
fn a_mass_between_stops_comes_back_in_time() {
    let (clearance, stiffness, speed) = (0.1, 400.0, 2.0);
    let free = oscillator(1.0, 0.0, 0.0);
    let stops = terms("k: gap(x1, 0.1)", &[stiffness]);
    let system = SystemWithForces::new(&free).with(stops).unwrap();
    let period = 4.0 * clearance / speed + 2.0 * std::f64::consts::PI / f64::sqrt(stiffness);
    let steps = 4000;
    for scheme in nonlinear_schemes().iter().filter(|s| !is_at_rest(s.as_ref())) {
        let none = still(period / f64::from(steps), steps as usize + 1, 1);
        let response = integrate(scheme.as_ref(), &system, &none, &released(0.0, speed)).unwrap();
        let x = response.displacement().channel(0);
        let (end, most) = (x[steps as usize], response.displacement().column(0).amax());
        let name = scheme.name();
        // After one period, the error of a scheme of first order is about 1e-3 of the distance that
        // the mass has travelled.
        let first_order = name.starts_with("Newmark (β = 0.3025");
        let near = if first_order { 5e-3 } else { 1e-4 };
        assert!(end.abs() < near, "{name}: {end}");
        let expected = clearance + speed / f64::sqrt(stiffness);
        assert!((most / expected - 1.0).abs() < near, "{name}: {most}");
    }
}

/// The velocity is compared with two closed forms. Friction, ẍ = −(μ/m) tanh(ẋ/w), makes sinh(ẋ/w)
/// decrease as e^{−μt/mw}. Drag, ẍ = −(c/m) ẋ² for ẋ > 0, makes 1/ẋ increase as ct/m.
#[test]
fn friction_and_drag_slow_a_mass_as_they_should() {
    let free = oscillator(2.0, 0.0, 0.0);
    let (limit, width, speed, end) = (0.8, 0.2_f64, 1.5, 4.0);
    let rubbed = SystemWithForces::new(&free).with(terms("f: tanh(v1/0.2)", &[limit])).unwrap();
    let dragged = SystemWithForces::new(&free).with(terms("c2: v1^2", &[0.6])).unwrap();
    let rubbing = width * ((speed / width).sinh() * (-limit * end / (2.0 * width)).exp()).asinh();
    let dragging = 1.0 / (1.0 / speed + 0.6 * end / 2.0);
    for scheme in nonlinear_schemes().iter().filter(|s| !is_at_rest(s.as_ref())) {
        for (system, truth) in [(&rubbed, rubbing), (&dragged, dragging)] {
            let none = still(end / 2000.0, 2001, 1);
            let response =
                integrate(scheme.as_ref(), system, &none, &released(0.0, speed)).unwrap();
            let found = response.velocity().channel(0)[2000];
            let name = scheme.name();
            let near = if name.starts_with("Newmark (β = 0.3025") { 3e-3 } else { 1e-4 };
            assert!((found - truth).abs() < near * speed, "{name}: {found} {truth}");
        }
    }
}

#[test]
fn the_energy_of_duffings_oscillator_does_not_drift() {
    let linear = oscillator(1.0, 0.0, 1.0);
    let cubic = terms("k3: x1^3", &[3.0]);
    let system = SystemWithForces::new(&linear).with(cubic).unwrap();
    // The motion has an amplitude of 1.2 and a period of about 2.9 s; the record has 500 periods.
    let worst = |scheme: &dyn Scheme, dt: f64| {
        let steps = (1450.0 / dt) as usize;
        let none = still(dt, steps + 1, 1);
        let response = integrate(scheme, &system, &none, &released(1.2, 0.0)).unwrap();
        let [x, v] = [response.displacement(), response.velocity()].map(|r| r.channel(0));
        let energy = |k: usize| 0.5 * v[k] * v[k] + 0.5 * x[k] * x[k] + 0.75 * x[k].powi(4);
        let gap = |k: usize| (energy(k) / energy(0) - 1.0).abs();
        let early = (0..steps / 50).map(gap).fold(0.0, f64::max);
        let all = (0..=steps).map(gap).fold(0.0, f64::max);
        (early, all)
    };
    for scheme in [&Newmark::AVERAGE_ACCELERATION as &dyn Scheme, &CentralDifference::default()] {
        let ((early, all), (_, fine)) = (worst(scheme, 0.02), worst(scheme, 0.01));
        let name = scheme.name();
        // The energy oscillates within each period, by as much at the end as at the beginning.
        assert!(all < 1.05 * early && all < 2e-3, "{name}: {early:e} {all:e}");
        assert!((all / fine - 4.0).abs() < 0.2, "{name}: {all:e} {fine:e}");
    }
    // A scheme with numerical damping changes the energy, here by less than 5 %.
    let (_, lost) = worst(&GeneralisedAlpha::new(0.8).unwrap(), 0.02);
    assert!(lost < 0.05, "{lost}");
}

#[test]
fn what_newtons_method_cannot_solve_is_an_error() {
    let free = oscillator(1.0, 0.0, 100.0);
    // Dry friction with a jump: while the mass sticks, no velocity gives equilibrium.
    let sticking = ForceFunction::new(vec![0], |_, _, v, g| g[0] = 50.0 * v[0].signum());
    let not_a_number = ForceFunction::new(vec![0], |t, _, _, g| g[0] = (0.25 - t).sqrt());
    let force = force(Sampling::new(0.01, 100).unwrap(), 1);
    let of = |scheme: &dyn Scheme, system: &SystemWithForces<'_>| {
        integrate(scheme, system, &force, &InitialState::rest(1))
    };
    let sticking = SystemWithForces::new(&free).with(sticking).unwrap();
    let not_a_number = SystemWithForces::new(&free).with(not_a_number).unwrap();
    for scheme in nonlinear_schemes() {
        let (scheme, name) = (scheme.as_ref(), scheme.name());
        let refused = of(scheme, &not_a_number).err();
        // Explicit schemes write the NaN into the response; implicit schemes find no solution.
        match refused {
            Some(IntegrateError::NotSolved { time, .. }) => {
                assert!((0.24..0.29).contains(&time), "{name}: {time}");
            }
            Some(IntegrateError::Overflow { sample, .. }) => assert!((25..28).contains(&sample)),
            other => panic!("{name}: {other:?}"),
        }
    }
    let refused = of(&Newmark::AVERAGE_ACCELERATION, &sticking);
    assert!(matches!(refused, Err(IntegrateError::NotSolved { .. })), "{refused:?}");
}

#[test]
fn what_is_for_linear_systems_refuses_others() {
    let linear = oscillator(1.0, 0.1, 1.0);
    let system = SystemWithForces::new(&linear).with(terms("k3: x1^3", &[1.0])).unwrap();
    let refused = MatrixExponential::LINEAR.prepare(&system, 0.1).err();
    assert!(matches!(refused, Some(IntegrateError::LinearOnly { .. })));
    let force = still(0.1, 8, 1);
    let refused = integrate_periodic(&Newmark::AVERAGE_ACCELERATION, &system, &force);
    assert!(matches!(refused, Err(IntegrateError::LinearOnly { .. })));
    let outside = terms("k3: (x1-x2)^3", &[1.0]);
    let refused = SystemWithForces::new(&linear).with(outside).err();
    assert_eq!(refused, Some(IntegrateError::DofOutside { index: 1, dof: 1 }));
    let twice = ForceFunction::new(vec![0, 0], |_, x, _, g| g.copy_from_slice(x));
    let refused = SystemWithForces::new(&linear).with(twice).err();
    assert_eq!(refused, Some(IntegrateError::ForcedTwice { index: 0 }));
    // Stability is checked for the linear part only.
    let step = CentralDifference::default().prepare(&system, 2.1).err();
    assert!(matches!(step, Some(IntegrateError::Unstable { .. })));
}
