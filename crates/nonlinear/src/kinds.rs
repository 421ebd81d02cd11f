//! Usual kinds of nonlinear terms, for the test of distortion and for the search for missing terms
//! of a fit.

use mechid_estimate::EstimateError;
use mechid_model::{Coordinate, Friction, Law, ModelError, Power, QuadraticDamping, Term, Terms};

use super::{NonlinearEstimate, SteadyExperiments};
use crate::limits::{DISTORTION_PAIRS, FRICTION_WIDTH};

/// Kinds of terms in the test of distortion. Each has the exponents of displacement and velocity
/// (`None` for quadratic damping) and a name.
const TESTED: [(Option<[u32; 2]>, &str); 4] = [
    (Some([2, 0]), "quadratic stiffness"),
    (Some([3, 0]), "cubic stiffness"),
    (None, "quadratic damping"),
    (Some([0, 3]), "cubic damping"),
];

/// Exponents of displacement and velocity in the terms that [`further_terms`] adds to [`TESTED`]: a
/// spring force in proportion to the fifth power of the displacement, and damping that depends on
/// the displacement.
const FURTHER: [[u32; 2]; 3] = [[5, 0], [1, 1], [2, 1]];

/// Friction with a known constant b (a velocity), because records of fast motion do not determine
/// b.
#[derive(Debug)]
struct KnownFriction(Friction);

impl Law for KnownFriction {
    fn value(&self, q: f64, v: f64) -> f64 {
        self.0.value(q, v)
    }

    fn slopes(&self, q: f64, v: f64) -> [f64; 2] {
        self.0.slopes(q, v)
    }

    fn dimension(&self) -> [i32; 2] {
        self.0.dimension()
    }

    fn expression(&self, q: &str, v: &str) -> String {
        self.0.expression(q, v)
    }
}

/// Returns one term of each tested kind for each coordinate, and their names.
pub(super) fn tested_kinds(dof: usize) -> Result<(Terms, Vec<String>), EstimateError> {
    let (mut terms, mut names) = (Vec::new(), Vec::new());
    for coordinate in coordinates(dof) {
        for (exponents, name) in TESTED {
            terms.push(term(terms.len(), coordinate, exponents)?);
            names.push(match coordinate {
                Coordinate::Dof(i) => format!("{name} of x{}", i + 1),
                Coordinate::Difference(i, j) => format!("{name} between x{} and x{}", i + 1, j + 1),
            });
        }
    }
    Ok((Terms::new(terms)?, names))
}

/// Returns the terms of the usual kinds that are missing in a fit: springs of the second, third and
/// fifth power, quadratic and cubic damping, damping that depends on the displacement, and
/// friction. Each kind has a term for each degree of freedom and, with up to four degrees of
/// freedom, between any two of them.
///
/// # Errors
/// [`EstimateError::Model`] if a term is not valid.
///
/// # Source
/// Kerschen, Worden, Vakakis & Golinval (2006), Mechanical Systems and Signal Processing 20,
/// 505–592 (usual nonlinearities of structures).
pub fn further_terms(
    data: &SteadyExperiments,
    fit: &NonlinearEstimate,
) -> Result<Terms, EstimateError> {
    further_terms_up_to(fit, |term| {
        let probe = Terms::new(vec![term.clone()]);
        probe.map_or(0.0, |probe| data.ranges(&probe, &fit.channels())[0][1])
    })
}

/// Returns the terms of [`further_terms`]; `fastest` returns the largest velocity (m/s) of the
/// coordinate of a term; this velocity scales the friction.
pub(super) fn further_terms_up_to(
    fit: &NonlinearEstimate,
    fastest: impl Fn(&Term) -> f64,
) -> Result<Terms, EstimateError> {
    let mut terms: Vec<Term> = Vec::new();
    let powers = TESTED.iter().map(|(exponents, _)| *exponents).chain(FURTHER.map(Some));
    for coordinate in coordinates(fit.linear().dof()) {
        for exponents in powers.clone() {
            let further = term(terms.len(), coordinate, exponents)?;
            if !fit.terms().iter().any(|one| is_same_force(one, &further)) {
                terms.push(further);
            }
        }
        let fastest = fastest(&term(0, coordinate, None)?);
        let is_friction =
            |one: &Term| is_same_coordinate(one.coordinate(), coordinate) && is_bounded(one.law());
        if fastest > 0.0 && !fit.terms().iter().any(is_friction) {
            // The velocity is rounded, so that a message can show it.
            let width = FRICTION_WIDTH * fastest;
            let step = 10f64.powf(width.log10().floor());
            let law = KnownFriction(Friction::new(step * (width / step).round())?);
            terms.push(Term::new(name(terms.len()), coordinate, law)?);
        }
    }
    Ok(Terms::new(terms)?)
}

/// Returns every degree of freedom and, if there are few degrees of freedom, every pair of them.
fn coordinates(dof: usize) -> impl Iterator<Item = Coordinate> {
    let pairs = (0..dof).flat_map(move |i| (i + 1..dof).map(move |j| Coordinate::Difference(i, j)));
    (0..dof).map(Coordinate::Dof).chain(pairs.filter(move |_| dof <= DISTORTION_PAIRS))
}

fn name(at: usize) -> String {
    format!("t_{}", at + 1)
}

/// Returns a term with a power law, or with quadratic damping.
fn term(
    at: usize,
    coordinate: Coordinate,
    exponents: Option<[u32; 2]>,
) -> Result<Term, ModelError> {
    match exponents {
        Some([p, r]) => Term::new(name(at), coordinate, Power::new(p, r)?),
        None => Term::new(name(at), coordinate, QuadraticDamping),
    }
}

/// Returns whether two terms have the same law and the same coordinate, in either direction.
fn is_same_force(one: &Term, other: &Term) -> bool {
    let expression = |term: &Term| term.law().expression("q", "v");
    is_same_coordinate(one.coordinate(), other.coordinate()) && expression(one) == expression(other)
}

fn is_same_coordinate(one: Coordinate, other: Coordinate) -> bool {
    let dofs = |coordinate: Coordinate| {
        let mut dofs: Vec<usize> = coordinate.signs().map(|(dof, _)| dof).collect();
        dofs.sort_unstable();
        dofs
    };
    dofs(one) == dofs(other)
}

/// Returns whether the value of a law is a pure number that changes with the motion, as for
/// friction.
fn is_bounded(law: &dyn Law) -> bool {
    law.dimension() == [0, 0] && !law.is_constant()
}
