//! Initial poles: clusters of the roots that a subspace method finds from the lines, for many
//! orders.
//!
//! The band is mapped to most of the unit circle, z = e^{j(ω − ω_a)Δ}; block rows are the lines
//! times powers of z. The products of two block rows depend only on the difference of the powers,
//! so one correlation per lag gives all products. Past inputs and outputs are the instruments;
//! future inputs and the transient of each record are projected out.
//!
//! # Source
//! McKelvey, Akçay & Ljung, IEEE Trans. Automatic Control 41 (1996) 960 (subspace on spectral
//! lines); Verhaegen, Automatica 30 (1994) 61 (past inputs and outputs as instruments).

use std::f64::consts::TAU;

use faer::prelude::{Solve, SolveLstsq};
use faer::{Mat, Side};
use mechid_spectra::LineData;
use nalgebra::{Complex, DVector};
use rayon::prelude::*;

use crate::ModalError;
use crate::limits::{
    CIRCLE_SHARE, CLUSTER_DAMPING, CLUSTER_FREQUENCY, MAX_COMPONENTS, MAX_INITIAL_DAMPING,
    MIN_ORDER_SHARE, SUBSPACE_SHIFTS,
};
use crate::lines::Lines;
use crate::stabilisation::{Pole, Stabilisation};

type C = Complex<f64>;

/// Regularisation of a product matrix, relative to the mean of its diagonal.
const RIDGE: f64 = 1e-10;
/// Maximum number of orders whose roots are compared.
const ORDERS: usize = 16;
/// Largest order.
const MAX_ORDER: usize = 72;
/// Largest number of block rows times channels.
const MAX_ROWS: usize = 520;

/// Root that the subspace method finds for one order.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Root {
    pub(crate) pole: C,
    pub(crate) order: usize,
    /// |pole|, which is needed for every pair of roots.
    size: f64,
}

impl Root {
    pub(crate) fn new(pole: C, order: usize) -> Self {
        Self { pole, order, size: pole.norm() }
    }

    fn damping(&self) -> f64 {
        -self.pole.re / self.size
    }
}

/// Returns the poles on which the orders of the subspace method agree.
pub(crate) fn initial_poles(lines: &Lines) -> Result<Vec<C>, ModalError> {
    let (roots, orders) = subspace_roots(lines)?;
    Ok(clusters(roots, orders))
}

/// Returns the poles of the subspace models of rising order. The poles on which these orders agree
/// are the initial poles of the identification. The vector of each pole has a single entry of 1,
/// because these models are compared by their poles only.
///
/// # Errors
/// As [`identify_modes`](crate::identify_modes).
pub fn stabilisation_of(data: &LineData) -> Result<Stabilisation, ModalError> {
    let lines = Lines::new(data);
    lines.check()?;
    let (roots, _) = subspace_roots(&lines)?;
    let vector = DVector::from_element(1, C::from(1.0));
    let pole = |root: &Root| Pole { pole: root.pole, vector: vector.clone() };
    let models = roots.chunk_by(|a, b| a.order == b.order);
    let models = models.map(|model| (model[0].order, model.iter().map(pole).collect()));
    Ok(Stabilisation::new(models.collect()))
}

/// Returns the number of initial modes, before the modes are tested. It is the number of poles on
/// which the orders of the subspace method agree.
///
/// # Errors
/// As [`identify_modes`](crate::identify_modes).
pub fn initial_mode_count(data: &LineData) -> Result<usize, ModalError> {
    let lines = Lines::new(data);
    lines.check()?;
    Ok(initial_poles(&lines)?.len())
}

/// Returns the roots in the band for a range of orders, and the number of orders.
pub(crate) fn subspace_roots(lines: &Lines) -> Result<(Vec<Root>, usize), ModalError> {
    let channels = leading_components(lines)?;
    let Some(shifts) = shifts(lines, channels.len()) else {
        return Ok((Vec::new(), 1));
    };
    let (low, high) = lines.band();
    let step = TAU * CIRCLE_SHARE / (high - low);
    let products = Products::new(lines, &channels, shifts, low, step)?;
    let basis = products.observability()?;
    let largest = (basis.nrows() - channels.len()).min(basis.ncols()).min(MAX_ORDER);
    let smallest = (largest / 4).max(2).min(largest);
    let count = ORDERS.min(largest - smallest + 1);
    let order = |k: usize| smallest + (largest - smallest) * k / count.saturating_sub(1).max(1);
    let mut orders: Vec<usize> = (0..count).map(order).collect();
    orders.dedup();
    let roots: Result<Vec<Vec<C>>, ModalError> =
        orders.par_iter().map(|order| shift_roots(&basis, channels.len(), *order)).collect();
    let mut retained = Vec::new();
    for (roots, order) in roots?.into_iter().zip(&orders) {
        for z in roots {
            let rate = z.ln();
            let turns = if rate.im < 0.0 { TAU } else { 0.0 };
            let pole = C::new(rate.re / step, low + (rate.im + turns) / step);
            if pole.re < 0.0 && pole.im > low && pole.im < high {
                retained.push(Root::new(pole, *order));
            }
        }
    }
    retained.retain(|root| root.damping() < MAX_INITIAL_DAMPING);
    Ok((retained, orders.len()))
}

/// Returns the number of block rows; `None` if fewer than three are possible.
fn shifts(lines: &Lines, components: usize) -> Option<usize> {
    let channels = lines.inputs() + components;
    let wanted = (2 * MAX_ORDER / components).max(SUBSPACE_SHIFTS);
    let bound = (MAX_ROWS / channels).min(lines.len() / (2 * (2 * channels + 1)));
    Some(wanted.min(bound)).filter(|shifts| *shifts >= 3)
}

/// Returns the leading principal components of the outputs, each output scaled to its level.
fn leading_components(lines: &Lines) -> Result<Vec<Vec<C>>, ModalError> {
    let scaled: Vec<Vec<C>> = lines
        .outputs
        .iter()
        .map(|output| {
            let power = output.iter().map(|z| z.norm_sqr()).sum::<f64>() / output.len() as f64;
            output.iter().map(|z| z / power.sqrt()).collect()
        })
        .collect();
    let outputs = scaled.len();
    if outputs <= MAX_COMPONENTS {
        return Ok(scaled);
    }
    let product = |a: &Vec<C>, b: &Vec<C>| a.iter().zip(b).map(|(a, b)| a * b.conj()).sum::<C>();
    let gram = Mat::from_fn(outputs, outputs, |a, b| product(&scaled[a], &scaled[b]));
    let eigen = gram
        .self_adjoint_eigen(Side::Lower)
        .map_err(|_| ModalError::Decomposition { what: "outputs", size: outputs })?;
    let component = |rank: usize| -> Vec<C> {
        let direction = eigen.U().col(outputs - 1 - rank);
        let value = |line: usize| -> C {
            (0..outputs).map(|output| direction[output].conj() * scaled[output][line]).sum()
        };
        (0..lines.len()).map(value).collect()
    };
    Ok((0..MAX_COMPONENTS).into_par_iter().map(component).collect())
}

/// Products of all block rows: future inputs, then past inputs and outputs, then future outputs.
struct Products {
    inputs: usize,
    outputs: usize,
    shifts: usize,
    gram: Mat<C>,
}

impl Products {
    fn new(
        lines: &Lines,
        components: &[Vec<C>],
        shifts: usize,
        low: f64,
        step: f64,
    ) -> Result<Self, ModalError> {
        let (inputs, outputs) = (lines.inputs(), components.len());
        let mut products = Self { inputs, outputs, shifts, gram: Mat::zeros(0, 0) };
        let size = 2 * shifts * (inputs + outputs);
        products.gram = Mat::zeros(size, size);
        let levels: Vec<f64> = (0..inputs).map(|load| lines.load_level(load)).collect();
        let mut from = 0;
        while from < lines.blocks.len() {
            let same = |b: &usize| lines.blocks[*b].active == lines.blocks[from].active;
            let open = lines.blocks[from].delay.is_some();
            let count = (from..lines.blocks.len()).take_while(same).count();
            let rows = lines.blocks[from].rows.start..lines.blocks[from + count - 1].rows.end;
            let mut channels: Vec<Vec<C>> = Vec::new();
            for (load, level) in levels.iter().enumerate() {
                let acts = lines.blocks[from].active.contains(&load);
                let value = |row| if acts { lines.load(load, row) / *level } else { C::default() };
                channels.push(rows.clone().map(value).collect());
            }
            channels.extend(components.iter().map(|component| component[rows.clone()].to_vec()));
            if open {
                channels.push(vec![C::new(1.0, 0.0); rows.len()]);
            }
            let turn: Vec<C> = lines.omega[rows].iter().map(|w| C::cis((w - low) * step)).collect();
            products.add(&lags(&channels, &turn, 2 * shifts), open)?;
            from += count;
        }
        Ok(products)
    }

    /// Returns channel and power of z for each row.
    fn rows(&self) -> Vec<(usize, isize)> {
        let (inputs, all) = (self.inputs, self.inputs + self.outputs);
        let shifts = self.shifts as isize;
        let block = |channels: std::ops::Range<usize>, powers: std::ops::Range<isize>| {
            powers.flat_map(move |power| channels.clone().map(move |channel| (channel, power)))
        };
        block(0..inputs, 0..shifts)
            .chain(block(0..all, -shifts..0))
            .chain(block(inputs..all, 0..shifts))
            .collect()
    }

    /// Adds the products of one record after its transient has been projected out.
    fn add(&mut self, lags: &Lags, open: bool) -> Result<(), ModalError> {
        let rows = self.rows();
        let size = rows.len();
        let part = Mat::from_fn(size, size, |a, b| lags.correlation(rows[a], rows[b]));
        self.gram += &part;
        if open {
            let transient: Vec<(usize, isize)> = (0..self.shifts)
                .map(|power| (self.inputs + self.outputs, power as isize))
                .collect();
            let gram = Mat::from_fn(transient.len(), transient.len(), |a, b| {
                lags.correlation(transient[a], transient[b])
            });
            let cross =
                Mat::from_fn(transient.len(), size, |a, b| lags.correlation(transient[a], rows[b]));
            self.gram -= cross.adjoint() * solve_ridged(gram, &cross)?;
        }
        Ok(())
    }

    /// Returns the leading directions of the future outputs that the past explains.
    fn observability(&self) -> Result<Mat<C>, ModalError> {
        let future = self.inputs * self.shifts;
        let past = (self.inputs + self.outputs) * self.shifts;
        let size = self.gram.nrows();
        let projected = if future == 0 {
            self.gram.clone()
        } else {
            let inputs = self.gram.submatrix(0, 0, future, future).to_owned();
            let cross = self.gram.submatrix(0, future, future, size - future).to_owned();
            let remainder = self.gram.submatrix(future, future, size - future, size - future);
            remainder - cross.adjoint() * solve_ridged(inputs, &cross)?
        };
        let outputs = self.outputs * self.shifts;
        let instruments = projected.submatrix(0, 0, past, past).to_owned();
        let cross = projected.submatrix(0, past, past, outputs).to_owned();
        let explained = cross.adjoint() * solve_ridged(instruments, &cross)?;
        let failed = ModalError::Decomposition { what: "future outputs", size: outputs };
        let eigen = explained.self_adjoint_eigen(Side::Lower).map_err(|_| failed)?;
        let count = outputs.min(MAX_ORDER);
        let basis = eigen.U();
        Ok(Mat::from_fn(outputs, count, |row, rank| basis[(row, outputs - 1 - rank)]))
    }
}

/// Solves a system of equations with a Hermitian matrix of products and [`RIDGE`] on its diagonal.
fn solve_ridged(mut matrix: Mat<C>, right: &Mat<C>) -> Result<Mat<C>, ModalError> {
    let size = matrix.nrows();
    let trace = (0..size).map(|k| matrix[(k, k)].re).sum::<f64>();
    for k in 0..size {
        matrix[(k, k)] += C::from(RIDGE * trace / size.max(1) as f64 + f64::MIN_POSITIVE);
    }
    match matrix.llt(Side::Lower) {
        Ok(factor) => Ok(factor.solve(right)),
        Err(_) => Err(ModalError::Decomposition { what: "products of inputs and outputs", size }),
    }
}

/// Products of two channels and a power of z, summed over the lines.
struct Lags {
    channels: usize,
    /// Σ z^lag v_a v_b* over the lines, for the channels a and b: `[lag][a + channels · b]`.
    sums: Vec<Vec<C>>,
}

impl Lags {
    fn correlation(&self, (a, i): (usize, isize), (b, j): (usize, isize)) -> C {
        if i >= j {
            self.sums[(i - j) as usize][a + self.channels * b]
        } else {
            self.sums[(j - i) as usize][b + self.channels * a].conj()
        }
    }
}

fn lags(channels: &[Vec<C>], turn: &[C], count: usize) -> Lags {
    let n = channels.len();
    let conjugate: Vec<C> = channels.iter().flat_map(|v| v.iter().map(C::conj)).collect();
    let right = faer::MatRef::from_column_major_slice(&conjugate, turn.len(), n);
    let sum = |lag: usize| -> Vec<C> {
        let power: Vec<C> = turn.iter().map(|z| z.powu(lag as u32)).collect();
        let shift = |v: &Vec<C>| v.iter().zip(&power).map(|(v, z)| v * z).collect::<Vec<C>>();
        let shifted: Vec<C> = channels.iter().flat_map(shift).collect();
        let shifted = faer::MatRef::from_column_major_slice(&shifted, turn.len(), n);
        let product = shifted.transpose() * right;
        (0..n).flat_map(|b| (0..n).map(move |a| (a, b))).map(|(a, b)| product[(a, b)]).collect()
    };
    Lags { channels: n, sums: (0..count).into_par_iter().map(sum).collect() }
}

/// Returns the `order` eigenvalues of the shift matrix, which follows from the first `order`
/// columns of `basis`.
fn shift_roots(basis: &Mat<C>, outputs: usize, order: usize) -> Result<Vec<C>, ModalError> {
    let rows = basis.nrows() - outputs;
    let upper = basis.submatrix(0, 0, rows, order).to_owned();
    let lower = basis.submatrix(outputs, 0, rows, order).to_owned();
    let shift = upper.qr().solve_lstsq(&lower);
    let failed = ModalError::Decomposition { what: "the shift of the block rows", size: order };
    let finite =
        (0..order).all(|k| shift.col(k).iter().all(|z| z.re.is_finite() && z.im.is_finite()));
    if !finite {
        return Err(failed);
    }
    shift.eigenvalues().map_err(|_| failed)
}

/// Returns the medians of the clusters that the roots of all orders form, sorted by frequency.
///
/// The cluster with the most orders is taken first; roots within 0.3 half-widths of the median of
/// this cluster belong to it and are removed.
pub(crate) fn clusters(roots: Vec<Root>, orders: usize) -> Vec<C> {
    let mut remaining = roots;
    let mut poles = Vec::new();
    let least = (MIN_ORDER_SHARE * orders as f64).max(1.0);
    while let Some(members) = largest_cluster(&remaining) {
        if (distinct_orders(&members) as f64) < least {
            break;
        }
        let median = |part: fn(&Root) -> f64| {
            let mut values: Vec<f64> = members.iter().map(part).collect();
            values.sort_by(f64::total_cmp);
            values[values.len() / 2]
        };
        let centre = C::new(median(|root| root.pole.re), median(|root| root.pole.im));
        let size = centre.norm();
        let radius = (-0.3 * centre.re).max(5e-5 * size);
        let is_member = |root: &Root| members.iter().any(|member| member.pole == root.pole);
        remaining.retain(|root| !is_member(root) && (root.size - size).abs() >= radius);
        poles.push(centre);
    }
    poles.sort_by(|a: &C, b: &C| a.im.total_cmp(&b.im));
    poles
}

fn largest_cluster(roots: &[Root]) -> Option<Vec<Root>> {
    let near = |centre: &Root| -> Vec<Root> {
        let (size, damping) = (centre.size, centre.damping());
        let radius = CLUSTER_FREQUENCY.min((2.0 * damping).max(4e-4)) * size;
        let is_near = |root: &&Root| {
            (root.size - size).abs() < radius
                && (root.damping() - damping).abs() < CLUSTER_DAMPING * damping + 1e-4
        };
        roots.iter().filter(is_near).copied().collect()
    };
    let clusters = roots.iter().map(near);
    clusters.max_by_key(|members| distinct_orders(members))
}

fn distinct_orders(members: &[Root]) -> usize {
    let mut orders: Vec<usize> = members.iter().map(|root| root.order).collect();
    orders.sort_unstable();
    orders.dedup();
    orders.len()
}
