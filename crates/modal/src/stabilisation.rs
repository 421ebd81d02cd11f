//! Poles of models of rising order: their stability from order to order, and their clusters.

use nalgebra::{Complex, DMatrix, DVector};

use crate::decomposition;
use crate::indicators::mac;

/// Largest relative change of the frequency of a stable pole from one order to the next.
pub const STABLE_FREQUENCY: f64 = 0.01;

/// Largest relative change of the damping ratio of a stable pole from one order to the next.
pub const STABLE_DAMPING: f64 = 0.05;

/// Largest value of 1 − MAC for a stable pole. The MAC compares the participations (or shapes) of
/// the pole in two successive orders.
pub const STABLE_VECTOR: f64 = 0.02;

/// Minimum radius of a cluster, in relative frequency: the half-power width of very lightly damped
/// poles is smaller than their scatter due to rounding and noise.
const CLUSTER_FREQUENCY: f64 = 4e-4;

/// Maximum radius of a cluster, in relative frequency, even for strong damping.
const CLUSTER_REACH: f64 = 0.005;

/// Maximum distance in damping of a member from the centre of its cluster, relative to the damping
/// of the centre.
const CLUSTER_DAMPING: f64 = 0.3;

/// Maximum distance in frequency between a cluster and a further pole that counts as part of this
/// cluster. The distance is from the median of the cluster, relative to the decay rate of the
/// median.
const CLUSTER_CLAIM: f64 = 0.3;

/// Pole of a model of one order.
#[derive(Debug, Clone, PartialEq)]
pub struct Pole {
    /// λ, in rad/s, with Im λ > 0 and Re λ < 0.
    pub pole: Complex<f64>,
    /// Vector of unit length: participation of the inputs (tables of frequency responses) or shape
    /// of the outputs (ambient records).
    pub vector: DVector<Complex<f64>>,
}

impl Pole {
    /// Returns the natural frequency |λ|/2π, in Hz.
    pub fn natural_frequency_hz(&self) -> f64 {
        self.pole.norm() / std::f64::consts::TAU
    }

    /// Returns the damping ratio −Re λ/|λ|.
    pub fn damping_ratio(&self) -> f64 {
        -self.pole.re / self.pole.norm()
    }
}

/// Pole of a stabilisation diagram.
#[derive(Debug, Clone, PartialEq)]
pub struct StabilisationPole {
    /// Order of the model.
    pub order: usize,
    /// The pole.
    pub pole: Pole,
    /// `true` if the frequency of the nearest pole of the previous order differs by at most
    /// [`STABLE_FREQUENCY`].
    pub stable_frequency: bool,
    /// `true` if the frequency is stable and the damping ratio of the nearest pole of the previous
    /// order differs by at most [`STABLE_DAMPING`].
    pub stable_damping: bool,
    /// `true` if the frequency is stable and participation or shape of the nearest pole of the
    /// previous order agrees within [`STABLE_VECTOR`].
    pub stable_vector: bool,
}

impl StabilisationPole {
    /// Returns whether frequency, damping and vector are stable.
    pub fn is_stable(&self) -> bool {
        self.stable_frequency && self.stable_damping && self.stable_vector
    }
}

/// Cluster of poles of several orders.
#[derive(Debug, Clone, PartialEq)]
pub struct PoleCluster {
    /// Medians of the real and imaginary parts of the poles in the cluster, in rad/s, and the
    /// common direction of their vectors.
    pub pole: Pole,
    /// Fraction of the orders that have a member in the cluster.
    pub share: f64,
}

/// Poles of all orders, in rising order. Each pole is marked as stable or not stable, compared with
/// the preceding order.
///
/// # Source
/// Peeters & Van der Auweraer (2005), Proceedings of the 1st International Operational Modal
/// Analysis Conference (stabilisation diagram).
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Stabilisation {
    orders: Vec<usize>,
    poles: Vec<StabilisationPole>,
}

impl Stabilisation {
    /// Creates the diagram from the poles of each order; the orders must rise.
    pub fn new(models: Vec<(usize, Vec<Pole>)>) -> Self {
        let orders = models.iter().map(|(order, _)| *order).collect();
        let mut poles = Vec::new();
        let mut before: Vec<Pole> = Vec::new();
        for (order, model) in models {
            poles.extend(model.iter().map(|pole| with_stability(order, pole, &before)));
            before = model;
        }
        Self { orders, poles }
    }

    /// Returns the orders.
    pub fn orders(&self) -> &[usize] {
        &self.orders
    }

    /// Returns the poles of all orders.
    pub fn poles(&self) -> &[StabilisationPole] {
        &self.poles
    }

    /// Returns the clusters of poles whose damping ratio is below `max_damping`, by rising
    /// frequency. A cluster has members in at least the fraction `min_share` of the orders.
    pub fn clusters(&self, max_damping: f64, min_share: f64) -> Vec<PoleCluster> {
        let candidates = self.poles.iter().filter(|p| p.pole.damping_ratio() < max_damping);
        let mut free: Vec<&StabilisationPole> = candidates.collect();
        free.sort_by(|a, b| a.pole.pole.norm().total_cmp(&b.pole.pole.norm()));
        let mut clusters: Vec<PoleCluster> = Vec::new();
        while let Some((members, orders)) = densest(&free) {
            let share = orders as f64 / self.orders.len() as f64;
            if share < min_share {
                break;
            }
            let cluster: Vec<&StabilisationPole> = members.iter().map(|i| free[*i]).collect();
            let pole = common_pole(&cluster);
            let claim = CLUSTER_CLAIM * -pole.pole.re;
            let centre = pole.pole.norm();
            let mut index = 0;
            free.retain(|other| {
                let member = members.contains(&index);
                index += 1;
                !member && (other.pole.pole.norm() - centre).abs() >= claim
            });
            clusters.push(PoleCluster { pole, share });
        }
        clusters.sort_by(|a, b| a.pole.pole.norm().total_cmp(&b.pole.pole.norm()));
        clusters
    }
}

fn with_stability(order: usize, pole: &Pole, before: &[Pole]) -> StabilisationPole {
    let distance = |other: &Pole| (other.pole - pole.pole).norm();
    let nearest = before.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)));
    let within = |a: f64, b: f64, tolerance: f64| (a - b).abs() <= tolerance * a.abs();
    let stable_frequency = nearest.is_some_and(|other| {
        within(pole.natural_frequency_hz(), other.natural_frequency_hz(), STABLE_FREQUENCY)
    });
    let stable_damping = stable_frequency
        && nearest.is_some_and(|other| {
            within(pole.damping_ratio(), other.damping_ratio(), STABLE_DAMPING)
        });
    let stable_vector = stable_frequency
        && nearest.is_some_and(|other| 1.0 - mac(&pole.vector, &other.vector) <= STABLE_VECTOR);
    let pole = pole.clone();
    StabilisationPole { order, pole, stable_frequency, stable_damping, stable_vector }
}

/// Returns the members of the neighbourhood that contains poles of the most orders, and the number
/// of these orders.
fn densest(sorted: &[&StabilisationPole]) -> Option<(Vec<usize>, usize)> {
    let frequency = |i: usize| sorted[i].pole.pole.norm();
    let mut best: Option<(Vec<usize>, usize)> = None;
    for centre in 0..sorted.len() {
        let damping = sorted[centre].pole.damping_ratio();
        let radius = CLUSTER_REACH.min((2.0 * damping).max(CLUSTER_FREQUENCY)) * frequency(centre);
        let near = |i: &usize| (frequency(*i) - frequency(centre)).abs() < radius;
        let is_damped_alike = |i: &usize| {
            let gap = (sorted[*i].pole.damping_ratio() - damping).abs();
            gap < CLUSTER_DAMPING * damping + CLUSTER_FREQUENCY / 4.0
        };
        let below = (0..centre).rev().take_while(near);
        let above = (centre..sorted.len()).take_while(near);
        let members: Vec<usize> = below.chain(above).filter(is_damped_alike).collect();
        let mut orders: Vec<usize> = members.iter().map(|i| sorted[*i].order).collect();
        orders.sort_unstable();
        orders.dedup();
        if best.as_ref().is_none_or(|(_, most)| orders.len() > *most) {
            best = Some((members, orders.len()));
        }
    }
    best
}

/// Returns the median pole and the first principal direction of the vectors.
fn common_pole(members: &[&StabilisationPole]) -> Pole {
    let median = |part: fn(&Complex<f64>) -> f64| {
        let mut values: Vec<f64> = members.iter().map(|m| part(&m.pole.pole)).collect();
        values.sort_by(f64::total_cmp);
        values[values.len() / 2]
    };
    let pole = Complex::new(median(|z| z.re), median(|z| z.im));
    let vectors: Vec<_> = members.iter().map(|m| m.pole.vector.clone()).collect();
    let stacked = DMatrix::from_columns(&vectors);
    let direction = decomposition::svd(stacked).and_then(|svd| svd.u);
    let vector = direction.map_or_else(|| vectors[0].clone(), |u| u.column(0).into_owned());
    Pole { pole, vector }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pole(re: f64, im: f64) -> Pole {
        let vector = DVector::from_element(1, Complex::from(1.0));
        Pole { pole: Complex::new(re, im), vector }
    }

    #[test]
    fn poles_that_stay_form_a_cluster_and_those_that_wander_do_not() {
        let models = (2..12).map(|order| {
            let wandering = pole(-1.0, 50.0 + 17.0 * order as f64);
            (order, vec![pole(-1.0, 100.0 + 0.01 * order as f64), wandering])
        });
        let diagram = Stabilisation::new(models.collect());
        let clusters = diagram.clusters(0.1, 0.5);
        assert_eq!(clusters.len(), 1);
        assert!((clusters[0].pole.pole.im - 100.065).abs() < 0.01 && clusters[0].share == 1.0);
        let stable = |near: f64| {
            let near = |p: &&StabilisationPole| (p.pole.pole.im - near).abs() < 0.2;
            diagram.poles().iter().filter(near).filter(|p| p.is_stable()).count()
        };
        assert_eq!(stable(100.06), 9);
        assert!(!diagram.poles()[1].is_stable());
        assert!(Stabilisation::default().clusters(0.1, 0.5).is_empty());
    }

    #[test]
    fn damping_tells_two_clusters_at_one_frequency_apart() {
        let models = (2..12).map(|order| (order, vec![pole(-0.5, 100.0), pole(-4.0, 100.2)]));
        let clusters = Stabilisation::new(models.collect()).clusters(0.1, 0.5);
        let damped: Vec<f64> = clusters.iter().map(|c| -c.pole.pole.re).collect();
        assert_eq!(damped, [0.5, 4.0]);
    }
}
