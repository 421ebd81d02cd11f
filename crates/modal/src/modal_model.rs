//! Frequency responses of identified modes and residual terms, with the covariance of the modes.

use nalgebra::{Complex, DMatrix};

use crate::model::Kernel;

type C = Complex<f64>;

/// Modes and residual terms of a test: its frequency responses, valid in the band of the test.
///
/// At ω and under forces f, output i is e^{−jωτ_i} {Σ_r [φ_ir L_rᵀf/(jω − λ_r) + φ_ir* L_rᴴf/(jω −
/// λ_r*)] + Σ_n c_inᵀf (jω/ω₀)ⁿ}, with the delays τ of the outputs, poles λ, shapes φ,
/// participations L and coefficients c of the residual terms. The covariance includes poles, shapes
/// and participations; delays, residual terms, and modes outside the band count as exact.
///
/// # Source
/// Ewins, *Modal Testing*, 2nd ed. (2000), section 2.6 (modal sum and residual terms).
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct ModalModel {
    /// Modes in the band, then the modes outside the band that belong to the model.
    pub terms: Vec<ModalTerm>,
    /// Angular frequency ω₀ that scales the residual terms, in rad/s.
    pub reference: f64,
    /// Powers n of the residual terms.
    pub powers: Vec<i32>,
    /// Coefficients c of the residual terms, in the unit of the output per N:
    /// `[output][input][power]`.
    pub residuals: Vec<Vec<Vec<f64>>>,
    /// Delay of each output relative to the forces, in s; empty if there are no delays.
    #[cfg_attr(feature = "serde", serde(default))]
    pub delays: Vec<f64>,
    /// Groups of modes with dependent errors, with their covariance.
    pub groups: Vec<ModalGroup>,
}

/// One mode of a modal model: its pole, shape and participations.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct ModalTerm {
    /// Real and imaginary part of the pole λ, in rad/s.
    pub pole: [f64; 2],
    /// Real and imaginary part of the shape φ at each output.
    pub shape: Vec<[f64; 2]>,
    /// Real and imaginary part of the participation L of each input: the residue of output and
    /// input is shape times participation.
    pub participation: Vec<[f64; 2]>,
}

/// Modes whose errors depend on one another.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct ModalGroup {
    /// Indices of the modes.
    pub modes: Vec<usize>,
    /// Lower triangle of the covariance, row by row. The parameters of a mode are ln(−Re λ), ln Im
    /// λ, the real and imaginary part of each entry of the shape, and those of each participation;
    /// the modes follow one another.
    pub covariance: Vec<Vec<f64>>,
}

impl ModalGroup {
    /// Creates a group from a symmetric covariance.
    pub(crate) fn new(modes: Vec<usize>, covariance: &DMatrix<f64>) -> Self {
        let row = |row: usize| (0..=row).map(|column| covariance[(row, column)]).collect();
        Self { modes, covariance: (0..covariance.nrows()).map(row).collect() }
    }

    /// Multiplies the standard errors of each mode by the entry of `scales` for this mode.
    fn scale_errors(&mut self, terms: &[ModalTerm], scales: &[f64]) {
        let of_mode = |mode: &usize| std::iter::repeat_n(scales[*mode], terms[*mode].parameters());
        let scale: Vec<f64> = self.modes.iter().flat_map(of_mode).collect();
        for (a, row) in self.covariance.iter_mut().enumerate() {
            row.iter_mut().enumerate().for_each(|(b, value)| *value *= scale[a] * scale[b]);
        }
    }

    fn entry(&self, a: usize, b: usize) -> f64 {
        self.covariance[a.max(b)][a.min(b)]
    }
}

impl ModalTerm {
    fn pole(&self) -> C {
        complex(&self.pole)
    }

    /// Returns Σ_j L_j f_j and Σ_j L_j* f_j.
    fn modal_force(&self, forces: &[C]) -> (C, C) {
        let pairs = || self.participation.iter().map(complex).zip(forces);
        (pairs().map(|(l, f)| l * f).sum(), pairs().map(|(l, f)| l.conj() * f).sum())
    }

    /// Returns the number of parameters of the mode in a covariance.
    fn parameters(&self) -> usize {
        2 + 2 * self.shape.len() + 2 * self.participation.len()
    }

    /// Returns the derivatives of the response of an output to forces with respect to the
    /// parameters of the mode that affect this response. Each derivative has the index of its
    /// parameter.
    fn derivatives(&self, output: usize, omega: f64, forces: &[C]) -> Vec<(usize, C)> {
        let pole = self.pole();
        let Kernel { value, mirror, slope, mirror_slope } = Kernel::from_force(pole, omega);
        let (force, mirror_force) = self.modal_force(forces);
        let shape = complex(&self.shape[output]);
        let moved = shape * force * slope;
        let moved_mirror = shape.conj() * mirror_force * mirror_slope;
        let (direct, conjugate) = (force * value, mirror_force * mirror);
        let at = 2 + 2 * output;
        let mut derivatives = vec![
            (0, (moved + moved_mirror) * pole.re),
            (1, C::i() * (moved - moved_mirror) * pole.im),
            (at, direct + conjugate),
            (at + 1, C::i() * (direct - conjugate)),
        ];
        let (direct, conjugate) = (shape * value, shape.conj() * mirror);
        for (input, force) in forces.iter().enumerate() {
            let at = 2 + 2 * self.shape.len() + 2 * input;
            derivatives.push((at, force * (direct + conjugate)));
            derivatives.push((at + 1, C::i() * force * (direct - conjugate)));
        }
        derivatives
    }
}

fn complex([re, im]: &[f64; 2]) -> C {
    C::new(*re, *im)
}

impl ModalModel {
    /// Returns the number of outputs.
    pub fn outputs(&self) -> usize {
        self.residuals.len()
    }

    /// Returns the number of inputs.
    pub fn inputs(&self) -> usize {
        self.residuals.first().map_or(0, Vec::len)
    }

    /// Returns whether the sizes of all lists agree, so that no index is out of range, for example
    /// in a model that was read from a file.
    pub fn is_consistent(&self) -> bool {
        let (outputs, inputs) = (self.outputs(), self.inputs());
        let fits = |term: &ModalTerm| {
            term.shape.len() == outputs && term.participation.len() == inputs && term.pole[0] < 0.0
        };
        let whole = |rows: &Vec<Vec<f64>>| {
            rows.len() == inputs && rows.iter().all(|row| row.len() == self.powers.len())
        };
        let grouped = |group: &ModalGroup| {
            let known = group.modes.iter().all(|mode| *mode < self.terms.len());
            let size = group.covariance.len();
            let rows = (1..).zip(&group.covariance);
            known
                && size == group.modes.iter().map(|mode| self.terms[*mode].parameters()).sum()
                && rows.into_iter().all(|(length, row)| row.len() == length)
        };
        self.reference > 0.0
            && (self.delays.is_empty() || self.delays.len() == outputs)
            && self.terms.iter().all(fits)
            && self.residuals.iter().all(whole)
            && self.groups.iter().all(grouped)
    }

    /// Returns the covariance of the shapes of two modes, outputs × outputs with real and imaginary
    /// parts (2p × 2p, real parts first); `None` if their errors are independent.
    pub(crate) fn cross_covariance(&self, a: usize, b: usize) -> Option<DMatrix<f64>> {
        let group = self
            .groups
            .iter()
            .find(|group| group.modes.contains(&a) && group.modes.contains(&b))?;
        let first = |mode: usize| -> usize {
            let before = group.modes.iter().take_while(|other| **other != mode);
            before.map(|other| self.terms[*other].parameters()).sum()
        };
        let (rows, columns, outputs) = (first(a), first(b), self.outputs());
        let index = |row: usize| 2 + 2 * (row % outputs) + row / outputs;
        Some(DMatrix::from_fn(2 * outputs, 2 * outputs, |i, j| {
            group.entry(rows + index(i), columns + index(j))
        }))
    }

    /// Multiplies the standard errors of each mode of the groups by the entry of `scales` for this
    /// mode.
    pub(crate) fn scale_errors(&mut self, scales: &[f64]) {
        self.groups.iter_mut().for_each(|group| group.scale_errors(&self.terms, scales));
    }

    /// Returns e^{−jωτ} with the delay of an output.
    pub(crate) fn delay_factor(&self, output: usize, omega: f64) -> C {
        self.delays.get(output).map_or(C::from(1.0), |delay| C::cis(-omega * delay))
    }

    /// Returns the frequency response at ω (rad/s), outputs × inputs.
    pub fn response(&self, omega: f64) -> DMatrix<C> {
        let mut response = self.undelayed(omega);
        for (output, mut row) in response.row_iter_mut().enumerate() {
            row *= self.delay_factor(output, omega);
        }
        response
    }

    /// Returns the frequency response without the delays of the outputs.
    pub(crate) fn undelayed(&self, omega: f64) -> DMatrix<C> {
        let scaled = C::new(0.0, omega / self.reference);
        let mut response = DMatrix::from_fn(self.outputs(), self.inputs(), |output, input| {
            let terms = self.powers.iter().zip(&self.residuals[output][input]);
            terms.map(|(power, value)| scaled.powi(*power) * *value).sum()
        });
        for term in &self.terms {
            let Kernel { value, mirror, .. } = Kernel::from_force(term.pole(), omega);
            for (output, shape) in term.shape.iter().map(complex).enumerate() {
                for (input, participation) in term.participation.iter().map(complex).enumerate() {
                    let residue = shape * participation;
                    response[(output, input)] += residue * value + residue.conj() * mirror;
                }
            }
        }
        response
    }

    /// Returns the covariance E[δy δyᴴ] (outputs × outputs) of the response to given forces at ω
    /// (rad/s). The errors δy are due to the errors of the modes.
    pub fn response_covariance(&self, omega: f64, forces: &[C]) -> DMatrix<C> {
        let outputs = self.outputs();
        let mut covariance = DMatrix::zeros(outputs, outputs);
        for group in &self.groups {
            let gradients: Vec<_> =
                (0..outputs).map(|i| self.gradient(group, i, omega, forces)).collect();
            for i in 0..outputs {
                for j in 0..=i {
                    let sum = product(group, &gradients[i], &gradients[j]);
                    covariance[(i, j)] += sum;
                    if i != j {
                        covariance[(j, i)] += sum.conj();
                    }
                }
            }
        }
        covariance
    }

    /// Returns the diagonal of [`ModalModel::response_covariance`].
    pub fn response_variance(&self, omega: f64, forces: &[C]) -> Vec<f64> {
        let variance = |output: usize| {
            let of_group = |group: &ModalGroup| {
                let gradient = self.gradient(group, output, omega, forces);
                product(group, &gradient, &gradient).re
            };
            self.groups.iter().map(of_group).sum()
        };
        (0..self.outputs()).map(variance).collect()
    }

    /// Returns the derivatives of an output with respect to the parameters of a group.
    fn gradient(
        &self,
        group: &ModalGroup,
        output: usize,
        omega: f64,
        forces: &[C],
    ) -> Vec<(usize, C)> {
        let mut first = 0;
        let mut gradient = Vec::new();
        let factor = self.delay_factor(output, omega);
        for mode in &group.modes {
            let term = &self.terms[*mode];
            let derivatives = term.derivatives(output, omega, forces).into_iter();
            gradient.extend(derivatives.map(|(index, value)| (first + index, value * factor)));
            first += term.parameters();
        }
        gradient
    }
}

/// Returns Σ_ab g_a C_ab h_b*, where C is the covariance of a group of modes.
fn product(group: &ModalGroup, g: &[(usize, C)], h: &[(usize, C)]) -> C {
    let row = |(a, left): &(usize, C)| {
        let sum: C = h.iter().map(|(b, right)| right.conj() * group.entry(*a, *b)).sum();
        left * sum
    };
    g.iter().map(row).sum()
}
