//! The terms of an identified system as a nonlinear force.

use mechid_model::{Coordinate, ModelError, Term, Terms};

use crate::nonlinear::force::{NonlinearForce, Tangents};

/// Nonlinear springs and dampers in the form in which they are identified: each term has the force
/// θ f(q, q̇).
///
/// ```
/// use mechid_integrate::{NonlinearForce, TermForces};
///
/// // Between degrees of freedom 1 and 2: 5 (x1 − x2)³.
/// let spring = TermForces::new(&"k3: (x1-x2)^3".parse()?, &[5.0])?;
/// let mut g = [0.0; 2];
/// spring.force(0.0, &[3.0, 1.0], &[0.0; 2], &mut g);
/// assert_eq!((spring.dofs(), g), (&[0, 1][..], [40.0, -40.0]));
/// # Ok::<(), mechid_model::ModelError>(())
/// ```
#[derive(Debug, Clone)]
pub struct TermForces {
    /// Degrees of freedom of the terms, counted from 0, in ascending order.
    dofs: Vec<usize>,
    /// Each term with its coefficient, and its coordinate by index into `dofs`.
    terms: Vec<(Term, f64, Coordinate)>,
}

impl TermForces {
    /// Creates the forces from terms and their coefficients, each in its own unit.
    ///
    /// # Errors
    /// [`ModelError::Coefficients`] unless there is one finite coefficient for each term.
    pub fn new(terms: &Terms, coefficients: &[f64]) -> Result<Self, ModelError> {
        terms.check_coefficients(coefficients)?;
        let mut dofs: Vec<usize> =
            terms.iter().flat_map(|term| dofs_of(term.coordinate())).collect();
        dofs.sort_unstable();
        dofs.dedup();
        let index = |dof: usize| dofs.binary_search(&dof).expect("an end of a term");
        let local = |coordinate: Coordinate| match coordinate {
            Coordinate::Dof(i) => Coordinate::Dof(index(i)),
            Coordinate::Difference(i, j) => Coordinate::Difference(index(i), index(j)),
        };
        let terms = terms.iter().zip(coefficients);
        let terms = terms.map(|(term, c)| (term.clone(), *c, local(term.coordinate()))).collect();
        Ok(Self { dofs, terms })
    }
}

/// Returns the degrees of freedom of a coordinate: one, or two for a difference.
fn dofs_of(coordinate: Coordinate) -> Vec<usize> {
    match coordinate {
        Coordinate::Dof(i) => vec![i],
        Coordinate::Difference(i, j) => vec![i, j],
    }
}

impl NonlinearForce for TermForces {
    fn dofs(&self) -> &[usize] {
        &self.dofs
    }

    fn force(&self, _time: f64, x: &[f64], v: &[f64], g: &mut [f64]) {
        g.fill(0.0);
        for (term, coefficient, at) in &self.terms {
            let value = coefficient * term.law().value(at.value(x), at.value(v));
            at.signs().for_each(|(place, sign)| g[place] += sign * value);
        }
    }

    fn tangents(&self, _time: f64, x: &[f64], v: &[f64], tangents: &mut Tangents) -> bool {
        tangents.stiffness.fill(0.0);
        tangents.damping.fill(0.0);
        for (term, coefficient, at) in &self.terms {
            let slopes = term.law().slopes(at.value(x), at.value(v));
            let both = [&mut tangents.stiffness, &mut tangents.damping];
            for (tangent, slope) in both.into_iter().zip(slopes) {
                for (column, of_column) in at.signs() {
                    for (row, of_row) in at.signs() {
                        tangent[(row, column)] += of_row * of_column * coefficient * slope;
                    }
                }
            }
        }
        true
    }
}
