//! Time loops that a programmer would write for one system, as fast as plain code allows.

use mechid_model::SecondOrderSystem;
use mechid_signal::Record;
use nalgebra::{DMatrix, DVector, Matrix2, Matrix4, Vector2, Vector4};

/// A time loop that starts from rest under a force. It returns x, ẋ and ẍ, or x and two empty
/// vectors.
pub type Loop = fn(&SecondOrderSystem, &Record) -> [Vec<f64>; 3];

/// Returns the loops for `dof` degrees of freedom. They store x, ẋ and ẍ if `ALL`, otherwise only
/// x.
pub fn loops<const ALL: bool>(dof: usize) -> Vec<(&'static str, Loop)> {
    match dof {
        1 if ALL => vec![
            ("Newmark, textbook", textbook::<ALL> as Loop),
            ("Newmark, transition", transition_1::<ALL>),
        ],
        1 => vec![
            ("Newmark, textbook", textbook::<ALL> as Loop),
            ("Newmark, transition", transition_1::<ALL>),
            ("Newmark, x from the two before", two_before),
        ],
        2 => vec![
            ("Newmark, fixed size", fixed_2::<ALL> as Loop),
            ("Newmark, transition", transition_2::<ALL>),
        ],
        _ => vec![
            ("Newmark, dense kernels", dense_newmark::<ALL> as Loop),
            ("Runge-Kutta, dense kernels", dense_runge_kutta::<ALL>),
        ],
    }
}

fn empty<const ALL: bool>(len: usize) -> [Vec<f64>; 3] {
    let kept = if ALL { len } else { 0 };
    [len, kept, kept].map(|len| vec![0.0; len])
}

/// Runs the recurrence of the textbooks with average acceleration.
fn textbook<const ALL: bool>(system: &SecondOrderSystem, force: &Record) -> [Vec<f64>; 3] {
    let (m, c, k) = (system.mass()[0], system.damping()[0], system.stiffness()[0]);
    let (dt, f) = (force.sampling().dt(), force.channel(0));
    let (a0, a1, a2, a3) = (4.0 / (dt * dt), 2.0 / dt, 4.0 / dt, 1.0);
    let effective = k + a0 * m + a1 * c;
    let [mut xs, mut vs, mut accs] = empty::<ALL>(f.len());
    let (mut x, mut v, mut a) = (0.0, 0.0, f[0] / m);
    if ALL {
        accs[0] = a;
    }
    for i in 1..f.len() {
        let load = f[i] + m * (a0 * x + a2 * v + a3 * a) + c * (a1 * x + v);
        let new = load / effective;
        let acc = a0 * (new - x) - a2 * v - a3 * a;
        v += 0.5 * dt * (a + acc);
        (x, a) = (new, acc);
        xs[i] = x;
        if ALL {
            (vs[i], accs[i]) = (v, a);
        }
    }
    [xs, vs, accs]
}

/// Runs z(t+Δt) = A z + B₀ F(t) + B₁ F(t+Δt) on z = (x, ẋ), the trapezoidal rule in closed form.
fn transition_1<const ALL: bool>(system: &SecondOrderSystem, force: &Record) -> [Vec<f64>; 3] {
    let (m, c, k) = (system.mass()[0], system.damping()[0], system.stiffness()[0]);
    let (dt, f) = (force.sampling().dt(), force.channel(0));
    let (h, q) = (0.5 * dt, 0.25 * dt * dt);
    let d = m + h * c + q * k;
    let (xx, xv, xf) = ((m + h * c - q * k) / d, dt * m / d, q / d);
    let (vx, vv, vf) = (-dt * k / d, (m - h * c - q * k) / d, h / d);
    let (ax, av, af) = (-k / m, -c / m, 1.0 / m);
    let [mut xs, mut vs, mut accs] = empty::<ALL>(f.len());
    let (mut x, mut v) = (0.0, 0.0);
    if ALL {
        accs[0] = f[0] / m;
    }
    for i in 1..f.len() {
        let pair = f[i - 1] + f[i];
        (x, v) = (xx * x + (xv * v + xf * pair), vx * x + (vv * v + vf * pair));
        xs[i] = x;
        if ALL {
            (vs[i], accs[i]) = (v, af * f[i] + (ax * x + av * v));
        }
    }
    [xs, vs, accs]
}

/// Computes x(t+Δt) from x(t) and x(t−Δt), with the velocity eliminated. This is the shortest
/// possible step; it loses digits in the difference of neighbouring displacements.
fn two_before(system: &SecondOrderSystem, force: &Record) -> [Vec<f64>; 3] {
    let (m, c, k) = (system.mass()[0], system.damping()[0], system.stiffness()[0]);
    let (dt, f) = (force.sampling().dt(), force.channel(0));
    let (h, q) = (0.5 * dt, 0.25 * dt * dt);
    let d = m + h * c + q * k;
    let (first, second, load) = (2.0 * (m - q * k) / d, (m - h * c + q * k) / d, q / d);
    let mut xs = vec![0.0; f.len()];
    let (mut x, mut before) = (load * (f[0] + f[1]), 0.0);
    xs[1] = x;
    for i in 2..f.len() {
        let next = load * (f[i] + 2.0 * f[i - 1] + f[i - 2]) - second * before + first * x;
        (x, before) = (next, x);
        xs[i] = x;
    }
    [xs, vec![], vec![]]
}

/// Runs Newmark's recurrence with matrices of fixed size; the effective matrix is inverted
/// beforehand.
fn fixed_2<const ALL: bool>(system: &SecondOrderSystem, force: &Record) -> [Vec<f64>; 3] {
    let fixed = |m: &DMatrix<f64>| Matrix2::from_fn(|i, j| m[(i, j)]);
    let (m, c, k) = (fixed(system.mass()), fixed(system.damping()), fixed(system.stiffness()));
    let (dt, len) = (force.sampling().dt(), force.len());
    let effective = m + c * (0.5 * dt) + k * (0.25 * dt * dt);
    let inverse = effective.lu().solve(&Matrix2::identity()).expect("regular");
    let (f0, f1) = (force.channel(0), force.channel(1));
    let [mut xs, mut vs, mut accs] = empty::<ALL>(2 * len);
    let (mut x, mut v) = (Vector2::zeros(), Vector2::zeros());
    let mut a = m.lu().solve(&Vector2::new(f0[0], f1[0])).expect("regular");
    if ALL {
        (accs[0], accs[len]) = (a[0], a[1]);
    }
    for i in 1..len {
        let (x_hat, v_hat) = (x + dt * v + 0.25 * dt * dt * a, v + 0.5 * dt * a);
        a = inverse * (Vector2::new(f0[i], f1[i]) - c * v_hat - k * x_hat);
        x = x_hat + 0.25 * dt * dt * a;
        v = v_hat + 0.5 * dt * a;
        for d in 0..2 {
            xs[d * len + i] = x[d];
            if ALL {
                (vs[d * len + i], accs[d * len + i]) = (v[d], a[d]);
            }
        }
    }
    [xs, vs, accs]
}

/// Runs the trapezoidal rule with one product by a 4×4 matrix in each step; (I − ½ΔtS)⁻¹ is
/// computed beforehand.
fn transition_2<const ALL: bool>(system: &SecondOrderSystem, force: &Record) -> [Vec<f64>; 3] {
    let (dt, len) = (force.sampling().dt(), force.len());
    let s = Matrix4::from_fn(|i, j| system.state_matrix()[(i, j)]);
    let mass = Matrix2::from_fn(|i, j| system.mass()[(i, j)]);
    let compliance = mass.lu().solve(&Matrix2::identity()).expect("regular");
    let implicit = (Matrix4::identity() - s * (0.5 * dt)).lu();
    let a = implicit.solve(&(Matrix4::identity() + s * (0.5 * dt))).expect("regular");
    let mut lift = nalgebra::Matrix4x2::zeros();
    lift.fixed_view_mut::<2, 2>(2, 0).copy_from(&(compliance * (0.5 * dt)));
    let b = implicit.solve(&lift).expect("regular");
    let lower = s.fixed_rows::<2>(2).into_owned();
    let (f0, f1) = (force.channel(0), force.channel(1));
    let [mut xs, mut vs, mut accs] = empty::<ALL>(2 * len);
    let mut z = Vector4::zeros();
    let mut before = Vector2::new(f0[0], f1[0]);
    if ALL {
        let first = compliance * before;
        (accs[0], accs[len]) = (first[0], first[1]);
    }
    for i in 1..len {
        let now = Vector2::new(f0[i], f1[i]);
        z = a * z + b * (before + now);
        before = now;
        for d in 0..2 {
            xs[d * len + i] = z[d];
        }
        if ALL {
            let acc = lower * z + compliance * now;
            for d in 0..2 {
                (vs[d * len + i], accs[d * len + i]) = (z[d + 2], acc[d]);
            }
        }
    }
    [xs, vs, accs]
}

/// Runs Newmark's method with dense kernels: two products and one solve with existing factors per
/// step.
fn dense_newmark<const ALL: bool>(system: &SecondOrderSystem, force: &Record) -> [Vec<f64>; 3] {
    let (n, len, dt) = (system.dof(), force.len(), force.sampling().dt());
    let (c, k) = (system.damping(), system.stiffness());
    let effective = (system.mass() + c * (0.5 * dt) + k * (0.25 * dt * dt)).lu();
    let [mut xs, mut vs, mut accs] = empty::<ALL>(n * len);
    let (mut x, mut v) = (DVector::zeros(n), DVector::zeros(n));
    let mut a =
        system.mass().clone().lu().solve(&force.data().row(0).transpose()).expect("regular");
    if ALL {
        (0..n).for_each(|d| accs[d * len] = a[d]);
    }
    for i in 1..len {
        x.axpy(dt, &v, 1.0);
        x.axpy(0.25 * dt * dt, &a, 1.0);
        v.axpy(0.5 * dt, &a, 1.0);
        for d in 0..n {
            a[d] = force.data()[(i, d)];
        }
        a.gemv(-1.0, c, &v, 1.0);
        a.gemv(-1.0, k, &x, 1.0);
        effective.solve_mut(&mut a);
        x.axpy(0.25 * dt * dt, &a, 1.0);
        v.axpy(0.5 * dt, &a, 1.0);
        for d in 0..n {
            xs[d * len + i] = x[d];
            if ALL {
                (vs[d * len + i], accs[d * len + i]) = (v[d], a[d]);
            }
        }
    }
    [xs, vs, accs]
}

/// Runs the Runge–Kutta method with dense kernels: two products and one solve with existing factors
/// per stage.
fn dense_runge_kutta<const ALL: bool>(system: &SecondOrderSystem, force: &Record) -> [Vec<f64>; 3] {
    let (n, len, dt) = (system.dof(), force.len(), force.sampling().dt());
    let mass = system.mass().clone().lu();
    let slope = |x: &DVector<f64>, v: &DVector<f64>, a: &mut DVector<f64>| {
        a.gemv(-1.0, system.damping(), v, 1.0);
        a.gemv(-1.0, system.stiffness(), x, 1.0);
        mass.solve_mut(a);
    };
    let [mut xs, mut vs, mut accs] = empty::<ALL>(n * len);
    let (mut x, mut v, mut a) = (DVector::zeros(n), DVector::zeros(n), DVector::zeros(n));
    let [mut dx, mut dv, mut xi, mut vi, mut ai] = [(); 5].map(|()| DVector::zeros(n));
    for i in 0..len {
        for d in 0..n {
            a[d] = force.data()[(i, d)];
        }
        slope(&x, &v, &mut a);
        for d in 0..n {
            xs[d * len + i] = x[d];
            if ALL {
                (vs[d * len + i], accs[d * len + i]) = (v[d], a[d]);
            }
        }
        let next = (i + 1).min(len - 1);
        dx.fill(0.0);
        dv.fill(0.0);
        vi.copy_from(&v);
        ai.copy_from(&a);
        for (weight, h, at_end) in
            [(1.0, 0.5, 0.5), (2.0, 0.5, 0.5), (2.0, 1.0, 1.0), (1.0, 0.0, 1.0)]
        {
            dx.axpy(weight * dt / 6.0, &vi, 1.0);
            dv.axpy(weight * dt / 6.0, &ai, 1.0);
            if h == 0.0 {
                break;
            }
            xi.copy_from(&x);
            xi.axpy(h * dt, &vi, 1.0);
            vi.copy_from(&v);
            vi.axpy(h * dt, &ai, 1.0);
            for d in 0..n {
                let (now, then) = (force.data()[(i, d)], force.data()[(next, d)]);
                ai[d] = now + at_end * (then - now);
            }
            slope(&xi, &vi, &mut ai);
        }
        x += &dx;
        v += &dv;
    }
    [xs, vs, accs]
}
