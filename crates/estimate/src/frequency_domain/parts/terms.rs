//! Terms that a linear model with viscous damping leaves out, as changes of force and displacement.

use std::fmt::{self, Display, Formatter};
use std::ops::Range;

use mechid_model::{Parameter, SecondOrderSystem};
use mechid_signal::{Record, Sampling, Spectrum};
use nalgebra::{Complex, DMatrix, DVector};

use super::PartsOfFit;
use crate::frequency_domain::whitened::{WeightedLines, Whitened};
use crate::limits::MAX_PARTS;

type ComplexMatrix = DMatrix<Complex<f64>>;

/// Term that a linear model with viscous damping leaves out.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[cfg_attr(feature = "serde", serde(tag = "term", rename_all = "snake_case"))]
#[non_exhaustive]
pub enum OmittedTerm {
    /// Displacement in phase with the forces; its ratio to the forces does not depend on the
    /// frequency. It describes modes above the band.
    ResidualFlexibility,
    /// Force whose ratio to the displacement is proportional to ω⁴. It describes masses on springs
    /// with modes above the band.
    HiddenMass,
    /// Displacement whose ratio to the forces is proportional to 1/ω². It describes modes below the
    /// band.
    ResidualMass,
    /// Damping force in phase with the velocity; its ratio to the displacement does not grow with
    /// the frequency.
    StructuralDamping,
    /// Change of an entry of M, C or K whose value is stated, such as an entry that is 0 because no
    /// element couples two degrees of freedom.
    KnownEntry {
        /// The entry.
        #[cfg_attr(feature = "serde", serde(serialize_with = "as_text"))]
        entry: Parameter,
    },
    /// Force that follows a power of a displacement or velocity, to the ground or between two
    /// degrees of freedom.
    Nonlinear {
        /// Power of the displacement or velocity to which the force is proportional.
        power: Power,
        /// Degree of freedom.
        #[cfg_attr(feature = "serde", serde(serialize_with = "from_one"))]
        dof: usize,
        /// Second degree of freedom on which the force acts; `None` if the force acts between the
        /// first one and the ground.
        #[cfg_attr(feature = "serde", serde(serialize_with = "maybe_from_one"))]
        other: Option<usize>,
    },
}

/// Power or sign of a displacement or velocity that is tested as a force.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(rename_all = "snake_case"))]
pub enum Power {
    /// x².
    Square,
    /// x³.
    Cube,
    /// ẋ³.
    VelocityCube,
    /// Sign of ẋ: dry friction.
    VelocitySign,
}

impl Power {
    /// All powers that are tested.
    pub const ALL: [Self; 4] = [Self::Square, Self::Cube, Self::VelocityCube, Self::VelocitySign];

    /// Returns the power of a displacement (m) or a velocity (m/s), in the same power of its unit.
    fn value(self, displacement: f64, velocity: f64) -> f64 {
        match self {
            Self::Square => displacement * displacement,
            Self::Cube => displacement.powi(3),
            Self::VelocityCube => velocity.powi(3),
            Self::VelocitySign => velocity.signum(),
        }
    }
}

impl Display for Power {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Power::Square => "square of",
            Power::Cube => "cube of",
            Power::VelocityCube => "cube of the velocity of",
            Power::VelocitySign => "sign (dry friction) of the velocity of",
        })
    }
}

/// Rows of a record, or of a part of it, on lines of this sampling.
#[derive(Debug, Clone)]
pub struct SampledRows {
    /// Rows of the data.
    pub rows: Range<usize>,
    /// Samples of the record or of its period.
    pub sampling: Sampling,
}

/// Change of force and displacement due to a term, each rows × n. The scale of a term is arbitrary.
struct Change {
    force: ComplexMatrix,
    displacement: ComplexMatrix,
}

/// Most likely displacement and force of a fit on all lines of its data.
pub(super) struct LikelyMotion<'a> {
    fit: &'a PartsOfFit<'a>,
    system: SecondOrderSystem,
    displacement: ComplexMatrix,
    force: ComplexMatrix,
    records: &'a [SampledRows],
    weighted: WeightedLines,
}

impl<'a> LikelyMotion<'a> {
    pub(super) fn new(fit: &'a PartsOfFit<'a>, records: &'a [SampledRows]) -> Option<Self> {
        let [mass, damping, stiffness] = fit.unknowns.assemble(fit.values.as_slice());
        let system = SecondOrderSystem::new(mass, damping, stiffness).ok()?;
        let covariance = |row: usize| fit.noise.covariance(row);
        let displacement = Whitened::likely_displacement(&fit.closed, &system, covariance)?;
        let mut force = displacement.clone();
        for (row, omega) in fit.data.omega().iter().enumerate() {
            let of_row = system.dynamic_stiffness(*omega) * displacement.row(row).transpose();
            force.row_mut(row).copy_from(&of_row.transpose());
        }
        let weighted = WeightedLines::new(fit.data, &fit.unknowns, &fit.values, covariance)?;
        Some(Self { fit, system, displacement, force, records, weighted })
    }

    /// Returns the terms that can be tested; their number is limited by the size of the fit.
    pub(super) fn terms(&self) -> Vec<OmittedTerm> {
        let (n, rows) = (self.fit.data.dof(), self.fit.data.len());
        let mut all = vec![OmittedTerm::ResidualFlexibility, OmittedTerm::ResidualMass];
        all.extend([OmittedTerm::HiddenMass, OmittedTerm::StructuralDamping]);
        let most = MAX_PARTS / (2 * n * rows).max(1);
        all.extend(self.known_entries().take(most));
        if self.records.is_empty() {
            return all;
        }
        let of_each =
            |dof, other| Power::ALL.map(|power| OmittedTerm::Nonlinear { power, dof, other });
        let to_ground = (0..n).flat_map(|dof| of_each(dof, None));
        let between = (0..n).flat_map(|dof| (dof + 1..n).flat_map(move |b| of_each(dof, Some(b))));
        all.extend(to_ground.chain(between).take(most));
        all
    }

    /// Returns the known entries, one of each symmetric pair.
    fn known_entries(&self) -> impl Iterator<Item = OmittedTerm> {
        let unknowns = &self.fit.unknowns;
        let known = Parameter::all(unknowns.dof()).filter(move |entry| {
            let (matrix, row, column) = (entry.matrix(), entry.row(), entry.column());
            let is_second = row > column && unknowns.is_symmetric(matrix);
            !is_second && unknowns.fixed(matrix, row, column).is_some()
        });
        known.map(|entry| OmittedTerm::KnownEntry { entry })
    }

    /// Returns the weighted changes of the response by a term, each of unit length; `None` if the
    /// response does not change.
    pub(super) fn columns(&self, term: OmittedTerm) -> Option<Vec<DVector<f64>>> {
        let changes = self.changes(term)?;
        let mut columns = Vec::new();
        for Change { force, displacement } in changes {
            let white = self.weighted.residual(&-force, &displacement)?;
            let length = white.norm();
            if length > 0.0 {
                columns.push(white / length);
            }
        }
        (!columns.is_empty()).then_some(columns)
    }

    fn changes(&self, term: OmittedTerm) -> Option<Vec<Change>> {
        let (n, omega) = (self.fit.data.dof(), self.fit.data.omega());
        let driven = (0..n).filter(|dof| self.force.column(*dof).norm_squared() > 0.0);
        let pairs = driven.flat_map(|force| (0..n).map(move |response| (response, force)));
        let of_forces = |power: i32| {
            let one = |(response, force): (usize, usize)| {
                self.displaced(response, |row| self.force[(row, force)] * omega[row].powi(power))
            };
            pairs.clone().map(one).collect()
        };
        Some(match term {
            OmittedTerm::ResidualFlexibility => of_forces(0),
            OmittedTerm::ResidualMass => of_forces(-2),
            OmittedTerm::HiddenMass => {
                let one = |dof: usize| {
                    let motion = |row: usize| self.displacement[(row, dof)];
                    self.forced(&[(dof, 1.0)], |row| motion(row) * omega[row].powi(4))
                };
                (0..n).map(one).collect()
            }
            OmittedTerm::StructuralDamping => {
                let stiffness = self.system.stiffness().map(|k| Complex::new(0.0, -k));
                let force = &self.displacement * stiffness.transpose();
                vec![Change { displacement: DMatrix::zeros(omega.len(), n), force }]
            }
            OmittedTerm::KnownEntry { entry } => vec![self.by_entry(entry)],
            OmittedTerm::Nonlinear { power, dof, other } => {
                let values = self.power_of(power, dof, other)?;
                let ends: Vec<(usize, f64)> =
                    [(dof, -1.0)].into_iter().chain(other.map(|other| (other, 1.0))).collect();
                vec![self.forced(&ends, |row| values[row])]
            }
        })
    }

    /// Returns the force that a unit change of an entry causes. In a symmetric matrix, the mirrored
    /// entry has the same change.
    fn by_entry(&self, entry: Parameter) -> Change {
        let (n, omega) = (self.fit.data.dof(), self.fit.data.omega());
        let (row, column) = (entry.row(), entry.column());
        let order = 2 - entry.matrix() as u32;
        let mut force = DMatrix::zeros(omega.len(), n);
        for (line, omega) in omega.iter().enumerate() {
            let factor = -Complex::new(0.0, *omega).powu(order);
            force[(line, row)] += factor * self.displacement[(line, column)];
            if row != column && self.fit.unknowns.is_symmetric(entry.matrix()) {
                force[(line, column)] += factor * self.displacement[(line, row)];
            }
        }
        Change { displacement: DMatrix::zeros(omega.len(), n), force }
    }

    fn displaced(&self, response: usize, of: impl Fn(usize) -> Complex<f64>) -> Change {
        let force = DMatrix::zeros(self.fit.data.len(), self.fit.data.dof());
        let mut displacement = force.clone();
        displacement
            .column_mut(response)
            .iter_mut()
            .enumerate()
            .for_each(|(row, to)| *to = of(row));
        Change { force, displacement }
    }

    fn forced(&self, ends: &[(usize, f64)], of: impl Fn(usize) -> Complex<f64>) -> Change {
        let displacement = DMatrix::zeros(self.fit.data.len(), self.fit.data.dof());
        let mut force = displacement.clone();
        for (dof, sign) in ends {
            let of_end = force.column_mut(*dof);
            of_end.into_iter().enumerate().for_each(|(row, to)| *to = of(row) * *sign);
        }
        Change { force, displacement }
    }

    /// Returns the spectrum of a [`Power`], such as x³, of a displacement or velocity, one value
    /// per row. The power is computed at all samples of each record. The initial and final
    /// conditions of a record add only a transient to this spectrum.
    fn power_of(
        &self,
        power: Power,
        dof: usize,
        other: Option<usize>,
    ) -> Option<Vec<Complex<f64>>> {
        let omega = self.fit.data.omega();
        let mut values = vec![Complex::new(0.0, 0.0); omega.len()];
        for SampledRows { rows, sampling } in self.records {
            let line = |row: usize| (omega[row] / sampling.omega0()).round() as usize;
            let mut motion: ComplexMatrix = DMatrix::zeros(sampling.len() / 2 + 1, 2);
            for row in rows.clone() {
                let x = self.displacement[(row, dof)]
                    - other.map_or(Complex::new(0.0, 0.0), |o| self.displacement[(row, o)]);
                let line_index = line(row);
                motion[(line_index, 0)] = x;
                motion[(line_index, 1)] = x * Complex::new(0.0, omega[row]);
            }
            let motion = Spectrum::from_lines(*sampling, motion).ok()?.to_record().ok()?;
            let of_sample = |(x, v): (&f64, &f64)| power.value(*x, *v);
            let both = motion.channel(0).iter().zip(motion.channel(1));
            let force = Record::from_channel(*sampling, both.map(of_sample).collect()).ok()?;
            let force = Spectrum::from_record(&force);
            for row in rows.clone() {
                values[row] = force.line(line(row), 0);
            }
        }
        Some(values)
    }
}

/// Serialises an entry by its name.
#[cfg(feature = "serde")]
fn as_text<S: serde::Serializer>(entry: &Parameter, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_str(entry)
}

/// Serialises an index counted from 1.
#[cfg(feature = "serde")]
fn from_one<S: serde::Serializer>(index: &usize, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_u64(*index as u64 + 1)
}

/// Serialises an optional index as a number counted from 1.
#[cfg(feature = "serde")]
fn maybe_from_one<S: serde::Serializer>(
    index: &Option<usize>,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    match index {
        Some(index) => serializer.serialize_some(&(index + 1)),
        None => serializer.serialize_none(),
    }
}
