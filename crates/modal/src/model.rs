//! Kernels of the modal model: response of a mode to a load on a line, and its derivatives.
//!
//! With the amplitudes E_e of the loads e, output i at ω is Σ_r [φ_ir g_r(ω) + φ_ir* g̃_r(ω)] + Σ_e
//! E_e Σ_n c_ien (jω)ⁿ with g_r = Σ_e L_re E_e h_re. The kernel h is 1/(jω − λ_r) for a force and
//! Δt/(1 − e^{(λ_r − jω)Δt}), the exact transform of a sampled decay, for the transient of a
//! record; g̃ is g with λ* and L* in place of λ and L.
//!
//! # Source
//! Pintelon & Schoukens, *System Identification: A Frequency Domain Approach*, 2nd ed. (2012),
//! section 6.3; Golub & Pereyra, Inverse Problems 19 (2003) R1 (variable projection).

use std::ops::Range;

use nalgebra::Complex;

use crate::lines::{Block, Lines, Load};
use crate::order::Candidate;

/// Powers of jω of the residual terms, which represent all modes outside the band.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ResidualPowers {
    /// Powers of jω for each measured input.
    pub forces: Vec<i32>,
    /// Powers of jω for the transient of each record.
    pub transients: Vec<i32>,
}

impl ResidualPowers {
    /// Returns the powers of jω in the residual terms of a load.
    pub(crate) fn for_load(&self, load: Load) -> &[i32] {
        match load {
            Load::Force(_) => &self.forces,
            Load::Transient(_) => &self.transients,
        }
    }
}

/// Poles, participations, and the powers of jω in the residual terms. The search changes the poles
/// and participations; the powers define which residual terms are linear unknowns.
#[derive(Debug, Clone)]
pub(crate) struct Model {
    pub(crate) poles: Vec<Complex<f64>>,
    /// Participation of each load in each mode: `[mode][load]`.
    pub(crate) participation: Vec<Vec<Complex<f64>>>,
    /// For each mode, the load whose participation is 1.
    pub(crate) gauge: Vec<usize>,
    pub(crate) powers: ResidualPowers,
    /// Angular frequency ω₀ of the residual terms, which are powers of jω/ω₀, in rad/s.
    pub(crate) reference: f64,
}

/// Returns the initial powers of jω in the residual terms.
pub(crate) fn first_powers(lines: &Lines) -> ResidualPowers {
    let transients = if lines.inputs() == 0 { Vec::new() } else { vec![0, 1, 2] };
    ResidualPowers { forces: vec![-4, -2, 0, 2, 4], transients }
}

/// Response of one mode to unit loads on one line; `mirror` is the response of the conjugate mode.
#[derive(Clone, Copy, Default)]
pub(crate) struct Kernel {
    pub(crate) value: Complex<f64>,
    pub(crate) mirror: Complex<f64>,
    pub(crate) slope: Complex<f64>,
    pub(crate) mirror_slope: Complex<f64>,
}

impl Kernel {
    /// Returns the kernel of a force at ω.
    pub(crate) fn from_force(pole: Complex<f64>, omega: f64) -> Self {
        let value = 1.0 / (Complex::new(0.0, omega) - pole);
        let mirror = 1.0 / (Complex::new(0.0, omega) - pole.conj());
        Self { value, mirror, slope: value * value, mirror_slope: mirror * mirror }
    }

    /// Returns the kernel of a transient: `growth` is e^{λΔt}, `delay` is e^{−jωΔt}.
    fn from_transient(growth: Complex<f64>, delay: Complex<f64>, dt: f64) -> Self {
        let (x, mirror_x) = (growth * delay, growth.conj() * delay);
        let (value, mirror) = (dt / (1.0 - x), dt / (1.0 - mirror_x));
        let (slope, mirror_slope) = (x * value * value, mirror_x * mirror * mirror);
        Self { value, mirror, slope, mirror_slope }
    }
}

/// Returns the force and transient kernels of one mode on a line of a block.
pub(crate) fn kernels(
    pole: Complex<f64>,
    lines: &Lines,
    block: &Block,
    line: usize,
    growth: Complex<f64>,
) -> (Kernel, Kernel) {
    let force = Kernel::from_force(pole, lines.omega[block.rows.start + line]);
    let transient = block.delay.as_ref().map_or_else(Kernel::default, |(dt, delay)| {
        Kernel::from_transient(growth, delay[line], *dt)
    });
    (force, transient)
}

/// Returns e^{λΔt} for the sampling of a block.
pub(crate) fn growth(pole: Complex<f64>, block: &Block) -> Complex<f64> {
    block.delay.as_ref().map_or_else(Complex::default, |(dt, _)| (pole * *dt).exp())
}

impl Model {
    /// Returns the number of modes.
    pub(crate) fn modes(&self) -> usize {
        self.poles.len()
    }

    /// Returns the number of parameters of the search.
    pub(crate) fn parameters(&self, lines: &Lines) -> usize {
        2 * self.modes() * lines.loads.len()
    }

    /// Returns the indices of the columns of the residual terms, one range for each load.
    pub(crate) fn residual_columns(&self, lines: &Lines) -> Vec<Range<usize>> {
        let mut next = 2 * self.modes();
        let take = |load: &Load| {
            let start = next;
            next += self.powers.for_load(*load).len();
            start..next
        };
        lines.loads.iter().map(take).collect()
    }

    /// Returns the number of linear unknowns of each output.
    pub(crate) fn columns(&self, lines: &Lines) -> usize {
        let residuals = lines.loads.iter().map(|load| self.powers.for_load(*load).len());
        2 * self.modes() + residuals.sum::<usize>()
    }

    /// Returns the linear unknowns that act on the lines of a block.
    pub(crate) fn block_columns(&self, lines: &Lines, block: &Block) -> Vec<usize> {
        let residuals = self.residual_columns(lines);
        let active = block.active.iter().flat_map(|load| residuals[*load].clone());
        (0..2 * self.modes()).chain(active).collect()
    }

    /// Returns the index of the pair of parameters of a participation. The load must not be the
    /// gauge of the mode, whose participation is fixed at 1.
    pub(crate) fn pair_of(&self, mode: usize, load: usize, loads: usize) -> usize {
        let before = load - usize::from(load > self.gauge[mode]);
        self.modes() + mode * (loads - 1) + before
    }

    /// Returns the mode and the load of every pair of parameters of the search. The poles come
    /// first; they have no load.
    pub(crate) fn pairs(&self, loads: usize) -> Vec<(usize, Option<usize>)> {
        let poles = (0..self.modes()).map(|mode| (mode, None));
        let free = (0..self.modes()).flat_map(|mode| {
            let gauge = self.gauge[mode];
            (0..loads).filter(move |load| *load != gauge).map(move |load| (mode, Some(load)))
        });
        poles.chain(free).collect()
    }

    /// Writes the columns of a block, each of 2n rows (real parts above imaginary parts), whitened
    /// by `weight`.
    pub(crate) fn fill(&self, lines: &Lines, block: &Block, weight: &[f64], columns: &mut [f64]) {
        let n = block.len();
        let (modes, residual_columns) = columns.split_at_mut(4 * n * self.modes());
        for (mode, pair) in modes.chunks_exact_mut(4 * n).enumerate() {
            let (pole, participation) = (self.poles[mode], &self.participation[mode]);
            let growth = growth(pole, block);
            for (line, weight) in weight.iter().enumerate() {
                let (force, transient) = kernels(pole, lines, block, line, growth);
                let (mut direct, mut mirror) = (Complex::default(), Complex::default());
                for &load in &block.active {
                    let amplitude = lines.load(load, block.rows.start + line);
                    let kernel = select_kernel(lines.loads[load], force, transient);
                    direct += participation[load] * amplitude * kernel.value;
                    mirror += participation[load].conj() * amplitude * kernel.mirror;
                }
                write_pair(pair, line, n, *weight, direct, mirror);
            }
        }
        self.fill_residuals(lines, block, weight, residual_columns);
    }

    /// Writes the columns of the residual terms of a block.
    pub(crate) fn fill_residuals(
        &self,
        lines: &Lines,
        block: &Block,
        weight: &[f64],
        columns: &mut [f64],
    ) {
        let n = block.len();
        let active = block.active.iter().flat_map(|load| {
            self.powers.for_load(lines.loads[*load]).iter().map(move |power| (*load, *power))
        });
        for ((load, power), column) in active.zip(columns.chunks_exact_mut(2 * n)) {
            let phase = Complex::i().powi(power);
            for (line, weight) in weight.iter().enumerate() {
                let row = block.rows.start + line;
                let size = (lines.omega[row] / self.reference).powi(power) * weight;
                let value = lines.load(load, row) * phase * size;
                (column[line], column[n + line]) = (value.re, value.im);
            }
        }
    }

    /// Writes the derivatives of a block: a pair of columns for each pair of parameters in `pairs`.
    ///
    /// With a = ∂g/∂λ (or ∂g/∂L) and the same derivative b of the conjugate mode, the pair is a + b
    /// and j(a − b); the derivative of output i is this pair multiplied by its complex shape φ_i.
    pub(crate) fn fill_derivatives(
        &self,
        lines: &Lines,
        block: &Block,
        weight: &[f64],
        pairs: &[(usize, Option<usize>)],
        columns: &mut [f64],
    ) {
        let n = block.len();
        let mut kernels_of_mode = Vec::with_capacity(n);
        for (mode, pole) in self.poles.iter().enumerate() {
            let growth = growth(*pole, block);
            kernels_of_mode.clear();
            kernels_of_mode.extend((0..n).map(|line| kernels(*pole, lines, block, line, growth)));
            let chunks = pairs.iter().zip(columns.chunks_exact_mut(4 * n));
            for ((_, load), pair) in chunks.filter(|((owner, _), _)| *owner == mode) {
                for (line, (force, transient)) in kernels_of_mode.iter().enumerate() {
                    let kind = |load: usize| select_kernel(lines.loads[load], *force, *transient);
                    let row = block.rows.start + line;
                    let (direct, mirror) = match load {
                        Some(load) => {
                            let (kernel, amplitude) = (kind(*load), lines.load(*load, row));
                            (amplitude * kernel.value, amplitude * kernel.mirror)
                        }
                        None => self.slopes(mode, lines, block, row, kind),
                    };
                    write_pair(pair, line, n, weight[line], direct, mirror);
                }
            }
        }
    }

    /// Returns the derivatives of g and g̃ of a mode with respect to λ and λ*.
    fn slopes(
        &self,
        mode: usize,
        lines: &Lines,
        block: &Block,
        row: usize,
        kind: impl Fn(usize) -> Kernel,
    ) -> (Complex<f64>, Complex<f64>) {
        let (mut direct, mut mirror) = (Complex::default(), Complex::default());
        for &load in &block.active {
            let (kernel, amplitude) = (kind(load), lines.load(load, row));
            let participation = self.participation[mode][load];
            direct += participation * amplitude * kernel.slope;
            mirror += participation.conj() * amplitude * kernel.mirror_slope;
        }
        (direct, mirror)
    }

    /// Scales each mode so that its strongest load has participation 1.
    pub(crate) fn fix_gauge(&mut self, lines: &Lines) {
        let levels = level_near(&self.poles, lines);
        for (mode, participation) in self.participation.iter_mut().enumerate() {
            let strength = |load: usize| participation[load].norm() * levels[mode][load];
            let strongest = (0..participation.len())
                .max_by(|a, b| strength(*a).total_cmp(&strength(*b)))
                .unwrap_or(0);
            let scale = participation[strongest];
            if scale.norm() > 0.0 {
                participation.iter_mut().for_each(|value| *value /= scale);
            }
            participation[strongest] = Complex::new(1.0, 0.0);
            self.gauge[mode] = strongest;
        }
    }

    /// Adds a candidate as the last mode.
    pub(crate) fn push(&mut self, candidate: &Candidate) {
        self.poles.push(candidate.pole);
        self.participation.push(candidate.participation.clone());
        self.gauge.push(0);
    }

    /// Sorts the modes by frequency.
    pub(crate) fn sort(&mut self) {
        let mut order: Vec<usize> = (0..self.modes()).collect();
        order.sort_by(|a, b| self.poles[*a].im.total_cmp(&self.poles[*b].im));
        self.select(&order);
    }

    /// Keeps the modes with these indices, in this order.
    pub(crate) fn select(&mut self, order: &[usize]) {
        self.poles = order.iter().map(|mode| self.poles[*mode]).collect();
        self.participation = order.iter().map(|mode| self.participation[*mode].clone()).collect();
        self.gauge = order.iter().map(|mode| self.gauge[*mode]).collect();
    }
}

/// Returns the root-mean-square of each load around the resonance of each mode.
pub(crate) fn level_near(poles: &[Complex<f64>], lines: &Lines) -> Vec<Vec<f64>> {
    let overall: Vec<f64> = (0..lines.loads.len()).map(|load| lines.load_level(load)).collect();
    let level = |pole: &Complex<f64>| {
        let mut power = vec![0.0; lines.loads.len()];
        let mut sum = 0.0;
        for block in &lines.blocks {
            for row in block.rows.clone() {
                let share = 1.0 / (1.0 + ((lines.omega[row] - pole.im) / pole.re).powi(2));
                sum += share;
                for &load in &block.active {
                    power[load] += share * lines.load(load, row).norm_sqr();
                }
            }
        }
        let level = |(power, overall): (&f64, &f64)| (power / sum).sqrt() + 1e-12 * overall;
        power.iter().zip(&overall).map(level).collect()
    };
    poles.iter().map(level).collect()
}

/// Returns the kernel for the type of a load.
pub(crate) fn select_kernel(load: Load, force: Kernel, transient: Kernel) -> Kernel {
    match load {
        Load::Force(_) => force,
        Load::Transient(_) => transient,
    }
}

/// Writes the entries of one line in the columns a + b and j(a − b), each as a real part and an
/// imaginary part.
pub(crate) fn write_pair(
    pair: &mut [f64],
    line: usize,
    n: usize,
    weight: f64,
    a: Complex<f64>,
    b: Complex<f64>,
) {
    let (sum, difference) = (a + b, a - b);
    pair[line] = weight * sum.re;
    pair[n + line] = weight * sum.im;
    pair[2 * n + line] = -weight * difference.im;
    pair[3 * n + line] = weight * difference.re;
}
