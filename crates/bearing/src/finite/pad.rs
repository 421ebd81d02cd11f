//! The bore of a bearing: arcs between axial grooves.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use nalgebra::Vector2;

use crate::error::{BearingError, require};

/// The shape of a bore: a circle or two lobes, with or without axial grooves.
///
/// Angles are counted from the static load in the direction of rotation. Oil at ambient pressure
/// fills the grooves and surrounds the ends of the bearing.
#[derive(Debug, Clone, PartialEq)]
pub struct Bore {
    pads: Vec<Pad>,
}

impl Bore {
    /// Returns a circular bore without grooves, with its oil supply at the ends.
    pub fn plain() -> Self {
        Self { pads: vec![Pad { edges: [f64::NEG_INFINITY, f64::INFINITY], centre: [0.0; 2] }] }
    }

    /// Returns a circular bore with two axial grooves of `groove` rad each, at right angles to the
    /// load.
    ///
    /// # Errors
    /// [`BearingError::Parameter`] if the groove is not between 0 and π rad.
    pub fn two_axial_grooves(groove: f64) -> Result<Self, BearingError> {
        Self::elliptical(0.0, groove)
    }

    /// Returns a bore of two lobes whose centres are `preload` pad clearances above and below the
    /// middle, with two axial grooves of `groove` rad each between them, at right angles to the
    /// load.
    ///
    /// The preload (a ratio) is 1 − assembled clearance / pad clearance.
    ///
    /// # Errors
    /// [`BearingError::Parameter`] if the preload is not at least 0 and below 1, or the groove not
    /// between 0 and π rad.
    pub fn elliptical(preload: f64, groove: f64) -> Result<Self, BearingError> {
        require("preload", preload, "at least 0 and below 1", (0.0..1.0).contains(&preload))?;
        let between = (0.0..PI).contains(&groove);
        require("angle of the groove", groove, "at least 0 and below π rad", between)?;
        let half = FRAC_PI_2 - groove / 2.0;
        Ok(Self {
            pads: vec![
                Pad { edges: [-half, half], centre: [-preload, 0.0] },
                Pad { edges: [PI - half, PI + half], centre: [preload, 0.0] },
            ],
        })
    }

    pub(super) fn pads(&self) -> &[Pad] {
        &self.pads
    }

    /// Returns the smallest film thickness, relative to the pad clearance.
    pub(super) fn thinnest(&self, position: Vector2<f64>) -> f64 {
        self.pads.iter().map(|pad| pad.thinnest(position)).fold(f64::INFINITY, f64::min)
    }
}

/// An arc of the bore between two grooves, or the whole bore.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Pad {
    /// Angles of the first and the last edge of the pad, in rad; infinite for a bore without
    /// grooves.
    pub(super) edges: [f64; 2],
    /// Coordinates of the centre of curvature of the pad, along the load and across, in pad
    /// clearances.
    pub(super) centre: [f64; 2],
}

impl Pad {
    /// Position of the journal from the centre of curvature, in pad clearances.
    pub(super) fn relative(&self, position: Vector2<f64>) -> Vector2<f64> {
        position - Vector2::from(self.centre)
    }

    fn thinnest(&self, position: Vector2<f64>) -> f64 {
        let [x, y]: [f64; 2] = self.relative(position).into();
        let thickness = |angle: f64| 1.0 - x * angle.cos() - y * angle.sin();
        let [first, last] = self.edges;
        let angle = y.atan2(x);
        let within = [angle, angle + TAU].iter().any(|angle| (first..=last).contains(angle));
        if within { 1.0 - x.hypot(y) } else { thickness(first).min(thickness(last)) }
    }

    /// Returns the angles between which the film converges, in rad; `None` if their difference is
    /// at most 0.001 rad.
    ///
    /// A pad that covers at most half the circumference, or the whole of it, has one converging
    /// arc.
    pub(super) fn converging(&self, position: Vector2<f64>) -> Option<[f64; 2]> {
        let relative = self.relative(position);
        let thinnest = relative[1].atan2(relative[0]);
        [0.0, 1.0, -1.0]
            .map(|turn| {
                let end = thinnest + turn * TAU;
                [(end - PI).max(self.edges[0]), end.min(self.edges[1])]
            })
            .into_iter()
            .reduce(|a, b| if b[1] - b[0] > a[1] - a[0] + 1e-9 { b } else { a })
            .filter(|arc| arc[1] - arc[0] > 1e-3)
    }
}
