//! Relations between the entries of M, C and K, and the independent unknowns.

use std::collections::BTreeMap;

use mechid_model::{Matrix, Parameter};
use nalgebra::{DMatrix, DVector};

use crate::Unknowns;

/// Dependence of the free entries θ(p) on the independent unknowns p.
#[derive(Debug, Clone)]
pub struct Relations {
    /// Source of each free entry, in the order of [`Unknowns::free`].
    entries: Vec<Source>,
    /// Number of unknowns that are entries of M, C or K themselves; α and β of proportional damping
    /// follow these unknowns.
    shared: usize,
    proportional: bool,
}

/// Dependence of a free entry on the independent unknowns.
#[derive(Debug, Clone)]
enum Source {
    /// The entry is an unknown, given by its index.
    Shared(usize),
    /// Entry α m + β k of the damping matrix.
    Damping { mass: MatrixEntry, stiffness: MatrixEntry },
}

/// An entry of the mass matrix or of the stiffness matrix.
#[derive(Debug, Clone, Copy)]
enum MatrixEntry {
    Known(f64),
    Shared(usize),
}

impl MatrixEntry {
    fn value(self, unknowns: &[f64]) -> f64 {
        match self {
            Self::Known(value) => value,
            Self::Shared(at) => unknowns[at],
        }
    }
}

impl Relations {
    /// Returns the relations between entries; `None` if every free entry is independent.
    pub fn from_unknowns(unknowns: &Unknowns) -> Option<Self> {
        unknowns.is_related().then(|| Self::new(unknowns, unknowns.has_proportional_damping()))
    }

    /// Returns the linear relations only, without proportional damping.
    pub fn linear(unknowns: &Unknowns) -> Option<Self> {
        unknowns.is_related().then(|| Self::new(unknowns, false))
    }

    fn new(unknowns: &Unknowns, proportional: bool) -> Self {
        let mut places: BTreeMap<(usize, usize, usize), usize> = BTreeMap::new();
        let mut index = |matrix: Matrix, row: usize, column: usize| {
            let key = if unknowns.is_symmetric(matrix) {
                (matrix as usize, row.min(column), row.max(column))
            } else {
                (matrix as usize, row, column)
            };
            let next = places.len();
            *places.entry(key).or_insert(next)
        };
        let free = unknowns.free();
        let of_damping = |p: &Parameter| proportional && p.matrix() == Matrix::Damping;
        let mut entries: Vec<Option<Source>> = free
            .iter()
            .map(|p| {
                let is_shared = !of_damping(p);
                is_shared.then(|| Source::Shared(index(p.matrix(), p.row(), p.column())))
            })
            .collect();
        for (entry, p) in entries.iter_mut().zip(&free) {
            let mut part = |matrix| match unknowns.fixed(matrix, p.row(), p.column()) {
                Some(value) => MatrixEntry::Known(value),
                None => MatrixEntry::Shared(index(matrix, p.row(), p.column())),
            };
            entry.get_or_insert_with(|| Source::Damping {
                mass: part(Matrix::Mass),
                stiffness: part(Matrix::Stiffness),
            });
        }
        let shared = places.len();
        Self { entries: entries.into_iter().flatten().collect(), shared, proportional }
    }

    /// Number of independent unknowns.
    pub fn count(&self) -> usize {
        self.shared + if self.proportional { 2 } else { 0 }
    }

    /// Returns the index of the unknown that gives a free entry; for linear relations only.
    ///
    /// # Panics
    /// For an entry of proportional damping.
    pub fn shared(&self, entry: usize) -> usize {
        match self.entries[entry] {
            Source::Shared(at) => at,
            Source::Damping { .. } => unreachable!("linear relations"),
        }
    }

    /// Returns the free entries θ(p), in SI units.
    ///
    /// # Source
    /// Rayleigh, *The Theory of Sound*, vol. 1 (1877), article 97 (proportional damping).
    pub fn entries(&self, unknowns: &[f64]) -> DVector<f64> {
        let value = |source: &Source| match source {
            Source::Shared(at) => unknowns[*at],
            Source::Damping { mass, stiffness } => {
                unknowns[self.shared] * mass.value(unknowns)
                    + unknowns[self.shared + 1] * stiffness.value(unknowns)
            }
        };
        DVector::from_iterator(self.entries.len(), self.entries.iter().map(value))
    }

    /// Returns the derivative ∂θ/∂p, entries × unknowns, in SI units.
    ///
    /// # Source
    /// As [`Relations::entries`].
    pub fn tangent(&self, unknowns: &[f64]) -> DMatrix<f64> {
        let mut tangent = DMatrix::zeros(self.entries.len(), self.count());
        for (row, source) in self.entries.iter().enumerate() {
            match source {
                Source::Shared(at) => tangent[(row, *at)] = 1.0,
                Source::Damping { mass, stiffness } => {
                    for (factor, part) in [(self.shared, mass), (self.shared + 1, stiffness)] {
                        tangent[(row, factor)] = part.value(unknowns);
                        if let MatrixEntry::Shared(at) = part {
                            tangent[(row, *at)] += unknowns[factor];
                        }
                    }
                }
            }
        }
        tangent
    }

    /// Returns the unknowns p of entries that obey the relations, in SI units. If the entries do
    /// not obey them, an unknown is the mean of the entries that share it, and α and β come from a
    /// least-squares fit.
    ///
    /// # Source
    /// As [`Relations::entries`].
    pub fn unknowns(&self, entries: &[f64]) -> DVector<f64> {
        let mut unknowns = DVector::zeros(self.count());
        let mut counts = vec![0.0_f64; self.shared];
        for (source, entry) in self.entries.iter().zip(entries) {
            if let Source::Shared(at) = source {
                unknowns[*at] += entry;
                counts[*at] += 1.0;
            }
        }
        for (value, count) in unknowns.iter_mut().zip(&counts) {
            *value /= count.max(1.0);
        }
        if self.proportional {
            let [alpha, beta] = self.nearest(entries, unknowns.as_slice());
            (unknowns[self.shared], unknowns[self.shared + 1]) = (alpha, beta);
        }
        unknowns
    }

    /// Returns α and β, in SI units, and their gradients with respect to entries that obey the
    /// relations; `None` without proportional damping.
    ///
    /// # Source
    /// As [`Relations::entries`].
    pub fn damping_factors(&self, entries: &[f64]) -> Option<[(f64, DVector<f64>); 2]> {
        if !self.proportional {
            return None;
        }
        let unknowns = self.unknowns(entries);
        let rows = self.damping(unknowns.as_slice());
        let columns = DMatrix::from_fn(rows.len(), 2, |row, part| rows[row].1[part]);
        let lengths = [0, 1].map(|part| columns.column(part).norm());
        let factors = [unknowns[self.shared], unknowns[self.shared + 1]];
        let gradient = |of: usize| {
            // The gradient of the factor of M (or K) follows from the part of this matrix that is
            // orthogonal to the other matrix.
            let (column, other) = (columns.column(of), columns.column(1 - of));
            let unit = if lengths[1 - of] > 0.0 { other / lengths[1 - of] } else { other.into() };
            let orthogonal = column - &unit * unit.dot(&column);
            let weights = &orthogonal / orthogonal.norm_squared();
            let mut gradient = DVector::zeros(self.entries.len());
            for ((entry, _), weight) in rows.iter().zip(weights.iter()) {
                gradient[*entry] += weight;
                let Source::Damping { mass, stiffness } = &self.entries[*entry] else { continue };
                for (part, factor) in [mass, stiffness].into_iter().zip(factors) {
                    let MatrixEntry::Shared(at) = part else { continue };
                    let same = |s: &Source| matches!(s, Source::Shared(of) if of == at);
                    let index = self.entries.iter().position(same).expect("a free entry");
                    gradient[index] -= factor * weight;
                }
            }
            gradient
        };
        Some([(factors[0], gradient(0)), (factors[1], gradient(1))])
    }

    /// Returns, for every free entry of proportional damping, its index and the mass and stiffness
    /// entries at the same position.
    fn damping(&self, unknowns: &[f64]) -> Vec<(usize, [f64; 2])> {
        let row = |(at, source): (usize, &Source)| match source {
            Source::Shared(_) => None,
            Source::Damping { mass, stiffness } => {
                Some((at, [mass.value(unknowns), stiffness.value(unknowns)]))
            }
        };
        self.entries.iter().enumerate().filter_map(row).collect()
    }

    /// Returns α and β of the least-squares fit C ≈ αM + βK over the free entries of the damping.
    fn nearest(&self, entries: &[f64], unknowns: &[f64]) -> [f64; 2] {
        let rows = self.damping(unknowns);
        let rows = rows.iter().map(|(at, [mass, stiffness])| [*mass, *stiffness, entries[*at]]);
        let mut products = [[0.0; 3]; 3];
        for row in rows {
            for (i, left) in row.iter().enumerate() {
                for (j, right) in row.iter().enumerate() {
                    products[i][j] += left * right;
                }
            }
        }
        let [[mm, mk, mc], [_, kk, kc], _] = products;
        let determinant = mm * kk - mk * mk;
        // The damping is attributed to the stiffness if αM and βK are indistinguishable.
        if determinant > 1e-12 * mm * kk {
            [(kk * mc - mk * kc) / determinant, (mm * kc - mk * mc) / determinant]
        } else if kk > 0.0 {
            [0.0, kc / kk]
        } else {
            [if mm > 0.0 { mc / mm } else { 0.0 }, 0.0]
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Three masses in a row with proportional damping.
    fn chain() -> Unknowns {
        let mut unknowns = Unknowns::unknown_mass(3).unwrap();
        for (matrix, row, column) in [
            (Matrix::Mass, 0, 1),
            (Matrix::Mass, 0, 2),
            (Matrix::Mass, 1, 2),
            (Matrix::Stiffness, 0, 2),
        ] {
            unknowns = unknowns.symmetric(matrix).unwrap().fix(matrix, row, column, 0.0).unwrap();
        }
        unknowns.proportional_damping().unwrap()
    }

    #[test]
    fn entries_follow_from_independent_unknowns_and_lead_back_to_them() {
        let unknowns = chain();
        let relations = Relations::from_unknowns(&unknowns).unwrap();
        // The unknowns are m1, m2, m3, then k11, k12, k22, k23, k33, then α and β.
        assert_eq!(relations.count(), 10);
        let p = [2.0, 3.0, 4.0, 50.0, -20.0, 60.0, -30.0, 70.0, 0.5, 0.01];
        let [m, c, k] = unknowns.assemble(relations.entries(&p).as_slice());
        assert_eq!(m, DMatrix::from_diagonal(&nalgebra::dvector![2.0, 3.0, 4.0]));
        let stiffness = nalgebra::dmatrix![
            50.0, -20.0, 0.0;
            -20.0, 60.0, -30.0;
            0.0, -30.0, 70.0
        ];
        assert_eq!(k, stiffness);
        assert!((c - (&m * 0.5 + &k * 0.01)).amax() < 1e-15);
        let back = relations.unknowns(relations.entries(&p).as_slice());
        assert!((back - DVector::from_column_slice(&p)).amax() < 1e-12);
    }

    #[test]
    fn the_tangent_is_the_derivative_of_the_entries() {
        let relations = Relations::from_unknowns(&chain()).unwrap();
        let p = DVector::from_fn(relations.count(), |at, _| 1.0 + (3.0 * at as f64).sin());
        let tangent = relations.tangent(p.as_slice());
        for (at, column) in tangent.column_iter().enumerate() {
            let moved = |by: f64| {
                let mut p = p.clone();
                p[at] += by;
                relations.entries(p.as_slice())
            };
            let difference = (moved(1e-3) - moved(-1e-3)) / 2e-3;
            assert!((difference - column).amax() < 1e-10);
        }
    }

    #[test]
    fn unrelated_entries_have_no_relations() {
        assert!(Relations::from_unknowns(&Unknowns::unknown_mass(2).unwrap()).is_none());
    }
}
