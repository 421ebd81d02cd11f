//! Initial participations: free residues at given poles, each reduced to its leading direction.

use nalgebra::Complex;

use crate::lines::{Block, Lines};
use crate::model::{Model, ResidualPowers, growth, kernels, level_near, select_kernel, write_pair};
use crate::projection::{Design, Projection, Weights};

/// Linear model with an unconstrained residue for every mode and load, and with residual terms for
/// the modes outside the band.
pub(crate) struct FreeResidues<'a> {
    /// Poles and powers of jω in the residual terms; the participations are not used.
    pub(crate) model: &'a Model,
}

impl FreeResidues<'_> {
    fn pair(&self, lines: &Lines, mode: usize, load: usize) -> usize {
        2 * (mode * lines.loads.len() + load)
    }
}

impl Design for FreeResidues<'_> {
    fn columns(&self, lines: &Lines) -> usize {
        let modes = self.model.modes();
        self.model.columns(lines) - 2 * modes + 2 * modes * lines.loads.len()
    }

    fn block_columns(&self, lines: &Lines, block: &Block) -> Vec<usize> {
        let modes = self.model.modes();
        let shift = 2 * modes * (lines.loads.len() - 1);
        let pairs = (0..modes).flat_map(|mode| block.active.iter().map(move |load| (mode, *load)));
        let modal = pairs.flat_map(|(mode, load)| {
            let first = self.pair(lines, mode, load);
            [first, first + 1]
        });
        let residuals = self.model.block_columns(lines, block).into_iter().skip(2 * modes);
        modal.chain(residuals.map(|column| column + shift)).collect()
    }

    fn fill(&self, lines: &Lines, block: &Block, weight: &[f64], columns: &mut [f64]) {
        let (n, active) = (block.len(), &block.active);
        let (modal, residual) = columns.split_at_mut(4 * n * self.model.modes() * active.len());
        let pairs = modal.chunks_exact_mut(4 * n * active.len().max(1));
        for (pole, pairs) in self.model.poles.iter().zip(pairs) {
            let growth = growth(*pole, block);
            for (line, weight) in weight.iter().enumerate() {
                let (force, transient) = kernels(*pole, lines, block, line, growth);
                for (pair, &load) in pairs.chunks_exact_mut(4 * n).zip(active) {
                    let amplitude = lines.load(load, block.rows.start + line);
                    let kernel = select_kernel(lines.loads[load], force, transient);
                    let (a, b) = (amplitude * kernel.value, amplitude * kernel.mirror);
                    write_pair(pair, line, n, *weight, a, b);
                }
            }
        }
        self.model.fill_residuals(lines, block, weight, residual);
    }
}

/// Returns a model at given poles whose participations are the leading directions of the free
/// residues.
pub(crate) fn with_participations(
    lines: &Lines,
    poles: Vec<Complex<f64>>,
    powers: &ResidualPowers,
    weights: &Weights,
) -> Model {
    let (modes, loads) = (poles.len(), lines.loads.len());
    let mut model = Model {
        poles,
        participation: vec![vec![Complex::new(1.0, 0.0); loads]; modes],
        gauge: vec![0; modes],
        powers: powers.clone(),
        reference: lines.band().1,
    };
    if loads > 1 && modes > 0 {
        let design = FreeResidues { model: &model };
        let mut projection = Projection::default();
        projection.whiten(lines, weights);
        projection.solve(lines, &design);
        let columns = projection.triangle.size;
        let levels = level_near(&model.poles, lines);
        let leading = |mode: usize| {
            let first = design.pair(lines, mode, 0);
            let rows: Vec<Vec<Complex<f64>>> = projection
                .unknowns
                .chunks_exact(columns)
                .map(|unknowns| {
                    let residue = |load: usize| {
                        let pair = &unknowns[first + 2 * load..first + 2 * load + 2];
                        Complex::new(pair[0], pair[1]) * levels[mode][load]
                    };
                    (0..loads).map(residue).collect()
                })
                .collect();
            let direction = leading_row(&rows);
            direction.iter().zip(&levels[mode]).map(|(value, level)| value / *level).collect()
        };
        model.participation = (0..modes).map(leading).collect();
    }
    model.fix_gauge(lines);
    model
}

/// Returns the leading right singular direction of a matrix given by its rows, by power iteration
/// of RᴴR.
pub(crate) fn leading_row(rows: &[Vec<Complex<f64>>]) -> Vec<Complex<f64>> {
    /// Number of steps of the power iteration. If two singular values are nearly equal, the
    /// iteration does not converge, but any of its directions is good enough as an initial
    /// estimate.
    const STEPS: usize = 30;
    let norm = |row: &Vec<Complex<f64>>| row.iter().map(|z| z.norm_sqr()).sum::<f64>();
    let Some(strongest) = rows.iter().max_by(|a, b| norm(a).total_cmp(&norm(b))) else {
        return Vec::new();
    };
    let mut direction = strongest.clone();
    for _ in 0..STEPS {
        let length = norm(&direction).sqrt();
        if !(length > 0.0 && length.is_finite()) {
            return vec![Complex::new(1.0, 0.0); direction.len()];
        }
        direction.iter_mut().for_each(|z| *z /= length);
        let mut next = vec![Complex::default(); direction.len()];
        for row in rows {
            let along: Complex<f64> = row.iter().zip(&direction).map(|(r, d)| r * d.conj()).sum();
            next.iter_mut().zip(row).for_each(|(to, r)| *to += along.conj() * r);
        }
        direction = next;
    }
    direction
}
