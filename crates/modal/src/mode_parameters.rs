//! Pole, shape and participations of one mode with their joint covariance, and derived quantities.

use std::f64::consts::TAU;

use mechid_numerics::Uncertain;
use nalgebra::{Complex, DMatrix, DVector, Matrix2, Vector2};

use crate::constraint::DrivingPoint;
use crate::indicators::ShapeWithCovariance;
use crate::modal_model::ModalTerm;
use crate::mode::IdentifiedMode;

type C = Complex<f64>;

/// Parameters of one mode: ln(−Re λ), ln Im λ, the real and imaginary part of each entry of the
/// shape (in the units of the outputs), and those of the participation of each input.
#[derive(Debug, Clone)]
pub(crate) struct ModeParameters {
    pub(crate) outputs: usize,
    pub(crate) inputs: usize,
    /// Index of the load whose participation is 1; an index of `inputs` or more belongs to a
    /// transient.
    pub(crate) gauge: usize,
    pub(crate) values: DVector<f64>,
    pub(crate) covariance: DMatrix<f64>,
    pub(crate) degrees_of_freedom: usize,
}

/// Mass-normalised shape of a mode, in kg^(−1/2). Each entry has the standard errors of its real
/// and imaginary parts.
#[derive(Debug, Clone, PartialEq)]
pub struct MassNormalised {
    /// Entries of the shape at the outputs, each with its standard errors.
    pub outputs: Vec<(C, C)>,
    /// Entries of the shape at the points and in the directions of the inputs, each with its
    /// standard errors. All inputs must be forces on one structure, for example the forces of a
    /// roving hammer.
    pub inputs: Vec<(C, C)>,
}

/// Complex function of the parameters, with its derivatives.
struct Differentiated {
    value: C,
    gradient: DVector<C>,
}

impl Differentiated {
    /// Adds the derivative with respect to the complex parameter at `index`.
    fn add(&mut self, index: usize, derivative: C) {
        self.gradient[index] += derivative;
        self.gradient[index + 1] += derivative * C::i();
    }
}

impl ModeParameters {
    /// Returns the index of the first parameter of an entry of the shape.
    pub(crate) fn shape_index(output: usize) -> usize {
        2 + 2 * output
    }

    /// Returns the index of the first parameter of a participation.
    pub(crate) fn participation_index(&self, input: usize) -> usize {
        2 + 2 * self.outputs + 2 * input
    }

    fn complex(&self, index: usize) -> C {
        C::new(self.values[index], self.values[index + 1])
    }

    /// Returns the pole, in rad/s.
    pub(crate) fn pole(&self) -> C {
        C::new(-self.values[0].exp(), self.values[1].exp())
    }

    /// Returns an entry of the shape.
    pub(crate) fn shape(&self, output: usize) -> C {
        self.complex(Self::shape_index(output))
    }

    /// Returns a participation.
    pub(crate) fn participation(&self, input: usize) -> C {
        self.complex(self.participation_index(input))
    }

    /// Returns the term of the mode in the modal sum.
    pub(crate) fn term(&self) -> ModalTerm {
        let pair = |z: C| [z.re, z.im];
        ModalTerm {
            pole: pair(self.pole()),
            shape: (0..self.outputs).map(|output| pair(self.shape(output))).collect(),
            participation: (0..self.inputs).map(|input| pair(self.participation(input))).collect(),
        }
    }

    /// Returns the input that fixes the phase of the forces. This is the load whose participation
    /// is 1 (the gauge); if the gauge is a transient, it is the input with the largest
    /// participation.
    pub(crate) fn phase_input(&self) -> usize {
        if self.gauge < self.inputs {
            return self.gauge;
        }
        let size = |input: &usize| self.participation(*input).norm();
        (0..self.inputs).max_by(|a, b| size(a).total_cmp(&size(b))).unwrap_or(0)
    }

    fn block(&self, a: usize, b: usize) -> Matrix2<f64> {
        self.covariance.fixed_view::<2, 2>(a, b).into_owned()
    }

    /// Returns the covariance of real and imaginary part of Σ_k f_k z_k, for complex parameters z_k
    /// at `index`.
    fn covariance_of_sum(&self, terms: &[(usize, C)]) -> Matrix2<f64> {
        let mut sum = Matrix2::zeros();
        for &(a, f) in terms {
            for &(b, g) in terms {
                sum += rotation(f) * self.block(a, b) * rotation(g).transpose();
            }
        }
        sum
    }

    /// Returns the shape with its covariance; `None` if an entry is not finite.
    pub(crate) fn shape_with_covariance(&self) -> Option<ShapeWithCovariance> {
        let outputs = self.outputs;
        let index = |row: usize| Self::shape_index(row % outputs) + row / outputs;
        let covariance = DMatrix::from_fn(2 * outputs, 2 * outputs, |i, j| {
            self.covariance[(index(i), index(j))]
        });
        let shape = DVector::from_fn(outputs, |output, _| self.shape(output));
        ShapeWithCovariance::new(shape, covariance).ok()
    }

    /// Returns the index of the largest entry of the shape.
    fn largest_output(&self) -> usize {
        let size = |output: &usize| self.shape(*output).norm();
        (0..self.outputs).max_by(|a, b| size(a).total_cmp(&size(b))).unwrap_or(0)
    }

    /// Returns the modal mass of the shape with a largest entry of 1. The output of `point` must be
    /// the `derivative`-th time derivative of the displacement where its input acts.
    ///
    /// `None` if the shape or the participation is zero at the point.
    ///
    /// The residue of the displacement is ψ²/(2jω_d) with the mass-normalised ψ at the point, so
    /// that the mass is φ²/ψ² with the entry φ of the shape. The function returns the modulus of
    /// this complex quotient with the sign of its real part: a delay between the channels changes
    /// only the phase.
    pub(crate) fn modal_mass(&self, point: DrivingPoint, derivative: i32) -> Option<Uncertain> {
        let (mass, gradient) = self.complex_mass(point, derivative);
        let variance = gradient.dot(&(&self.covariance * &gradient));
        // The data do not determine the modal mass of a mode that has no motion or no force at the
        // point.
        let size = mass.norm();
        (size.is_finite() && variance.is_finite()).then(|| Uncertain {
            value: size.copysign(mass.re),
            standard_error: size * variance.max(0.0).sqrt(),
            degrees_of_freedom: self.degrees_of_freedom,
        })
    }

    /// Returns the complex quotient of [`modal_mass`](Self::modal_mass), and the derivatives of the
    /// logarithm of its modulus.
    fn complex_mass(&self, point: DrivingPoint, derivative: i32) -> (C, DVector<f64>) {
        let (pole, largest) = (self.pole(), self.largest_output());
        let [entry, scale] = [point.output, largest].map(|output| self.shape(output));
        let participation = self.participation(point.input);
        let squared = participation / pole.powi(derivative) * C::new(0.0, 2.0 * pole.im);
        let mass = entry * point.sign() / (scale * scale * squared);
        // Derivatives of the logarithm of the complex mass with respect to each complex parameter.
        let terms = [
            (Self::shape_index(point.output), 1.0 / entry),
            (Self::shape_index(largest), -2.0 / scale),
            (self.participation_index(point.input), -1.0 / participation),
        ];
        let mut gradient = DVector::zeros(self.values.len());
        for (index, factor) in terms {
            gradient[index] += factor.re;
            gradient[index + 1] -= factor.im;
        }
        let by_pole = f64::from(derivative) / pole;
        gradient[0] = by_pole.re * pole.re;
        gradient[1] = -by_pole.im * pole.im - 1.0;
        (mass, gradient)
    }

    /// Returns the shape with a largest entry of 1, divided by the root of the modal mass: its
    /// entries at the outputs and at the inputs. Each entry has the standard errors of its real and
    /// imaginary parts. `None` unless the mass is determined and positive.
    pub(crate) fn mass_normalised_shape(
        &self,
        point: DrivingPoint,
        derivative: i32,
    ) -> Option<MassNormalised> {
        let mass = self.modal_mass(point, derivative).filter(|mass| mass.value > 0.0)?.value;
        let (_, by_mass) = self.complex_mass(point, derivative);
        let largest = self.largest_output();
        let scale = self.shape(largest);
        let at_output = |output: usize| {
            let mut entry = Differentiated {
                value: self.shape(output) / scale / mass.sqrt(),
                gradient: by_mass.map(C::from),
            };
            entry.gradient *= entry.value * -0.5;
            if output != largest {
                entry.add(Self::shape_index(output), 1.0 / (scale * mass.sqrt()));
                entry.add(Self::shape_index(largest), -entry.value / scale);
            }
            entry
        };
        // The participations are proportional to the shape at the inputs, by reciprocity.
        let at_point = at_output(point.output);
        let reference = self.participation(point.input);
        let at_input = |input: usize| {
            let ratio = self.participation(input) / reference * point.sign();
            let mut entry = Differentiated {
                value: at_point.value * ratio,
                gradient: &at_point.gradient * ratio,
            };
            if input != point.input {
                let factor = at_point.value * point.sign() / reference;
                entry.add(self.participation_index(input), factor);
                entry.add(self.participation_index(point.input), -entry.value / reference);
            }
            entry
        };
        let with_errors = |entry: Differentiated| {
            let deviation = |by: DVector<f64>| by.dot(&(&self.covariance * &by)).max(0.0).sqrt();
            let [re, im] = [entry.gradient.map(|z| z.re), entry.gradient.map(|z| z.im)];
            (entry.value, C::new(deviation(re), deviation(im)))
        };
        Some(MassNormalised {
            outputs: (0..self.outputs).map(at_output).map(with_errors).collect(),
            inputs: (0..self.inputs).map(at_input).map(with_errors).collect(),
        })
    }

    /// Returns the mode with these parameters. Its shape is divided by the largest entry, and its
    /// participations are multiplied by this entry.
    pub(crate) fn mode(&self) -> IdentifiedMode {
        let pole = self.pole();
        let (frequency, damping, frequency_damping_covariance) =
            natural_frequency_and_damping(pole, &self.block(0, 0), self.degrees_of_freedom);
        let shape: Vec<C> = (0..self.outputs).map(|output| self.shape(output)).collect();
        let reference = self.largest_output();
        let (scale, at) = (shape[reference], Self::shape_index(reference));
        let errors = |covariance: Matrix2<f64>| {
            C::new(covariance[(0, 0)].max(0.0).sqrt(), covariance[(1, 1)].max(0.0).sqrt())
        };
        let entry_error = |output: usize| {
            let by_reference = (at, -shape[output] / (scale * scale));
            let terms = [(Self::shape_index(output), 1.0 / scale), by_reference];
            if output == reference { C::default() } else { errors(self.covariance_of_sum(&terms)) }
        };
        let participation_error = |input: usize| {
            let terms = [(self.participation_index(input), scale), (at, self.participation(input))];
            errors(self.covariance_of_sum(&terms))
        };
        IdentifiedMode {
            pole,
            natural_frequency_hz: frequency,
            damping_ratio: damping,
            frequency_damping_covariance,
            shape: shape.iter().map(|value| value / scale).collect(),
            shape_standard_error: (0..self.outputs).map(entry_error).collect(),
            participation: (0..self.inputs).map(|k| self.participation(k) * scale).collect(),
            participation_standard_error: (0..self.inputs).map(participation_error).collect(),
            driven_share: None,
            unmeasured_ratio: None,
            gain: 0.0,
            near_edge: false,
        }
    }
}

/// Returns the real 2 × 2 matrix whose product with (real part, imaginary part) is the
/// multiplication by a complex number.
fn rotation(z: C) -> Matrix2<f64> {
    Matrix2::new(z.re, -z.im, z.im, z.re)
}

/// Returns natural frequency (Hz), damping ratio and their covariance from the covariance of ln(−Re
/// λ) and ln Im λ.
pub(crate) fn natural_frequency_and_damping(
    pole: C,
    covariance: &Matrix2<f64>,
    degrees_of_freedom: usize,
) -> (Uncertain, Uncertain, f64) {
    let (size, re, im) = (pole.norm(), pole.re, pole.im);
    let by_frequency = Vector2::new(re * re, im * im) / (size * TAU);
    let by_damping = Vector2::new(-re, re) * (im * im / size.powi(3));
    let uncertain = |value: f64, by: Vector2<f64>| Uncertain {
        value,
        standard_error: by.dot(&(covariance * by)).max(0.0).sqrt(),
        degrees_of_freedom,
    };
    let frequency = uncertain(size / TAU, by_frequency);
    let damping = uncertain(-re / size, by_damping);
    (frequency, damping, by_frequency.dot(&(covariance * by_damping)))
}
